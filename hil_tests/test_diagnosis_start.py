"""A diagnosis starts from the likeliest calibration, not from the valley of the file's values."""

from bowden.diagnosis.contribution import holds
from bowden.diagnosis.material import as_searched, make_material
from bowden.diagnosis.sets import Sets
from bowden.model import Mode, parse_model
from bowden.workers import workers

from hil_tests.benchmarks.diagnosis import recordings_of
from hil_tests.hidden_effects.recordings import draw_case

# Nothing is hidden; from the file's values alone a search ends 950 nats above the truth, in another
# valley, and no effect helps it out.
TWO_VALLEYS = 813577901


def test_a_complete_model_is_calibrated_out_of_the_valley_of_the_files_values() -> None:
    case = draw_case(TWO_VALLEYS, "complete", length_s=30.0)
    model = parse_model(case.model_yaml)
    with workers(2) as pool:
        material = make_material(recordings_of(case), model, Mode.TORQUE_POSITION, 1, pool)
        base = Sets(material, as_searched(model)).base
    assert holds(base)
    true = case.truth.calibration["rig"]
    friction = base.model.value("friction.mu_d") * base.model.value("rig.cable.pretension_n")
    # mu T0 is what the load feels; 2 % is what counts and noise leave of it in 30 s.
    assert abs(friction / (true["mu_d"] * true["pretension_n"]) - 1.0) < 0.02
