"""Interpretation of samples: paths behind counts, noise, motion, and the model's prediction.

Pure functions over a `Recording`'s arrays and a `Model`. Nothing here depends on a hypothesis;
`bowden.estimation` compares models with these results.
"""
