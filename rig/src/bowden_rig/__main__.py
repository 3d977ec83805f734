"""`python -m bowden_rig`: the simulated rig as a process of its own."""

import sys

from bowden_rig.process import main

if __name__ == "__main__":
    sys.exit(main())
