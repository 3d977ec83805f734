"""What the bench's tests run on: `choice` names it, `emulated` and `hardware` are two of them.

The third, the native drive, comes with the simulated rig (`bowden_rig.native`).
"""
