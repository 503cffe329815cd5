"""Results as files of comma-separated values and as pandas DataFrames: all digits, one line for each entry."""

import csv
import pickle

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation, studies
from mbsvib.campbell import campbell
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from tests.test_display import RESULTS

# Results that are no table, and why: their numbers come from what they answer.
MODELS = "equations or a model: its modes, responses and parameters are tables"
MATRICES = "matrices, of which it returns arrays"
ROW = "a row of the table of the result that it comes with"
RULE = "a rule: it has values where it is evaluated"
FILES = "files that were written, or what stands in them"
NO_TABLE = {
    **dict.fromkeys(("Batch", "DrivenSystem", "DrivenBatch", "Family", "LPVSystem", "Model", "Plant", "RollingSystem",
                     "SparseSystem", "StateSpace", "System", "SampleToSample", "Controller", "Active", "UncertainPlant",
                     "NamedStateSpace", "CasadiModel"), MODELS),
    **dict.fromkeys(("Tangent", "MatrixDerivatives"), MATRICES),
    **dict.fromkeys(("Candidate", "Pair", "PlacedSet", "Parameter", "mbsvib_export.checking.Comparison", "MasterCheck"),
                    ROW),
    **dict.fromkeys(("Passive", "Platform", "BaseNoise", "Integrated", "Window", "RoadCorrelation", "Shaped", "Table",
                     "CycleMeasures", "Constraint", "Quantity"), RULE),
    **dict.fromkeys(("CFiles", "FmuFile", "SignalNames", "SystemData", "BatchData", "Animation"), FILES),
}  # fmt: skip

pandas = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def results():
    model = mv.library.stewart_isolator()
    system = model.linearize()
    omega = np.linspace(1.0, 100.0, 30)
    data = mv.Measurement(omega, system.frequency_response(omega), system.outputs, system.inputs)
    plant = isolation.actuated(model, "platform")
    hexapod = mv.library.cubic_hexapod(damping=2.0)
    study, passive = isolation.study(hexapod, "platform"), isolation.passive(hexapod, "platform")
    loop, times = system.feedback([[-1.0]], "x", "Fx"), np.arange(100.0)
    toggle, uncertain = mv.library.toggle(), system.uncertain({"platform.mass": 0.1})
    cycle = toggle.cycle("elbow.rz", np.linspace(0.0, 0.1, 5), speed=1.0)
    turned = mv.library.slider_crank().cycle("A.rz", np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False), speed=3.0)
    return {
        "modes": system.modes(), "margins": loop.margins(), "isolation": study, "loop": loop,
        "sampled loop": loop.sampled(1e4), "norm": system.hinf_norm("x", "Fx", ["platform.mass"]),
        "h2 norm": system.h2_norm("x", "Fx"), "certificate": mv.certify(mv.library.quarter_car()),
        "tuned": mv.tune(system, mv.tunable.gain("Fx", "x"), mv.goals.hinf("x", "Fx"), starts=1),
        "design": passive.optimize({"leg1.k.stiffness": (1e5, 1e6)}, passive.sag()),
        "struts": isolation.struts(hexapod, "platform"), "worst rms": uncertain.worst_rms("x", {"Fx": 1e-6}),
        "worst gain": uncertain.worst_gain("x", "Fx"), "robust": uncertain.robust_stability(),
        "worst pose": toggle.family({"elbow.rz": [0.0, 0.1]}, relaxed=True).worst(lambda s: s.K[0, 0]),
        "measurement": data, "matching": data.matched(model), "deflection": system.deflection_shape(10.0, "Fx"),
        "records": mv.Records(1e-3, {"F": times.reshape(2, 50)}, {"x": times.reshape(2, 50) ** 2}),
        "road": isolation.road_profile("C"), "periodic": turned.periodic({"A.rz": (1.0, 0.1)}),
        "slopes of a cycle": cycle.sensitivities(["arm1.mass", "arm2.mass"]),
        "vibration": study.under({"x y z": [(1.0, 1e-6), (10.0, 1e-4)]}),
        "measured modes": mv.MeasuredModes([1.0, 2.0]),
        "budget": system.budget({"Fx": isolation.white(1e-6)}), "step": system[["x", "z"], ["Fx", "Fz"]].step_info(),
        "sweep": mv.sweep(model, {"leg1.k.stiffness": [1e4, 2e4]}, "modes.frequencies"),
        "tolerances": mv.tolerances(model, {"leg1.k.stiffness": "10 %"}, studies.frequency(), samples=20),
        "fit": model.fit(data, free=["leg1.k.stiffness"]), "comparison": mv.compare(model, model),
        "path": mv.library.toggle().path("elbow.rz", [0.0, 0.1]),
        "optimum": mv.optimize(model, {"leg1.k.stiffness": (1e4, 3e4)}, studies.peak("x", "Fx")),
        "sensitivities": system.mode_sensitivities(["leg1.k.stiffness", "platform.mass"]),
        "stiffness shares": system.stiffness_shares(), "linear range": mv.library.toggle().linearize().linear_range(),
        "equilibrium": mv.library.hinged_rod().moved({"hinge.rz": 0.2}).equilibrium(report=True),
        "variants": mv.library.toggle().family({"elbow.rz": [0.0, 0.1]}, relaxed=True).modes(),
        "campbell": campbell(mv.library.rotor_stator(), [0.0, 50.0, 100.0]),
        "locus": isolation.root_locus(plant, lambda gain: isolation.force_feedback(plant, gain, 1.0), [0.0, 40.0]),
        "placement": isolation.placement(system, ["x", "y", "z"], sensors=2, modes=[1, 2]),
        "cycle": cycle,
    }  # fmt: skip


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_has_columns_or_is_no_table(name):
    stated = name in NO_TABLE or name.rpartition(".")[2] in NO_TABLE
    assert issubclass(RESULTS[name], Columnar) != stated, f"{name}: derive it from Columnar, or say why it has no table"


def test_checks_of_exports_have_columns(tmp_path):
    system = mv.library.quarter_car().linearize()
    mx.to_npz(system, tmp_path / "car.npz")
    check = mx.check_export(tmp_path / "car.npz", system)
    assert check.columns()["error"].tolist() == [row.error for row in check.comparisons]
    assert len(check.to_dataframe()) == len(check.comparisons) > 1


@pytest.mark.slow
def test_files_and_frames_have_all_columns_with_all_digits(results, tmp_path):
    for name, result in results.items():
        assert isinstance(result, Columnar), name
        columns = result.columns()
        with open(result.to_csv(tmp_path / f"{name}.csv"), newline="", encoding="utf-8") as stream:
            head, *rows = csv.reader(stream)
        assert head == list(columns), name
        frame = result.to_dataframe()
        assert len(frame) == len(rows) > 0, name
        for i, (key, column) in enumerate(columns.items()):
            read = np.array([row[i] for row in rows])
            same = read.astype(float) if np.asarray(column).dtype.kind == "f" else read
            np.testing.assert_array_equal(same, column if same is not read else list(map(str, column)), err_msg=key)
            framed = frame.index if frame.index.name == key else frame[key]
            np.testing.assert_array_equal(np.asarray(framed), np.asarray(column), err_msg=key)


@pytest.mark.slow
def test_results_pickle_with_their_columns(results):
    for name, result in results.items():
        other = pickle.loads(pickle.dumps(result))
        assert type(other) is type(result), name
        for key, column in result.columns().items():
            np.testing.assert_array_equal(np.asarray(other.columns()[key]), np.asarray(column), err_msg=f"{name} {key}")


@pytest.mark.slow
def test_columns_are_the_values_of_the_result(results):
    modes, step, fit = results["modes"].columns(), results["step"], results["fit"]
    np.testing.assert_array_equal(modes["frequency_hz"], results["modes"].frequencies)
    assert modes["mode"].tolist() == list(range(1, 13))
    assert modes["largest_motion"][0] == " ".join(results["modes"].strongest()[0])
    rows = list(zip(*step.columns().values(), strict=True))
    at = next(row for row in rows if row[:2] == ("z", "Fx"))
    assert at[3] == step.rise_time[step.outputs.index("z"), step.inputs.index("Fx")] or np.isnan(at[3])
    assert (fit.columns()["low"][0], fit.columns()["high"][0]) == fit.intervals["leg1.k.stiffness"]
    slopes = results["sensitivities"]
    np.testing.assert_array_equal(slopes.columns()["frequency_hz(3)"], slopes.frequencies[:, 2])
    np.testing.assert_array_equal(slopes.columns()["damping_ratio(2)"], slopes.damping_ratios[:, 1])
    speeds, locus, shares = results["campbell"], results["locus"], results["stiffness shares"]
    np.testing.assert_array_equal(speeds.columns()["frequency_hz(3)"], speeds.frequencies[:, 2])
    np.testing.assert_array_equal(speeds.columns()["whirl(2)"], speeds.whirl[:, 1])
    np.testing.assert_array_equal(locus.columns()["pole_im(5)"], locus.poles[:, 4].imag)
    np.testing.assert_array_equal(shares.columns()["mode(4)"], shares.shares[:, 3])
    np.testing.assert_array_equal(results["variants"].columns()["elbow.rz"], [0.0, 0.1])
    np.testing.assert_array_equal(results["linear range"].columns()["s"], results["linear range"].values[:, 0])
    rested, placed = results["equilibrium"], results["placement"]
    assert rested.columns()["rz"].tolist() == [motion[5] for motion in rested.displacements.values()]
    assert placed.columns()["sensors"][0] == ", ".join(placed.best.sensors)


@pytest.mark.slow
def test_results_show_a_table_in_notebooks(results):
    for name, result in results.items():
        assert isinstance(result, Displayed), name
        assert "<" in result._repr_html_(), name
        assert len(repr(result)) < 140, name


def test_failed_points_have_their_error_as_a_column(tmp_path):
    model = mv.library.quarter_car()
    name = next(key for key in model.parameters if key.endswith("stiffness"))
    sweep = mv.sweep(model, {name: [1e4, 2e4]}, lambda system: 1.0 if system.parameters[name] < 1.5e4 else 1 / 0)
    assert sweep.errors
    words = sweep.columns()["error"]
    assert words[0] == ""
    assert "division" in words[1]
    assert "error" not in str(sweep).splitlines()[2]
