"""The benchmark of stated intervals: what it counts, and that it would see wrong intervals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hil_tests.benchmarks import calibration
from hil_tests.benchmarks.calibration_cases import SETTINGS, Recorded
from hil_tests.benchmarks.calibration_score import Number, Trial, good_blocks, markdown, rows
from hil_tests.hidden_effects.recordings import draw_rig
from hil_tests.hidden_effects.strength import LOAD_COUNTS

FITS = 400


def _fits(stated: float, bias: float = 0.0) -> list[Trial]:
    """Fits of a number whose true sigma is 1 %, and whose stated sigma is `stated` of that."""
    rng = np.random.default_rng(5)
    found = []
    for rig, miss in enumerate(rng.normal(bias, 0.01, FITS)):
        value, reach = math.exp(miss), 1.96 * 0.01 * stated
        number = Number(
            "friction.mu_d", 1.0, value, value * math.exp(-reach), value * math.exp(reach)
        )
        found.append(Trial(rig, "calibrate", 1000.0, 1, 1.0, (number,), (1.0, 2.0)))
    return found


def test_right_intervals_are_found_calibrated() -> None:
    (row,) = rows(_fits(1.0))
    assert 0.92 < row.coverage.share < 0.98  # 95 % +- 3 standard errors of 400 fits: 1.1 % each
    assert row.uniform_p > 0.01
    assert row.spread == pytest.approx(1.0, abs=0.12)  # 3 standard errors: 1 / sqrt(2 x 400) each


@pytest.mark.parametrize(("stated", "bias"), [(0.5, 0.0), (2.0, 0.0), (1.0, 0.01)])
def test_narrow_wide_and_biased_intervals_are_found_out(stated: float, bias: float) -> None:
    (row,) = rows(_fits(stated, bias))
    assert row.uniform_p < 1e-6
    assert not 0.90 <= row.coverage.share <= 0.98


def test_a_fit_without_an_interval_covers_nothing_and_has_no_rank() -> None:
    number = Number("friction.mu_d", 1.0, 1.0, None, None)
    assert not number.inside
    (row,) = rows([Trial(0, "calibrate", 1000.0, 1, 1.0, (number,))])
    assert (row.without, row.coverage.trials, sum(row.ranks)) == (1, 0, 0)


def test_blocks_count_as_good_between_half_and_eleven_tenths() -> None:
    assert good_blocks(_fits(1.0)).share == 0.5  # each fit has blocks of 1.0 and of 2.0


def test_failed_fits_are_counted_in_the_tables() -> None:
    text = markdown([*_fits(1.0)[:3], Trial(9, "calibrate", 1000.0, 1, error="no rig answers")])
    assert text.splitlines()[-1].split("|")[-2].strip() == "1"


def test_a_rig_is_recorded_with_counts_and_with_noise_as_large() -> None:
    rng = np.random.default_rng([3, 0])
    recorded = Recorded(draw_rig(rng), rng, 500.0, 4.0)
    counted, noisy = (recorded.get(one)[0] for one in SETTINGS[:2])
    count = 2.0 * np.pi / LOAD_COUNTS
    assert counted.time_s.size == 2000
    on_grid = counted.load_angle_rad / count
    assert np.allclose(on_grid, np.round(on_grid), atol=1e-6)
    # At standstill only the noise changes; 3 standard errors of some 100 samples: 21 %.
    still = noisy.load_angle_rad[: int(0.2 * 500.0)]
    assert np.std(still) == pytest.approx(count / np.sqrt(12.0), rel=0.22)
    assert np.array_equal(counted.load_torque_nm, noisy.load_torque_nm)


def test_nothing_to_do_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as stopped:
        calibration.main(["--rigs", "0", "--output", str(tmp_path / "x.json")])
    assert stopped.value.code == 2
    assert "found 0" in capsys.readouterr().err
