"""The cable cut into segments: the solver for every friction law and every memory effect.

`solver.simulate_mesh` is the way in. `state` cuts a `Transmission` into segments. `events` and
`zones` step it exactly where only Coulomb friction and Hooke's law act, with `varying` where the
level of friction changes; `implicit`, `chain`, `sliders` and `pulleys` step it otherwise. Both with
a mass at the motor (`motor_mass`) and with a torque that depends on its pulley's angle
(`restoring`).
"""
