"""The single-fault campaign: what one broken line does to the operator, and what the drive does.

Every sensor, actuator line and message of the host gets every kind of fault (`faults`) in every
state and under every compensation law (`situations`). `trial` runs a drive on the simulated rig
with the fault, and twice without: healthy, and with the bridge switched off at the onset. Torque
outside the hull of those two at the load is torque that nothing asked for; `outcome` integrates and
judges it. `python -m hil_tests.fault_campaign` runs everything and writes docs/fault-campaign.md
(`page`). Rows that break a ceiling stand with their reason in exceptions.yaml (`exceptions`).
"""
