"""No interrupt takes more of the core than it may, whatever the rig and the bus do."""

from __future__ import annotations

import pytest

from hil_tests.board_bench import NEEDS_ELF
from hil_tests.board_budget import (
    CYCLES_PER_INSTRUCTION,
    INTERRUPTS,
    SCENARIOS,
    TICK_CYCLES,
    Scenario,
    measure,
    reconfigure,
)

pytestmark = NEEDS_ELF

# Instructions. The control tick: half of its period. The others: what was measured and a third
# more, so that what makes one slower is noticed.
CEILINGS = {
    "control tick (PendSV)": TICK_CYCLES / 2 / CYCLES_PER_INSTRUCTION,
    "current loop (ADC)": 400,
    "supervision (SysTick)": 280,
    "frame received (CAN1_RX0)": 220,
    "index pulse (EXTI9_5)": 40,
    "main loop": 40,
}


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda s: s.name)
def test_worst_case_and_total(scenario: Scenario) -> None:
    shares = measure(scenario, duration_s=1.0)
    assert {s.name: s.worst for s in shares if s.worst > CEILINGS[s.name]} == {}
    assert sum(s.load for s in shares) < 0.35
    by_name = {s.name: s for s in shares}
    # every one ran, as often as it must; one tick may lie across either end of the second
    assert by_name["control tick (PendSV)"].per_second == pytest.approx(4000, abs=2)
    assert by_name["current loop (ADC)"].per_second == pytest.approx(20_000, abs=5)
    assert len(shares) == len(INTERRUPTS)


def test_no_tick_is_long_while_a_configuration_is_written_and_taken() -> None:
    assert reconfigure() <= CEILINGS["control tick (PendSV)"]
