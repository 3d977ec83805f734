"""Every result as a pandas DataFrame: one row a sample, an estimate, a candidate, a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, is_dataclass
from typing import TYPE_CHECKING

from bowden.diagnosis.compare import Comparison
from bowden.diagnosis.result import Diagnosis
from bowden.errors import BadInput
from bowden.recording.recording import Recording

if TYPE_CHECKING:
    from pandas import DataFrame


def to_dataframe(result: object) -> DataFrame:
    """Turn a result into a table.

    Parameters
    ----------
    result : Recording, Comparison, Calibration, Estimation or Diagnosis
        A recording has one row a sample and its channels as columns, indexed by ``time_s``; a
        comparison one row a recording; a calibration or an estimation one row a parameter; a
        diagnosis one row a candidate, best first.

    Returns
    -------
    pandas.DataFrame
        SI units; the unit is in each column's name.

    Raises
    ------
    BadInput
        Another kind of object, or pandas is not installed.
    """
    try:
        from pandas import DataFrame  # noqa: PLC0415  (optional)
    except ImportError as error:
        raise BadInput(
            "to_dataframe", "no pandas in this installation", "pip install 'bowden[notebook]'"
        ) from error
    if isinstance(result, Recording):
        return DataFrame(
            dict(result.channels), index=DataFrame({"time_s": result.time_s})["time_s"]
        )
    if isinstance(result, Comparison):
        return DataFrame(
            [
                {"recording": one.recording.source, **asdict(one.figures)}
                for one in result.recordings
            ]
        )
    if isinstance(result, Diagnosis):
        return DataFrame(_rows(result.ranking))
    if isinstance(estimates := getattr(result, "estimates", None), Sequence):
        return DataFrame(_rows(estimates))
    raise BadInput(
        "to_dataframe",
        type(result).__name__,
        "Recording, Comparison, Calibration, Estimation or Diagnosis",
    )


def _rows(items: Sequence[object]) -> list[Mapping[str, object]]:
    return [asdict(one) for one in items if is_dataclass(one) and not isinstance(one, type)]
