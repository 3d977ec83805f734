"""The board's pin map and scaling: one table for the firmware's writer, the emulator and the docs.

Chip STM32F405RG (LQFP64). The board firmware (firmware/board/stm32f405) configures these pins;
``targets.emulated`` wires the simulated rig to the same ones. Changing a line here is changing the
hardware.

    signal                 pin          peripheral
    bridge leg A high/low  PA8 / PB13   TIM1_CH1 / CH1N, AF1     centre-aligned 20 kHz, ARR 4200
    bridge leg B high/low  PA9 / PB14   TIM1_CH2 / CH2N, AF1
    bridge fault, low      PB12         TIM1_BKIN, AF1           active low: overcurrent
    motor encoder A / B    PC6 / PC7    TIM3_CH1 / CH2, AF2      encoder mode 3
    motor encoder index    PC8          EXTI8
    load encoder A / B     PB6 / PB7    TIM4_CH1 / CH2, AF2      encoder mode 3
    load encoder index     PB5          EXTI5
    motor current          PC0          ADC1 IN10, injected rank 1
    load cell              PC1          ADC1 IN11, injected rank 2
    bus voltage            PC2          ADC1 IN12, injected rank 3
    conduit temperature    PC3          ADC1 IN13, injected rank 4
    CAN receive / send     PB8 / PB9    CAN1, AF9
    LED                    PC13         low: on

ADC1's injected group is started by TIM1's update (TRGO) once a PWM period, at 20 kHz; a control
tick of 250 us sees the five samples since the last. The bridge is on while TIM1's MOE is set.
A positive duty difference (leg A minus leg B) drives a positive motor current, which drives
theta_m > 0. Encoder counts grow with A leading B.
"""

from __future__ import annotations

from typing import Final

from hil_tests.emulated.pins import Pin

MOTOR_ENCODER_TIMER: Final = 3
MOTOR_ENCODER_A: Final = Pin.named("PC6")
MOTOR_ENCODER_B: Final = Pin.named("PC7")
MOTOR_ENCODER_INDEX: Final = Pin.named("PC8")
LOAD_ENCODER_TIMER: Final = 4
LOAD_ENCODER_A: Final = Pin.named("PB6")
LOAD_ENCODER_B: Final = Pin.named("PB7")
LOAD_ENCODER_INDEX: Final = Pin.named("PB5")
BRIDGE_FAULT: Final = Pin.named("PB12")
LED: Final = Pin.named("PC13")

ADC_CURRENT: Final = 10
ADC_LOAD_CELL: Final = 11
ADC_BUS_VOLTAGE: Final = 12
ADC_TEMPERATURE: Final = 13

# Motor current: 3.3 V / 4096 = 0.806 mV a code, shunt and amplifier 0.1007 V/A; +-16.4 A, which
# leaves half of it above the 8.3 A of the default torque limit of 0.5 N m.
CURRENT_ZERO_CODE: Final = 2048
CURRENT_UA_PER_CODE: Final = 8000

# Load cell: amplifier with 3.2 mN m a code, +-6.55 N m. The firmware passes the drive counts of a
# sixteenth of that, 200 uN m (the dictionary's default gain): 16/5 of the sum of five samples. The
# noise of the amplifier, half a code, dithers: the mean of five resolves about 0.25 code.
LOAD_CELL_ZERO_CODE: Final = 2048
LOAD_CELL_COUNTS_PER_CODE: Final = 16
LOAD_CELL_NOISE_CODES: Final = 0.5

# Bus voltage: divider to 10 mV a code, 40.95 V full scale.
BUS_MV_PER_CODE: Final = 10

# Conduit temperature: sensor with 500 mV at 0 degC and 10 mV/K (TMP36), 3300 mV full scale.
TEMPERATURE_FULL_SCALE_MV: Final = 3300
TEMPERATURE_ZERO_MV: Final = 500
TEMPERATURE_MV_PER_K: Final = 10
