"""The linter: one seeded defect at a time, each found and named."""

from __future__ import annotations

import pytest

from shared.dictionary.outputs import SOURCE, build
from shared.dictionary.schema import SchemaError

TEXT = SOURCE.read_text(encoding="utf-8")

STIFFNESS = "name: tunnel_stiffness, type: u32, access: rw, role: config, persist: true"
ERROR = "{index: 0x603F, name: error_code, type: u16, access: ro, role: state, pdo: tx}"
LAW = "{value: 1, name: coulomb, doc"

DEFECTS = {
    "duplicate index": ("index: 0x2121", "index: 0x2120", "0x2120: index given twice"),
    "duplicate name": (
        "name: load_pulley_radius",
        "name: motor_pulley_radius",
        "motor_pulley_radius: name given twice",
    ),
    "duplicate name in a record": (
        "{name: load_a, type",
        "{name: motor_a, type",
        "model_tension.motor_a: name given twice",
    ),
    "two names, one C field": (
        "name: load_cell_zero,",
        "name: motor_encoder, ",
        "motor_encoder_counts: two entries have this field in C",
    ),
    "duplicate PDO entry": (
        "map: [sample_counter, statusword, device_time]",
        "map: [sample_counter, statusword, statusword]",
        "tpdo1: statusword is mapped twice",
    ),
    "duplicate PDO number": (
        "number: 3, cob_id: 0x380",
        "number: 2, cob_id: 0x380",
        "0x1801: index",
    ),
    "default below range": ("default: 20000000}", "default: 999}", "default 999 is outside [1000"),
    "default above range": (
        "range: [1, 40], default: 20",
        "range: [1, 40], default: 41",
        "default 41",
    ),
    "range beyond the type": ("range: [1, 40]", "range: [1, 256]", "does not fit into u8"),
    "negative range of unsigned": (
        "range: [0, 1], default: 1",
        "range: [-1, 1], default: 1",
        "fit",
    ),
    "low above high": ("range: [1, 40], default: 20", "range: [40, 1], default: 20", "is empty"),
    "range on read-only": (
        "name: bus_voltage, type: i32, access: ro, role: state,",
        "name: bus_voltage, type: i32, access: ro, role: state, range: [0, 9],",
        "it cannot be written",
    ),
    "unmappable entry in a TPDO": (
        "map: [sample_counter_low, load_angle, load_torque]",
        "map: [sample_counter_low, saturation_count, load_torque]",
        "tpdo3: saturation_count cannot be mapped here",
    ),
    "state in an RPDO": (
        "map: [controlword, mode_of_operation, target_torque]",
        "map: [controlword, mode_of_operation, motor_torque]",
        "rpdo1: motor_torque cannot be mapped here",
    ),
    "unknown entry in a PDO": (
        "statusword, device_time]",
        "statusword, deviec_time]",
        "deviec_time",
    ),
    "PDO over 64 bits": (
        "map: [sample_counter_low, load_angle, load_torque]",
        "map: [sample_counter_low, load_angle, load_torque, error_register]",
        "tpdo3: 72 bits are mapped",
    ),
    "TPDO without sample counter": (
        "map: [sample_counter_low, load_angle, load_torque]",
        "map: [load_angle, load_torque]",
        "by which losses are found",
    ),
    "missing identity": ("index: 0x1018\n", "index: 0x1019\n", "0x1018: is mandatory and missing"),
    "missing device type": ("index: 0x1000,", "index: 0x1002,", "0x1000: is mandatory and missing"),
    "missing error register": ("index: 0x1001\n", "index: 0x1002\n", "0x1001: is mandatory"),
    "wrong sub count": (
        "      - {name: serial_number, type: u32, access: ro, role: identity}\n",
        "",
        "0x1018 identity: needs 4 sub-entries",
    ),
    "unit without scale": (
        "unit: N m/rad, raw_unit: unm_per_rad, scale: 1.0e-6,",
        "unit: N m/rad,",
        "unit, raw_unit and scale come together",
    ),
    "scale zero": (
        "raw_unit: unm_per_rad, scale: 1.0e-6",
        "raw_unit: unm_per_rad, scale: 0.0",
        "scale",
    ),
    "text in a PDO": (
        'default: "0.2.0"',
        'default: "0.2.0", pdo: tx',
        "text is const and has no range",
    ),
    "text too long": ('default: "0.2.0"', f'default: "{"x" * 155}"', "1 to 154 characters"),
    "semicolon in a text": ('default: "0.2.0"', 'default: "a ; b"', "cuts text at a semicolon"),
    "text for a number": ("default: 500000}", 'default: "500000"}', "is not a number"),
    "writable state": (ERROR, ERROR.replace("access: ro", "access: rw"), "access rw does not go"),
    "read-only configuration": (STIFFNESS, STIFFNESS.replace("rw", "ro"), "access ro does not go"),
    "RPDO writes configuration": (STIFFNESS, STIFFNESS + ", pdo: rx", "only a writable command"),
    "stored state": (
        ERROR,
        ERROR.replace("pdo: tx", "persist: true"),
        "role state is not stored",
    ),
    "REAL32": ("name: bus_voltage, type: i32", "name: bus_voltage, type: real32", "(bus_voltage)"),
    "not ASCII": ("unit: N m/rad", "unit: N·m/rad", "is not plain ASCII"),
    "comment end": ('doc: "mu_d"', 'doc: "mu_d */ int x;"', "end of a C comment"),
    "COB-ID overlap": ("cob_id: 0x380", "cob_id: 0x280", "overlaps with tpdo2"),
    "COB-ID of a service": ("cob_id: 0x380", "cob_id: 0x600", "overlaps with range 0x580"),
    "crooked COB-ID": ("cob_id: 0x380", "cob_id: 0x390", "not a multiple of 0x80"),
    "unsupported PDO type": (
        "number: 3, cob_id: 0x380, type: 255, event_ms: 1",
        "number: 3, cob_id: 0x380, type: 252",
        "tpdo3: type 252",
    ),
    "timer without events": (
        "number: 3, cob_id: 0x380, type: 255,",
        "number: 3, cob_id: 0x380, type: 1,",
        "only an event-driven TPDO has an event timer",
    ),
    "more PDOs than the firmware has": ("number: 3, cob_id", "number: 9, cob_id", "room for 8"),
    "absent beyond the range": (
        STIFFNESS,
        STIFFNESS + ", absent: {raw: -1, text: none}",
        "absent -1 is outside [0",
    ),
    "absent beside words": (
        '    doc: "the angle that the tunnel is laid around"',
        "    absent: {raw: 0, text: none}",
        "only a number without named values may be absent",
    ),
    "hash left out": ("default: schema_hash", "default: 0", "default must be schema_hash"),
    "missing emergency": (
        "code: 0x8210",
        "code: 0x8211",
        "0x8210: is sent by the node and missing",
    ),
    "duplicate emergency": ("code: 0x7380", "code: 0x7305", "0x7305: code given twice"),
    "emergency without advice": ('advice: "check the supply"', 'advice: ""', "nothing to do"),
    "unknown key": ("persist: true, range: [1, 40]", "persists: true, range: [1, 40]", "persists"),
    "key given twice": (
        "name: bus_voltage, type: i32",
        "name: bus_voltage, type: i32, type: i32",
        "type",
    ),
    "record with a type": (
        "    name: sdo_server\n",
        "    name: sdo_server\n    type: u8\n",
        "subs only",
    ),
    "value given twice": (LAW, LAW.replace("1", "2"), "value 2 given twice"),
    "two values of one name": (LAW, LAW.replace("coulomb", "none"), "are called none"),
    "value beyond the type": (LAW, LAW.replace("1", "256"), "value 256 does not fit into u8"),
    "bit beyond the type": (
        "{bit: 11, name: internal_limit",
        "{bit: 16, name: internal_limit",
        "bit 16 does not fit into u16",
    ),
    "a bit among values": (LAW, LAW.replace("value", "bit"), "(compensation_law)"),
    "default that no value is": (
        "{value: -1, name: tunnel,",
        "{value: -3, name: tunnel,",
        "default -1 is none of its values",
    ),
    "values of an entry that has none": (
        "values: compensation_law,",
        "values: motor_inertia,",
        "compensation_active_law: motor_inertia has no values of its own",
    ),
    "range beside values": (
        "    name: mode_of_operation\n",
        "    name: mode_of_operation\n    range: [-2, 0]\n",
        "mode_of_operation: its range is made from its values",
    ),
    "values and bits": (
        "    name: slip_state\n",
        "    name: slip_state\n    bits: model_flags\n",
        "slip_state: has values or bits, not both",
    ),
    "neither variable nor record": (
        "name: error_code, type: u16,",
        "name: error_code,",
        "needs type",
    ),
}


@pytest.mark.parametrize("defect", DEFECTS)
def test_a_seeded_defect_is_found_and_named(defect: str) -> None:
    sound, broken, sentence = DEFECTS[defect]
    assert sound in TEXT
    with pytest.raises(SchemaError) as caught:
        build(TEXT.replace(sound, broken, 1), "od.yaml")
    assert any(sentence in problem for problem in caught.value.problems), caught.value
    assert all(problem.startswith(("od.yaml", "0x")) for problem in caught.value.problems)


def test_all_defects_are_told_at_once() -> None:
    text = TEXT.replace("range: [1, 40]", "range: [40, 1]").replace(
        "cob_id: 0x380", "cob_id: 0x280"
    )
    with pytest.raises(SchemaError) as caught:
        build(text, "od.yaml")
    assert len(caught.value.problems) >= 2


def test_the_dictionary_itself_is_sound() -> None:
    assert build(TEXT, "od.yaml").objects
