"""docs/fault-campaign.md: the ceilings, one table a situation's worst rows, and the exceptions."""

from __future__ import annotations

from collections.abc import Sequence

from bowden.drive.dictionary import EMERGENCIES

from hil_tests.fault_campaign.campaign import TARGETS
from hil_tests.fault_campaign.exceptions import Reason
from hil_tests.fault_campaign.faults import FAULTS
from hil_tests.fault_campaign.outcome import ENERGY_CEILING_J, IMPULSE_CEILING_NMS, Outcome
from hil_tests.fault_campaign.situations import SITUATIONS
from hil_tests.fault_campaign.trial import HORIZON_S

NAMES = {e.code: e.name for e in EMERGENCIES}

_HEAD = """\
# Single-fault campaign

Written by `python -m hil_tests.fault_campaign`; do not edit. {rows} of {all} rows were run, the
rest by `make bench-faults`. A row is a fault of a sensor, an actuator line or the host's messages,
in a state and under a law; on the natively built drive or the flashed ELF on the emulated
STM32F405, on the simulated rig, with the drive's default supervision. {holding} rows hold both
ceilings; the other {broken} stand at the end with the reason.

**Excess torque** is the torque at the load outside the hull of two runs without the fault: healthy,
and with the bridge off from the onset. **Impulse** is its integral until 20 ms after the bridge is
off, or over {horizon:g} s; **energy** the work that it does on the load.

**Ceilings.** Impulse {impulse:.0f} mN m s: 20 ms of the motor's limit (0.5 N m) at the load (5.2
times that), less than a person can answer, whose stretch reflex takes 20 to 50 ms. Energy
{energy:.0f} mJ: lifts a forearm and hand of 1.5 kg by 3.4 mm. Both must hold.

A fault's row shows the worst situation of its kind: the largest share of a ceiling.
`off`: bridge off after the onset; `-`: not within {horizon:g} s. `told`: first emergency message.
"""


def page(outcomes: Sequence[Outcome], reasons: Sequence[Reason]) -> str:
    """Return the text of the page."""
    holding = sum(outcome.holds for outcome in outcomes)
    parts = [
        _HEAD.format(
            rows=len(outcomes),
            all=len(TARGETS) * len(SITUATIONS) * len(FAULTS),
            holding=holding,
            broken=len(outcomes) - holding,
            horizon=HORIZON_S,
            impulse=1e3 * IMPULSE_CEILING_NMS,
            energy=1e3 * ENERGY_CEILING_J,
        )
    ]
    for target in dict.fromkeys(o.target for o in outcomes):
        parts += [_by_fault([o for o in outcomes if o.target == target], target)]
        parts += [_by_situation([o for o in outcomes if o.target == target], target)]
    parts.append(_exceptions(outcomes, reasons))
    return "\n".join(parts)


def share(outcome: Outcome) -> float:
    """Return the largest share of a ceiling."""
    return max(outcome.impulse_nms / IMPULSE_CEILING_NMS, outcome.energy_j / ENERGY_CEILING_J)


def _by_fault(outcomes: Sequence[Outcome], target: str) -> str:
    rows = []
    for fault in dict.fromkeys(o.fault for o in outcomes):
        these = [o for o in outcomes if o.fault == fault]
        worst = max(these, key=share)
        held = f"{sum(o.holds for o in these)} of {len(these)}"
        rows.append(f"| {fault} | {held} | {worst.situation} | {_figures(worst)} |")
    head = "| fault | rows that hold | worst situation | told | after | off | impulse | energy |"
    return "\n".join([f"## {target.capitalize()}, by fault\n", head, "|---" * 8 + "|", *rows, ""])


def _by_situation(outcomes: Sequence[Outcome], target: str) -> str:
    rows = []
    for name in dict.fromkeys(o.situation for o in outcomes):
        these = [o for o in outcomes if o.situation == name]
        worst = max(these, key=share)
        held = f"{sum(o.holds for o in these)} of {len(these)}"
        rows.append(f"| {name} | {held} | {worst.fault} | {_figures(worst)} |")
    head = "| situation | rows that hold | worst fault | told | after | off | impulse | energy |"
    title = f"## {target.capitalize()}, by situation\n"
    return "\n".join([title, head, "|---" * 8 + "|", *rows, ""])


def _exceptions(outcomes: Sequence[Outcome], reasons: Sequence[Reason]) -> str:
    by_name = {outcome.name: outcome for outcome in outcomes}
    parts = ["## Rows that break a ceiling, and why\n"]
    for reason in reasons:
        rows = [by_name[row] for row in reason.rows if row in by_name]
        if not rows:
            continue
        parts += [f"**{reason.reason}** {reason.remedy}\n"]
        parts += ["| row | told | after | off | impulse | energy |", "|---|---|---|---|---|---|"]
        parts += [f"| {o.name} | {_figures(o)} |" for o in rows]
        parts.append("")
    return "\n".join(parts)


def _figures(outcome: Outcome) -> str:
    told = "-" if outcome.told is None else NAMES.get(outcome.told, f"{outcome.told:04X}h")
    cells = [told, _ms(outcome.told_s), _ms(outcome.off_s)]
    cells += [f"{1e3 * outcome.impulse_nms:.1f} mN m s", f"{1e3 * outcome.energy_j:.1f} mJ"]
    return " | ".join(cells)


def _ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{1e3 * seconds:.2f} ms"
