"""Cases for the benchmark of `bowden diagnose` made by the dynamic rig and its drive.

The second source beside the continuum of `hil_tests.hidden_effects`, which it shares the draws and
the definition of strength with. `recording` runs a rig with the natively built drive in virtual
time, `cases` draws what is run. Independent of who looks for what is hidden.
"""
