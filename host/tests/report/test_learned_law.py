"""A learned law in words and in a picture: of one argument, and of two."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.diagnosis.result import Learned, Ranked
from bowden.diagnosis.wording import law_in_words
from bowden.report.diagnosis_plots import ranking
from bowden.report.learned_law import draw_law

X, Y = np.linspace(-0.4, 0.4, 7), np.array([-0.1, 0.0, 0.1])
FRICTION = "friction_factor"


def curve(x: np.ndarray, value: np.ndarray, band: float = 0.01) -> np.ndarray:
    return np.stack([x, value, value - band, value + band], axis=1)


def of_two(*way: str) -> Learned:
    x, y = (part.ravel() for part in np.meshgrid(X, Y, indexing="ij"))
    arguments = ("load_angle_rad", "motor_torque_nm", *way)
    return Learned(FRICTION, arguments, curve(x, x * y), np.full(21, 1 / 21), second=y)


@pytest.mark.parametrize(
    ("value", "course"),
    [(0.5 * X, "rises with"), (-0.5 * X, "falls with"), (X**2, "varies with")],
)
def test_a_curve_is_told_by_its_course(value: np.ndarray, course: str) -> None:
    law = Learned(FRICTION, ("load_angle_rad",), curve(X, value), np.full(7, 1 / 7))
    assert law_in_words(law) == f"friction that {course} load angle"


def test_a_law_of_two_arguments_is_told_by_both() -> None:
    words = law_in_words(of_two("slip_direction"))
    assert words == (
        "friction that varies with load angle and motor torque and changes with the direction in "
        "which the cable slides"
    )


def test_a_law_of_two_arguments_is_drawn_at_three_of_the_second() -> None:
    plot = draw_law(of_two())
    lines = {one.name: one for one in plot.data if one.mode == "lines" and one.fill is None}
    assert set(lines) == {f"motor torque {at} N m" for at in ("-0.1", "0", "0.1")}
    for at in Y:
        line = lines[f"motor torque {at:.3g} N m"]
        # x y over seven knots is straight: the spline meets it between them.
        np.testing.assert_allclose(line.y, np.asarray(line.x) * at, atol=1e-12)
    assert [one.showlegend for one in plot.data if one.name == "95 % band"] == [True, False, False]


def test_a_law_of_one_argument_is_one_curve() -> None:
    law = Learned(FRICTION, ("load_angle_rad",), curve(X, X), np.full(7, 1 / 7))
    lines = [one.name for one in draw_law(law).data if one.mode == "lines" and one.fill is None]
    assert lines == ["learned law"]


def test_each_learned_law_has_a_bar_of_its_own_in_the_ranking() -> None:
    laws = [
        Ranked("learned", f"friction_factor over load_angle_rad{more}", score, 0.1)
        for more, score in ((" and motor_torque_nm", 30.0), (" and slip_direction", 20.0))
    ]
    (bars,) = ranking(laws, set()).data
    assert list(bars.y) == [
        "learned: friction over load angle and direction in which the cable slides",
        "learned: friction over load angle and motor torque",
    ]
