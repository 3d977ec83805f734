"""A result as an HTML page that opens anywhere: the pages that the commands write."""

from __future__ import annotations

from pathlib import Path

from bowden.diagnosis.compare import Comparison
from bowden.diagnosis.result import Diagnosis
from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole
from bowden.report.comparison import comparison_report
from bowden.report.diagnosis import diagnosis_report


def write_report(result: Comparison | Diagnosis, path: str | Path) -> Path:
    """Write the page of a result, whole or not at all.

    Parameters
    ----------
    result : Comparison or Diagnosis
    path : str or Path
        ``"diagnosis.html"``.

    Returns
    -------
    Path
        Where it is.

    Raises
    ------
    BadInput
        Another kind of object, or a path that cannot be written.
    """
    if isinstance(result, Comparison):
        text = comparison_report(result)
    elif isinstance(result, Diagnosis):
        text = diagnosis_report(result)
    else:
        raise BadInput("write_report", type(result).__name__, "Comparison or Diagnosis")
    with replace_whole(Path(path)) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Path(path)
