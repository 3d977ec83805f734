"""One estimation core: parameters with priors, one likelihood, a posterior with intervals.

`calibrate`, `estimate` and `diagnose` fit through this package. Reads `signals` and `model`; knows
no report and no command. The order of the data: `parameters` and `nuisance` (what may move),
`observations` (which samples count), `covariance` (how their errors are correlated), `likelihood`,
`solve`, `posterior`.
"""
