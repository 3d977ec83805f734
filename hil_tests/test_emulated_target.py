"""The emulated board behind the Target interface, with a small program on the board's pin map.

The program is no drive: it reports what it reads and follows a current reference that it is sent.
So it shows that pins, scales, signs and time fit together, whatever the real firmware does.
"""

from __future__ import annotations

import can
import pytest
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Motor, Operator, Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.rig.sensors import Sensors

from hil_tests.emulated.elf import Image
from hil_tests.emulated.small_program import NO_COMPILER, emulate
from hil_tests.targets.board_map import CURRENT_UA_PER_CODE
from hil_tests.targets.emulated import BOARD_FAULT_OVERCURRENT, EmulatedTarget

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")

PROGRAM = """
#define TIM1 0x40010000u
#define TIM3 0x40000400u
#define TIM4 0x40000800u
#define TIM6 0x40001000u
#define ADC1 0x40012000u
#define CAN 0x40006400u
static volatile int32_t sums[4], samples, wanted_ua;
static int32_t integral, motor, load; static uint16_t last_motor, last_load; static uint32_t ticks;
static void put(uint32_t box, uint32_t id, uint32_t length, uint32_t low, uint32_t high) {
    uint32_t b = CAN + 0x180 + 16 * box; R(b + 4) = length; R(b + 8) = low; R(b + 12) = high;
    R(b) = id << 21 | 1u; }
void IRQ18(void) { /* 20 kHz: current loop, and sums for the tick */
    R(ADC1) = ~4u;
    for (uint32_t i = 0; i < 4; i++) { sums[i] += (int32_t)R(ADC1 + 0x3C + 4 * i); }
    samples++;
    int32_t error = wanted_ua / 8000 - ((int32_t)R(ADC1 + 0x3C) - 2048);
    integral += error; integral = integral > 8000 ? 8000 : integral < -8000 ? -8000 : integral;
    int32_t u = error * 2 + integral / 4; u = u > 2000 ? 2000 : u < -2000 ? -2000 : u;
    R(TIM1 + 0x34) = (uint32_t)(2100 + u); R(TIM1 + 0x38) = (uint32_t)(2100 - u); }
void IRQ20(void) { /* bytes 0..3: current in uA; byte 4: bridge on */
    if (R(CAN + 0x1B0) >> 21 == 0x201) { wanted_ua = (int32_t)R(CAN + 0x1B8);
        integral = 0; if (R(CAN + 0x1BC) & 1u) { R(TIM1 + 0x44) |= 1u << 15; }
        else { R(TIM1 + 0x44) &= ~(1u << 15); } }
    R(CAN + 0x0C) = 32u; }
void IRQ54(void) { /* 4 kHz */
    R(TIM6 + 0x10) = 0;
    uint16_t m = (uint16_t)R(TIM3 + 0x24), l = (uint16_t)R(TIM4 + 0x24);
    motor += (int16_t)(m - last_motor); load += (int16_t)(l - last_load);
    last_motor = m; last_load = l;
    if (++ticks % 16 == 0 && samples > 0) {
        __asm volatile("cpsid i");
        int32_t s[4]; for (int i = 0; i < 4; i++) { s[i] = sums[i] * 16 / samples; sums[i] = 0; }
        samples = 0; __asm volatile("cpsie i");
        put(0, 0x181, 8, (uint32_t)motor, (uint32_t)load);
        put(1, 0x281, 8, (uint32_t)s[0] | (uint32_t)s[1] << 16,
            (uint32_t)s[2] | (uint32_t)s[3] << 16); }
    R(0x40003000u) = 0xAAAA; }
int main(void) {
    clock_168_mhz();
    CLOCK(0x40023830u, 7); CLOCK(0x40023840u, 1u << 25 | 1u << 4 | 6u); CLOCK(0x40023844u, 0x101);
    R(0x40020000u) = 0xA8000000u | 2u << 16 | 2u << 18; R(0x40020024u) = 0x11;
    R(0x40020400u) = 0x2A0AA000u & ~(3u << 20 | 3u << 22) | 2u << 24; R(0x40020420u) = 0x22000000u;
    R(0x40020424u) = 0x01110099u; R(0x40020800u) = 0xFFu | 2u << 12 | 2u << 14;
    R(0x40020820u) = 0x22000000u;
    R(TIM3 + 0x2C) = 0xFFFF; R(TIM3 + 8) = 3; R(TIM3) = 1; last_motor = (uint16_t)R(TIM3 + 0x24);
    R(TIM4 + 0x2C) = 0xFFFF; R(TIM4 + 8) = 3; R(TIM4) = 1; last_load = (uint16_t)R(TIM4 + 0x24);
    R(CAN) = 1u; while (!(R(CAN + 4) & 1u)) {}
    R(CAN + 0x1C) = 1u << 20 | 10u << 16 | 2u; R(CAN + 0x20C) = 1u; R(CAN + 0x21C) = 1u;
    R(CAN + 0x200) &= ~1u; R(CAN) = 1u << 6; while (R(CAN + 4) & 1u) {} R(CAN + 0x14) = 2u;
    R(ADC1 + 0x304) = 1u << 16; R(ADC1 + 4) = 1u << 8 | 1u << 7;
    R(ADC1 + 0x38) = 3u << 20 | 10u | 11u << 5 | 12u << 10 | 13u << 15;
    R(ADC1 + 8) = 1u | 1u << 20 | 1u << 16; for (volatile int i = 0; i < 200; i++) {}
    PRIORITY(18, 0x10); PRIORITY(54, 0x40); PRIORITY(20, 0x60);
    ENABLE_IRQ(18); ENABLE_IRQ(20); ENABLE_IRQ(54);
    R(TIM1 + 0x18) = 0x6868; R(TIM1 + 0x20) = 0x55; R(TIM1 + 0x2C) = 4200; R(TIM1 + 0x30) = 1;
    R(TIM1 + 0x34) = R(TIM1 + 0x38) = 2100; R(TIM1 + 4) = 2u << 4; R(TIM1 + 0x44) = 1u << 12 | 84u;
    R(TIM1 + 0x14) = 1; R(TIM1) = 1u << 5 | 1u;
    R(TIM6 + 0x28) = 83; R(TIM6 + 0x2C) = 249; R(TIM6 + 0x0C) = 1; R(TIM6) = 1;
    for (;;) { WFI(); } }
"""


@pytest.fixture(scope="module")
def image() -> Image:
    return emulate(PROGRAM).image


def run(target: EmulatedTarget, sensors: Sensors, ticks: int) -> dict[int, can.Message]:
    """Last frame of each identifier after some ticks with the same sample."""
    for _ in range(ticks):
        target.tick(sensors)
    latest = {}
    while (message := target.receive()) is not None:
        latest[message.arbitration_id] = message
    return latest


def command(current_ua: int, on: bool) -> can.Message:
    data = current_ua.to_bytes(4, "little", signed=True) + bytes([on])
    return can.Message(arbitration_id=0x201, data=data, is_extended_id=False)


def signed(data: bytes | bytearray) -> int:
    return int.from_bytes(data, "little", signed=True)


def test_encoders_reach_the_program(image: Image) -> None:
    target = EmulatedTarget(image)
    run(target, Sensors(), 40)
    for motor, load in ((3, -4), (-1234, 5678), (40_000, -50_000)):  # beyond 16 bits
        steps = Sensors(motor_encoder_counts=motor, load_encoder_counts=load)
        half = Sensors(motor_encoder_counts=motor // 2, load_encoder_counts=load // 2)
        run(target, half, 1)
        frames = run(target, steps, 40)
        data = frames[0x181].data
        assert (signed(data[:4]), signed(data[4:])) == (motor, load)
    assert target.chip.notes == []


def test_analogue_channels_reach_the_program_with_their_scales(image: Image) -> None:
    target = EmulatedTarget(image)
    sensors = Sensors(
        load_cell_counts=-12_345, bus_voltage_mv=23_456, conduit_temperature_mdegc=31_000
    )
    data = run(target, sensors, 200)[0x281].data
    current, cell, bus, temperature = (
        int.from_bytes(data[i : i + 2], "little") for i in (0, 2, 4, 6)
    )
    # Means over 80 samples in sixteenths of a code: noise 0.5/sqrt(80) code is 0.9 of these units.
    assert current / 16 == pytest.approx(2048, abs=0.3)
    assert cell - 16 * 2048 == pytest.approx(-12_345, abs=5)  # as the dictionary counts: 200 uN m
    assert bus / 16 * 10 == pytest.approx(23_456, abs=3)
    millivolt = temperature / 16 * 3300 / 4096
    assert (millivolt - 500) * 100 == pytest.approx(31_000, abs=25)


def test_the_bridge_follows_the_program_and_its_fault_input(image: Image) -> None:
    target = EmulatedTarget(image)
    run(target, Sensors(), 40)
    assert target.tick(Sensors()) == (0, False, False)
    target.send(command(2_000_000, True))
    run(target, Sensors(), 60)
    on = target.tick(Sensors())
    assert on.bridge_enabled
    assert on.motor_current_ua == pytest.approx(2_000_000, abs=CURRENT_UA_PER_CODE)
    off = target.tick(Sensors(faults=BOARD_FAULT_OVERCURRENT))
    assert not off.bridge_enabled
    run(target, Sensors(faults=BOARD_FAULT_OVERCURRENT), 4)
    assert target.tick(Sensors(faults=BOARD_FAULT_OVERCURRENT)) == (0, False, False)


def test_reset_is_a_power_cycle(image: Image) -> None:
    target = EmulatedTarget(image)
    target.send(command(2_000_000, True))
    run(target, Sensors(), 60)
    target.reset()
    assert not target.tick(Sensors()).bridge_enabled
    assert 0x181 in run(target, Sensors(motor_encoder_counts=5), 60)


def test_the_loop_closes_on_the_simulated_rig(image: Image) -> None:
    # The load is bolted; a positive current winds cable a: the motor turns positive until the
    # stretched cables hold it, and the emulated timers count the same angle as the rig.
    rig = Rig(motor=Motor(amplifier_bandwidth_hz=10_000), operator=Operator(motion="locked"))
    bench = Bench(SimulatedRig(rig, seed=3), EmulatedTarget(image), trace=True)
    for _ in range(40):
        bench.step()
    bench.to_drive.append(command(2_000_000, True))
    for _ in range(1000):
        bench.step()
    truth = bench.truth()
    assert truth.motor_torque_nm[-200:].mean() == pytest.approx(0.060 * 2.0, rel=0.02)
    assert truth.motor_angle_rad[-1] > 0.005
    counts = [m for m in bench.from_drive if m.arbitration_id == 0x181][-1]
    assert signed(counts.data[:4]) == pytest.approx(bench.rig.sensors.motor_encoder_counts, abs=1)


def test_the_same_run_gives_the_same_frames(image: Image) -> None:
    seen = []
    for _ in range(2):
        bench = Bench(SimulatedRig(Rig(), seed=1), EmulatedTarget(image))
        bench.to_drive.append(command(1_000_000, True))
        for _ in range(400):
            bench.step()
        target = bench.target
        assert isinstance(target, EmulatedTarget)
        frames = [(m.timestamp, m.arbitration_id, bytes(m.data)) for m in bench.from_drive]
        seen.append((frames, target.chip.instructions))
    assert seen[0] == seen[1]
    assert len(seen[0][0]) > 40
