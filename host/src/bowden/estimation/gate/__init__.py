"""The data gate: checks that recordings are usable for this rig, before anything is fitted.

Every command that takes recordings asks `check.check_data` first. Recordings and a model in,
findings out; a finding that stops means ``bad_data`` and exit status 2.

`time_base`, `sensors` and `encoders` look at channels by themselves; `units` holds them against
the model: `mistakes` lists how a file can be wrong, `answer` simulates, `explain` fits gain, zero,
delay and a smooth discrepancy, `readings` weighs. `course` looks for what changes on the way,
`rigs` for recordings that contradict each other.
"""
