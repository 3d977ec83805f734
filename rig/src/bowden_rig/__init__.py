"""A simulated cable-conduit rig with the drive's real firmware, on any CAN bus.

`rig` is motor, cables, load, operator and sensors; `native` the firmware compiled for this machine,
`targets` whatever else runs it; `bench` steps both in virtual time, `virtual_bus` is a python-can
bus to it, `process` carries its frames to a real bus. Imports nothing of `bowden`.
"""
