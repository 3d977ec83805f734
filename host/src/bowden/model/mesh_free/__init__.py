"""The exact solution for Coulomb friction: no mesh, no discretisation error in space.

`solver.simulate_mesh_free` is the way in. `profile` holds the physics of one cable, `neutral` finds
the point between two sliding directions, `steps` moves both cables through time.
"""
