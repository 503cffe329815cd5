# what is handed over here is wrong on purpose
# mypy: disable-error-code="arg-type, call-overload, dict-item, list-item"
"""A model where a system is asked for, or the other way round, is refused in words that say what to hand over."""

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation, plots, report
from mbsvib.studies import frequency, peak
from mbsvib.studies.campbell import campbell

MODEL = mv.library.quarter_car()
SYSTEM = MODEL.linearize()
BATCH = MODEL.linearize(values={"suspension.stiffness": [1e4, 2e4]})
DRAWN = [plots.bode, plots.nyquist, plots.step, plots.singular_values, plots.topology, plots.energy, plots.modes]


@pytest.mark.parametrize("draw", DRAWN)
@pytest.mark.parametrize("given", [MODEL, "quarter_car", None, [MODEL]])
def test_figures_ask_for_systems(draw, given):
    with pytest.raises(mv.MbsvibError, match=r"expected a System\. .*model\.linearize\(\)"):
        draw(given)


@pytest.mark.parametrize("draw", [plots.topology, plots.energy, plots.modes, plots.mechanism])
def test_figures_of_one_system_take_no_batch(draw):
    with pytest.raises(mv.MbsvibError, match=r"Batch 'quarter_car'; expected a System\. Give one of the"):
        draw(BATCH)


@pytest.mark.parametrize("call", [lambda given: mv.save(given, "x.yaml"), lambda given: campbell(given, [0, 1]),
                                  mv.linearize])  # fmt: skip
def test_what_needs_a_model_says_so(call):
    with pytest.raises(mv.ModelError, match=r"System 'quarter_car'; expected a Model\. Give the model that"):
        call(SYSTEM)
    with pytest.raises(mv.ModelError, match=r"'car\.yaml'; expected a Model\. Read files by mv\.load"):
        call("car.yaml")
    with pytest.raises(mv.ModelError, match="expected a Model"):
        call(None)


@pytest.mark.slow
def test_reports_take_either():
    pytest.importorskip("plotly")
    assert report.html(MODEL) == report.html(SYSTEM)
    with pytest.raises(mv.ModelError, match=r"report: source = 'car.yaml'; expected a Model\. Read files"):
        report.html("car.yaml")


@pytest.mark.parametrize("omega", [1j * np.array([1.0, 2.0]), [1j], np.complex128(1j), 10**400, [[1], [1, 2]], None])
@pytest.mark.parametrize("method", [None, "sparse"])
def test_frequencies_are_real(omega, method):
    """The mistake of every control engineer: numpy would drop the imaginary part, and answer at 0."""
    system = mv.library.chain(3, line=(0, 1, 0)).linearize(method=method)
    with pytest.raises(mv.ResponseError, match=r"frequency_response: omega .*expected a"):
        system.frequency_response(omega)


def test_an_imaginary_omega_is_told_the_way():
    with pytest.raises(mv.ResponseError, match=r"They are real: give omega, not 1j \* omega"):
        SYSTEM.frequency_response(1j * np.array([1.0, 2.0]))


T, U = np.linspace(0.0, 1.0, 5), np.zeros((3, 5))


@pytest.mark.few(15)
@pytest.mark.parametrize("call", [
    lambda: SYSTEM.time_response(T + 1j, U),
    lambda: SYSTEM.time_response(T, U + 1j),
    lambda: SYSTEM.time_response(T, U, hold=np.array([])),
    lambda: SYSTEM.frequency_response([1.0, 1e-200]),
    lambda: SYSTEM.frequency_response([1e200]),
    lambda: SYSTEM.frequency_grid(n=2.5),
    lambda: SYSTEM.frequency_grid(n="10"),
    lambda: SYSTEM.frequency_grid(f_min="low"),
    lambda: SYSTEM.frequency_grid(f_max=[1.0, 2.0]),
    lambda: SYSTEM.modes(rtol="tight"),
    lambda: SYSTEM.modes(rtol=-1.0),
    lambda: SYSTEM.modes(rtol=[1e-12]),
    lambda: SYSTEM.modes(1, near=float("nan")),
    lambda: SYSTEM.modes(1, near="low"),
    lambda: SYSTEM.modes().check_accuracy(None),
    lambda: SYSTEM.state_space(np.array([])),
    lambda: SYSTEM.reachable(None, 1),
    lambda: SYSTEM.reachable(None, np.zeros((2, 2))),
    lambda: SYSTEM.transmission_zeros("body.z", True),
    lambda: plots.bode(SYSTEM, inputs=1),
    lambda: plots.bode(SYSTEM, "body.z", "load", frequencies=np.array([1.0, 2j])),
    lambda: plots.energy(SYSTEM, []),
    lambda: MODEL.linearize(independent=True),
    lambda: MODEL.linearize(cut=[1]),
    lambda: MODEL.linearize(values={"body.mass": np.array([1.0, 1j])}),
    lambda: MODEL.equilibrium(cut=None),
    lambda: MODEL.moved(None),
    lambda: MODEL.moved("hub"),
    lambda: MODEL.moved({"hub.z": 0.0}, cut=3),
    lambda: MODEL.with_values(None),
    lambda: MODEL.with_values({"body.mass": np.complex128(1 + 1j)}),
    lambda: campbell(mv.library.rotor_stator(), {}),
    lambda: campbell(mv.library.rotor_stator(), np.array([0.0, 1j])),
    lambda: campbell(mv.library.rotor_stator(), [0.0, 1.0], rotors=True),
    lambda: campbell(mv.library.rotor_stator(), [0.0, 1.0], orders="first"),
    lambda: campbell(mv.library.rotor_stator(), [0.0, 1.0], orders=[[1.0], [2.0]]),
    lambda: campbell(mv.library.rotor_stator(), [0.0, 1.0], orders=float("nan")),
    lambda: MODEL.replace("hub", kind=[]),
    lambda: MODEL.replace("hub", kind=np.array([]), free=("x",)),
    lambda: MODEL.replace("hub", kind=None, free=np.array(1.0)),
    lambda: MODEL.replace("hub", kind=None, free=np.zeros((2, 2))),
    lambda: MODEL.replace("body.z", quantity=np.array([])),
    lambda: MODEL.replace("body.az", absolute=np.array([])),
    lambda: MODEL.replace("body.az", absolute="no"),
    lambda: MODEL.replace("tyre.force", element=None),
])  # fmt: skip
def test_what_is_no_number_and_no_name_is_refused_in_words(call):
    with pytest.raises(mv.MbsvibError, match=r"expected|give"):
        call()


def test_parts_stand_for_their_names():
    model = mv.library.quarter_car()
    output, joint = model.outputs["body.z"], model.joints["hub"]
    other = model.linearize(cut=[], independent=[])
    assert (other.M == SYSTEM.M).all()
    result = SYSTEM.transmission_zeros([output], model.inputs["load"])
    assert (result == SYSTEM.transmission_zeros("body.z", "load")).all()
    ladder = mv.library.ladder(1)
    cut = ladder.joints[ladder.linearize().cut_joints[0]]
    assert ladder.linearize(cut=cut).cut_joints == (cut.name,)
    assert ladder.equilibrium(cut=cut.name).linearize().dof == ladder.linearize().dof
    assert joint.name in other.coordinates[0]


HEXAPOD = mv.library.cubic_hexapod()


@pytest.mark.parametrize("call", [
    lambda given: mv.sweep(given, {"body.mass": [1.0, 2.0]}, "modes.frequencies"),
    lambda given: mv.track(given, {"body.mass": [1.0, 2.0]}),
    lambda given: mv.optimize(given, {"body.mass": (1.0, 2.0)}, peak("body.z", "load")),
    lambda given: mv.tolerances(given, {"body.mass": 0.1}, frequency()),
    lambda given: isolation.study(given, "body"),
    lambda given: isolation.passive(given, "body"),
    lambda given: isolation.actuated(given, "body"),
])  # fmt: skip
@pytest.mark.parametrize("given", [SYSTEM, "car.yaml", None])
def test_studies_ask_for_models(call, given):
    with pytest.raises(mv.ModelError, match="expected a Model"):
        call(given)


@pytest.mark.parametrize("call", [
    lambda: isolation.force_feedback(HEXAPOD, 600.0),
    lambda: isolation.velocity_feedback(HEXAPOD.linearize(), 600.0),
    lambda: isolation.study(HEXAPOD, "platform", directions=True),
    lambda: isolation.actuated(HEXAPOD, "platform", legs=3),
    lambda: isolation.actuated(HEXAPOD, "platform").with_gains(600.0),
    lambda: mv.optimize(MODEL, {"suspension.damping": (1e2, 1e4)}, peak("body.z", "load"), True),
    lambda: mv.sweep(MODEL, {"body.mass": [1.0, 2.0]}, "poles", ties=True),
    lambda: mv.tolerances(MODEL, {"body.mass": 0.1}, frequency(), ties="body.mass"),
    lambda: isolation.root_locus(isolation.actuated(HEXAPOD, "platform"), None, [0.0, 1.0]),
    lambda: isolation.root_locus(isolation.actuated(HEXAPOD, "platform"), float, "high"),
])  # fmt: skip
def test_isolation_and_searches_say_what_they_need(call):
    with pytest.raises(mv.MbsvibError, match="expected"):
        call()


def test_strict_bounds_are_told_the_way():
    with pytest.raises(mv.ModelError, match="write >="):
        _ = frequency() > 3.0
    with pytest.raises(mv.ModelError, match="write <="):
        _ = frequency() < 3.0


@pytest.mark.parametrize("path", [None, 5, True, SYSTEM])
@pytest.mark.parametrize("call", [
    lambda path: mv.save(MODEL, path),
    mv.load,
    lambda path: mx.to_npz(SYSTEM, path),
    lambda path: mx.to_mat(SYSTEM, path),
    lambda path: mx.to_dmig(SYSTEM, path),
    lambda path: mx.to_fmu(SYSTEM, path),
    mx.check_export,
    mx.from_npz,
    mx.from_mat,
    mx.from_npz_batch,
])  # fmt: skip
def test_paths_are_paths(call, path):
    """A number would be an open file: reading from True closed what prints."""
    with pytest.raises(mv.MbsvibError, match=r"path = .*; expected the path of a file"):
        call(path)


def test_a_path_before_the_model_is_told_the_order():
    with pytest.raises(mv.ModelError, match="Are its arguments in another order"):
        mv.save("car.yaml", MODEL)
