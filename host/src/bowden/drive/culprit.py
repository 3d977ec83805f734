"""What keeps a drive from running with its configuration, in words."""

from __future__ import annotations

from typing import Final

from bowden.drive.client import Drive
from bowden.drive.faults import describe_culprit
from bowden.errors import DriveFailed

UNDER_CHECK: Final = 1
# The drive needs a control tick (250 us) a table, for at most eight; an SDO read takes as long.
READS_MOST: Final = 100


def refused_configuration(drive: Drive) -> str | None:
    """Return what does not fit the rest of the drive's configuration; None: it can run.

    Parameters
    ----------
    drive : Drive

    Returns
    -------
    str or None
        The entry's name and, of a table, the reason.

    Raises
    ------
    DriveFailed
        The drive does not answer, or does not come to an end with its checks.
    """
    for _ in range(READS_MOST):
        address = drive.read_raw("configuration_error")
        if address != UNDER_CHECK:
            defect = drive.read_raw("table_defect")
            return describe_culprit(address, defect) if address else None
    raise DriveFailed(
        f"node {drive.node_id} still checks its configuration after {READS_MOST} reads of "
        "configuration_error; expected: an end within 2 ms"
    )
