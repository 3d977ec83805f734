"""What the project is measured by: speed of the model, of the drive and of the bench, losses.

`python -m hil_tests.benchmarks --output build/bench.json` runs every subject, one module each, and
writes a list of {name, value, unit, context}. Nothing here is a test: figures are compared with
their goals in docs/performance.md.
"""

import os

# One core for every subject, before numpy is loaded: the dense solve would take all of them.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
