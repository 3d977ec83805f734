"""An STM32F405 in software: the flashed ELF runs here, instruction by instruction.

``*.c`` is the machine (core on libunicorn, register models from the reference manual);
``machine.py`` drives it from Python; ``hil_tests.targets.emulated`` wires it to the simulated rig.
"""
