"""Recordings with a hidden truth, for the benchmark of `bowden diagnose`.

`continuum` (with `cable_profile`) is the true pair, `effects` and `unlisted` what can be hidden in
it, `excitation` the motions, `recordings` the cases: a recording as a lab would hand it in, the
lab's model file, and the truth apart. Nothing here imports `bowden.model`.
"""
