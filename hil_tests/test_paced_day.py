"""The paced benchmark's own arithmetic, in virtual time."""

from __future__ import annotations

from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.reduced_model import reduced_model

from hil_tests.benchmarks.lab_day import Wire
from hil_tests.benchmarks.paced_day import SEGMENTS, configuration, full_model


def test_its_configuration_is_full() -> None:
    reduced = reduced_model(full_model(), SEGMENTS)
    assert (len(reduced.tables), reduced.left_out) == (8, ())


def test_its_transfers_take_a_round_trip_each() -> None:
    wire = Wire((16,))
    connection = Connection(wire, clock=lambda: wire.time_s, threaded=False)
    found = configuration(Drive(connection, 16), lambda: wire.time_s)
    values = {figure.name.rpartition(".")[2]: figure.value for figure in found}
    # at least each of 8 tables' 22 segments, written and read back
    assert values["configure_transfers"] > 8 * 22 * 2
    assert values["configure_trips"] < 1.5
    assert values["configure_time"] < 2.0
    connection.close()
