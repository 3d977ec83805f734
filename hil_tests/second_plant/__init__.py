"""A second plant for the compensation's benchmark, with another integrator, friction and operator.

Shares no code with `bowden_rig.rig`; only the description (`parameters.Rig`, plain numbers) is the
same. `cables` solves both cables, both pulleys and the operator implicitly, 40 nodes a cable, with
Dahl friction; `numbers` reduces the description; `sensing` is what the board reads; `plant` puts
them together for a bench and runs them with the natively built drive in one compiled loop.
"""
