"""An STM32F405 in software: the flashed ELF runs here, instruction by instruction.

``*.c`` is the machine: the core on libunicorn, register models from the reference manual RM0090
and the programming manual PM0214. ``machine.py`` drives it from Python;
``hil_tests.targets.emulated`` wires it to the simulated rig. It notes what a program does against
the manual (``Stm32F405.notes``) and every use of what is not modelled (``.unmodelled``).

What it cannot show: cycles (it counts instructions; wait states, branches and loads cost extra on
the chip: the option ``cycles_per_instruction``), interrupt latency below a block of instructions,
electrical CAN and bit timing, ripple and jitter of sampling, silicon errata, float instructions
(they run even when the FPU is off), traps on division by zero and unaligned access, imprecise bus
faults (all are precise here), the process stack, DMA.
"""
