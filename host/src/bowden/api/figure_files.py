"""A result's figures as files for papers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bowden.api.plots import figures
from bowden.report.figure_files import refuse_missing, write_figure


def write_figures(
    result: object, folder: str | Path, forms: Iterable[str] = (".svg", ".csv")
) -> list[Path]:
    """Write the figures of a result, each whole or not at all.

    Parameters
    ----------
    result : Recording, Comparison or Diagnosis
        As for `bowden.figures`.
    folder : str or Path
        Made where it is not there.
    forms : iterable of str
        ``".svg"`` and ``".pdf"`` (vector drawings, the colours of light paper; PDF needs
        ``bowden[pdf]``), ``".csv"`` (every sample of every curve).

    Returns
    -------
    list of Path
        ``loop.svg``, ``loop.csv``...: a file for each figure and form.

    Raises
    ------
    BadInput
        Another kind of object or form, PDF without the extra, or a folder that cannot be written.
    """
    forms = tuple(forms)
    for form in forms:
        refuse_missing(form)
    drawn = figures(result)
    Path(folder).mkdir(parents=True, exist_ok=True)
    written = []
    for name, plot in drawn.items():
        for form in forms:
            path = Path(folder) / f"{name.replace(' ', '-')}{form}"
            write_figure(plot, path)
            written.append(path)
    return written
