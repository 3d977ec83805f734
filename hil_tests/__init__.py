"""The bench: simulated rig, targets and the tests that run on all of them."""
