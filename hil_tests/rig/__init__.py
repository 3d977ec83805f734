"""The simulated rig: what hangs on the drive's connectors. Never imports `bowden.model`.

`parameters` describes it, `plant` moves it, `human` holds the handle, `sensors` reads it and `rig`
puts them together: actuators in, one control period, sensors out.
"""
