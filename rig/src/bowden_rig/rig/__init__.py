"""The simulated rig: everything that is connected to the drive. Never imports `bowden.model`.

`parameters` describes it and `hidden` puts an effect of the catalogue into it; `constants` reduces
it to numbers for the compiled kernels: `mechanics` (motor, load, operator), `cable`,
`slow_changes`, `operator` (the operator's intended motion) and `sensors`, which work on the scalars
that `state` names. `plant` owns the mechanical state and `rig` puts all together: actuators in, one
control period, sensors out.
"""
