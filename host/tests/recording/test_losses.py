"""The account of lost frames equals what was dropped, whatever was dropped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from bowden.recording.losses import Arrivals, find_losses, number_by_low_byte, number_samples
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

PDOS = ("TPDO1", "TPDO2", "TPDO3")
PERIOD_US = 1000
# The receive time has to be right to 128 samples where a hole hides more than 256 of them; a busy
# host is late by tens of milliseconds.
JITTER_S = 0.05


@dataclass(frozen=True)
class Burst:
    start: int
    length: int
    pdos: frozenset[int]


bursts = st.lists(
    st.builds(
        Burst,
        start=st.integers(-5, 1200),
        length=st.integers(1, 1200),
        pdos=st.frozensets(st.integers(0, 2), min_size=1),
    ),
    max_size=4,
)


def account(
    number: NDArray[np.int64],
    there: NDArray[np.bool_],
    device_time_us: NDArray[np.int64],
    receive_time_s: NDArray[np.float64],
    *,
    before: int | None,
    after: int | None,
) -> dict[str, list[int]]:
    """Number the frames that are `there` (shape 3 x n) as the decoder does; return the losses.

    `receive_time_s` is of shape n, or 3 x n.
    """
    # In order of arrival: TPDO1, 2, 3 of a sample, then the next sample.
    position = np.cumsum(there.T.ravel()).reshape(there.T.shape).T - 1
    time_s = np.broadcast_to(receive_time_s, there.shape)
    arrivals = [Arrivals(position[p][there[p]], time_s[p][there[p]]) for p in range(3)]
    first = number_samples(
        number[there[0]] % 65536, device_time_us[there[0]] % (1 << 32), PERIOD_US
    )
    numbers = {"TPDO1": first}
    for p in (1, 2):
        numbers[PDOS[p]] = number_by_low_byte(
            number[there[p]] % 256, arrivals[p], first, arrivals[0], PERIOD_US / 1e6
        )
    report = find_losses(numbers, before, after)
    return {pdo: lost.tolist() for pdo, lost in report.lost.items()}


@settings(max_examples=200, deadline=None)
@given(
    start=st.integers(0, 65535),
    start_us=st.integers(0, (1 << 32) - 1),
    count=st.integers(1, 1200),
    probability=st.sampled_from([0.0, 0.001, 0.05, 0.5, 0.9]),
    bursts=bursts,
    seed=st.integers(0, 1 << 32),
)
def test_what_was_dropped_is_what_is_reported(
    *, start: int, start_us: int, count: int, probability: float, bursts: list[Burst], seed: int
) -> None:
    random = np.random.default_rng(seed)
    number = start + np.arange(count)
    there = random.random((3, count)) >= probability
    for burst in bursts:
        for pdo in burst.pdos:
            there[pdo, max(0, burst.start) : max(0, burst.start + burst.length)] = False
    if not there[0].any():
        there[0, random.integers(count)] = True  # something has to place the samples
    device_time_us = start_us + np.arange(count) * PERIOD_US
    late_s = random.random(count) * JITTER_S
    receive_time_s = np.maximum.accumulate(np.arange(count) * PERIOD_US / 1e6 + late_s)

    reported = account(
        number,
        there,
        device_time_us,
        receive_time_s,
        before=(start - 1) % 65536,
        after=(start + count - 1) % 65536,
    )

    # The report counts from the first frame's 16-bit counter; the drive's own count is `start` on.
    dropped = {pdo: set((number[~there[p]] % 65536).tolist()) for p, pdo in enumerate(PDOS)}
    for pdo in PDOS:
        assert len(reported[pdo]) == np.count_nonzero(~there[PDOS.index(pdo)])
        assert {sample % 65536 for sample in reported[pdo]} == dropped[pdo]


@pytest.mark.parametrize("length", [1, 255, 256, 257, 65534, 65535, 65536, 200_000])
def test_a_hole_of_any_length_is_counted_exactly(length: int) -> None:
    # A 16-bit counter alone cannot tell 65535 lost samples from none; the device time can.
    count = 100
    number = np.concatenate((np.arange(count), count + length + np.arange(count)))
    there = np.ones((3, 2 * count), dtype=bool)
    there[0, count] = False  # and the frame that would place the end of the hole is lost too
    reported = account(number, there, number * PERIOD_US, number * 1e-3, before=None, after=None)
    hole = list(range(count, count + length))
    assert reported == {"TPDO1": [*hole, count + length], "TPDO2": hole, "TPDO3": hole}


def test_without_the_counters_a_loss_at_the_edge_cannot_be_seen_but_is_with_them() -> None:
    number = 100 + np.arange(50)
    there = np.ones((3, 50), dtype=bool)
    there[:, :3] = False
    there[:, -2:] = False
    times = (number * PERIOD_US, number * 1e-3)
    nothing: dict[str, list[int]] = {pdo: [] for pdo in PDOS}
    assert account(number, there, *times, before=None, after=None) == nothing
    edges = [100, 101, 102, 148, 149]
    assert account(number, there, *times, before=99, after=149) == dict.fromkeys(PDOS, edges)


def test_listening_may_begin_and_end_in_the_middle_of_a_sample() -> None:
    number = 100 + np.arange(50)
    there = np.ones((3, 50), dtype=bool)
    there[0, 0] = there[1:, -1] = False  # not lost: before we listened, after we stopped
    there[2, 7] = False  # lost
    reported = account(number, there, number * 1000, number * 1e-3, before=None, after=None)
    assert reported == {"TPDO1": [], "TPDO2": [], "TPDO3": [107]}


@pytest.mark.parametrize("step_s", [-2.0, 2.0])
def test_a_host_clock_that_is_set_meanwhile_changes_nothing(step_s: float) -> None:
    number = np.arange(3000)
    there = np.ones((3, 3000), dtype=bool)
    there[1, 1500] = there[0, 700] = False
    receive_time_s = np.tile(number * 1e-3, (3, 1))
    receive_time_s[:, 1001:] += step_s
    receive_time_s[1:, 1000] += step_s  # set between a sample's TPDO1 and its TPDO2
    reported = account(number, there, number * 1000, receive_time_s, before=None, after=None)
    assert reported == {"TPDO1": [700], "TPDO2": [1500], "TPDO3": []}


def test_ranges_read_well() -> None:
    report = find_losses({"TPDO1": np.array([1, 2, 5, 9]), "TPDO2": np.arange(1, 10)})
    assert report.ranges("TPDO1") == ["3-4", "6-8"]
    assert report.ranges("TPDO2") == []
    assert report.total == 5
    assert report.expected == 9
