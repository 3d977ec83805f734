"""How well a drive renders a wanted torque through cables that it does not know exactly.

`rigs` draws rigs at random and what the drive assumes of them, `tasks` are what the operator does
with the handle, `trial` runs one task with one compensation law, `measures` judges it, `table` sums
many up. `python -m hil_tests.render --seed 1 --law model-inversion --task tunnel --plot OUT.html`
shows one; `python -m hil_tests.benchmarks --only render` measures many. Nothing here knows how a
law works: laws are chosen and configured over the bus, as a lab does.

Wanted is the torque of the cables on the load: the tunnel's, or the target torque, times the
transmission ratio. The errors are against the truth of the rig, not against its load cell.
"""
