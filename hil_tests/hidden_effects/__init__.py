"""Recordings with a hidden truth, for the benchmark of `bowden diagnose`.

`continuum` is the true pair (with `pair_motion`, `cable_profile`, `standstill`, `cable_march` and
`cable_law` below it), `effects` and `unlisted` what can be hidden in it, `excitation` the motions,
`strength` what an effect is worth, `recordings` the cases: a recording as a lab would hand it in,
the lab's model file, and the truth apart. Nothing here imports `bowden.model`.
"""
