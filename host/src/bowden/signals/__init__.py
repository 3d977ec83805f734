"""What samples can mean: paths behind counts, noise, motion, and what the model makes of them.

Pure functions over a `Recording`'s arrays and a `Model`. Nothing here knows a hypothesis;
`bowden.estimation` weighs models by what is found here.
"""
