"""Goals against formulas: weights over frequency, roll-off, limits of norms; what is not reached is said."""

from dataclasses import replace

import numpy as np
import pytest
from joblib import parallel_config
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib.errors import ModelError, ResponseError
from mbsvib.tuning import searching
from mbsvib.tuning.goals import as_goals
from mbsvib.tuning.tuning import _problem
from tests.tuning.test_tune import K, M, chain, check_gradient, oscillator

T, G = mv.tunable, mv.goals
FILTER = mv.StateSpace.from_arrays([[-3.0]], [[2.0]], [[1.5]], [[0.2]], inputs=["x"], outputs=["seen"])
OMEGA = np.geomspace(1e-3, 1e4, 400001)


@pytest.fixture(autouse=True)
def _no_restarts(monkeypatch):
    """Searches for one gain, where the first descents are enough."""
    monkeypatch.setattr(searching, "RESTARTS", 0)


def velocity_loop(gain):
    return oscillator().feedback([[-gain]], "v", "F", noise=True)


def compliance(gain, w=OMEGA):
    return 1.0 / (K - M * w**2 + 1j * w * gain)


def by_table(w):
    return np.where((w >= 2.0 * np.pi * 0.1) & (w <= 2.0 * np.pi), 3.0 * (w / (0.2 * np.pi)) ** -0.5, 0.0)


@pytest.mark.parametrize(("weight", "gain"), [
    (mv.isolation.shaped([0.2, 3.6], [1.0, 3.0]), lambda w: 3.0 / (3.0 + 1j * w) + 0.2),
    (FILTER, lambda w: 3.0 / (3.0 + 1j * w) + 0.2),
    ([(0.1, 3.0), (1.0, 3.0 * 10**-0.5)], by_table),
], ids=["filter", "state space", "table"])  # fmt: skip
def test_weighted_peaks_are_those_of_the_formula(weight, gain):
    goal, loop = G.hinf("x", "F", weight), velocity_loop(1.3)
    expected = float(np.abs(gain(OMEGA) * compliance(1.3)).max())
    norm = goal.of(loop)
    assert norm.value == pytest.approx(expected, rel=1e-7)
    problem = _problem(oscillator(), T.gain("F", "v", start={"gain": -1.3}), as_goals(goal), {})
    value, w = problem.measured(problem.unknowns.begin(None))[0], norm.omega
    assert value == pytest.approx(norm.value, rel=1e-7)
    assert abs(gain(w) * compliance(1.3, w)) == pytest.approx(expected, rel=1e-7)


def test_weight_of_several_outputs_has_their_names_in_any_order():
    a, b, c, d = np.array([[-2.0]]), np.array([[0.5, 3.0]]), np.array([[1.0], [0.0]]), np.diag([0.1, 0.7])
    weight = mv.StateSpace.from_arrays(a, b, c, d, inputs=["v", "x"], outputs=["p", "q"])
    w = OMEGA[::40]
    y = np.array([1j * w, np.ones(len(w))]) * compliance(0.7, w)  # v, x
    z = c @ (b @ y / (1j * w + 2.0)) + d @ y
    goal = G.hinf(["x", "v"], "F", weight)
    assert goal.of(velocity_loop(0.7)).value == pytest.approx(np.linalg.norm(z, axis=0).max(), rel=1e-4)
    problem = _problem(oscillator(), T.gain("F", "v", start={"gain": -0.7}), as_goals(goal), {})
    assert problem.measured(problem.unknowns.begin(None))[0] == pytest.approx(
        goal.of(velocity_loop(0.7)).value, rel=1e-7)


def test_transfer_functions_of_python_control_are_weights():
    control = pytest.importorskip("control")
    goals = [G.hinf("x", "F", weight) for weight in (control.tf([0.2, 3.6], [1.0, 3.0]), FILTER)]
    assert goals[0].of(velocity_loop(1.3)).value == pytest.approx(goals[1].of(velocity_loop(1.3)).value, rel=1e-9)


def rolled(gain, w0, decibels):
    w = np.geomspace(w0, 1e3 * w0, 20001)
    t = gain * 1j * w * compliance(gain, w)
    return float((np.abs(t) * (w / w0) ** (decibels / 20.0)).max())


@pytest.mark.parametrize("decibels", [0.0, 20.0])
def test_roll_off_is_that_of_the_complementary_sensitivity(decibels):
    goal = G.rolloff(5.0 / (2.0 * np.pi), decibels)
    assert goal.of(velocity_loop(6.0)).value == pytest.approx(rolled(6.0, 5.0, decibels), rel=1e-6)


@pytest.mark.slow
def test_roll_off_limits_a_gain():
    """Noise alone would want c = 20; a roll-off from 5 rad/s by 20 dB/decade allows less."""
    goals = [G.rms("x", {"F": 4.0, "v.noise": 0.01}), G.rolloff(5.0 / (2.0 * np.pi), 20.0)]
    design = mv.tune(oscillator(), T.gain("F", "v"), goals, starts=1)
    expected = brentq(lambda gain: rolled(gain, 5.0, 20.0) - 1.0, 1.0, 20.0)
    assert design.values["F/v.gain"] == pytest.approx(-expected, rel=1e-4)
    assert design.success
    assert "roll-off 20 dB/decade from 0.795775 Hz <= 1" in str(design)


@pytest.mark.slow
def test_limit_of_a_norm_is_kept_while_another_is_minimised():
    """The least rms needs c = 20; a peak of v/F, which is 1/c, of at most 1/25 needs c = 25."""
    goals = [G.rms("x", {"F": 4.0, "v.noise": 0.01}), G.hinf("v", "F", most=1.0 / 25.0)]
    design = mv.tune(oscillator(), T.gain("F", "v"), goals, starts=1)
    assert design.success
    assert design.achieved["hinf v / F <= 0.04"] <= 1.0 / 25.0
    assert design.values["F/v.gain"] == pytest.approx(-25.0, rel=1e-5)
    assert design.objective == pytest.approx(np.sqrt((4.0 + 25.0**2 * 0.01) / (4.0 * 25.0 * K)), rel=1e-5)


IMPOSSIBLE = [G.hinf("x", "F", most=1e-3), G.hinf("x", "F", FILTER, most=1e-3), G.rms("x", {"F": 1.0}, most=1e-3),
              G.damping(0.9), G.margin(0.99), G.rolloff(0.01, 40.0)]  # fmt: skip


@pytest.mark.few(2)
@pytest.mark.parametrize("goal", IMPOSSIBLE, ids=lambda goal: goal.label)
def test_goal_of_each_kind_that_is_not_reached_is_said(goal):
    structure = T.gain("F", "x" if "margin" in goal.label else "v", bounds={"gain": (-0.5, -0.1)})
    design = mv.tune(oscillator(c=0.1), structure, [goal], starts=1)
    assert design.reached == {goal.label: False}
    assert not design.success
    assert f"Not reached: {goal.label}." in str(design)


def test_gradients_of_weighted_goals_equal_differences():
    weight = mv.StateSpace.from_arrays([[-20.0]], [[5.0, 30.0]], [[1.0], [0.3]], np.diag([0.2, 0.1]), inputs=["x", "v"],
                                       outputs=["p", "q"])  # fmt: skip
    structure = T.pid("F", "xb") + T.gain("F", "v")
    for goal in (G.hinf(["v", "x"], "F", weight), G.hinf("x", "F", [(0.1, 1.0), (3.0, 5.0)]), G.rolloff(2.0, 30.0)):
        check_gradient(_problem(chain().linearize(), structure, as_goals(goal), {}))


@pytest.mark.parametrize("count", [2, 3])
def test_margins_of_several_actuators_have_slopes_and_no_units(count):
    """Forces in units of 1, 1e3 and 1e-6: the margin is that of ``margins``, and its gradient equals differences."""
    names = ["F", "G", "H"][:count]
    rng = np.random.default_rng(1)
    b = rng.normal(size=(3, count)) * [1.0, 1e3, 1e-6][:count]
    k = np.array([[700.0, -300.0, 0.0], [-300.0, 500.0, -200.0], [0.0, -200.0, 200.0]])
    system = mv.System.from_matrices(np.eye(3), 2e-2 * k, k, b, np.eye(3), inputs=names, outputs=["x", "y", "z"])
    problem = _problem(system, T.gain(names, ["x", "y", "z"]), as_goals(G.margin(0.9)), {})
    x = problem.unknowns.begin(None) + 3.0 * rng.normal(size=3 * count)
    while not np.isfinite(problem.objective(x, 1.0)[0]):
        x *= 0.7
    (loop,) = problem.closed(problem.unknowns.values(x)[0])
    modulus = loop.margins().modulus
    assert modulus < 0.8
    assert problem.measured(x)[1] == pytest.approx(1.0 - modulus / 0.9, rel=1e-6)
    value, slope = problem.objective(x, 1.0)
    assert value == pytest.approx(1.0 - modulus / 0.9, rel=1e-6)
    for k, step in enumerate(1e-3 * np.eye(len(x))):
        ahead, behind = (problem.objective(x + sign * step, 1.0)[0] for sign in (1.0, -1.0))
        assert slope[k] == pytest.approx((ahead - behind) / 2e-3, rel=2e-3, abs=2e-4 * np.abs(slope).max())


@pytest.mark.slow
def test_number_of_workers_changes_nothing():
    goals, structure = [G.rms("x", {"F": 4.0, "v.noise": 0.01, "x.noise": 0.01})], T.gain("F", ["x", "v"])
    alone = mv.tune(oscillator(c=0.1), structure, goals, starts=3, workers=1)
    with parallel_config("threading", n_jobs=2):
        together = mv.tune(oscillator(c=0.1), structure, goals, starts=3)
    assert together.values == alone.values
    assert together.history == alone.history


@pytest.mark.slow
def test_searches_run_in_processes():
    goals, bounds = [G.rms("x", {"F": 1.0, "v.noise": 1e-2})], {"k2.damping": (0.1, 5.0)}
    designs = [mv.tune(chain(), T.gain("F", "v"), goals, bounds, starts=2, workers=count) for count in (1, 2)]
    assert designs[0].values == designs[1].values


def test_units_of_weights_are_those_of_outputs():
    model = chain()
    system = model.linearize()
    goal = G.hinf("v", "F", replace(FILTER, input_units=("m",)))
    with pytest.raises(ResponseError, match="takes 'v' in m; the output has the unit m/s"):
        mv.tune(system, T.gain("F", "v"), [goal], starts=1)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: G.hinf("x", "F", "heavy"), "weight"),
    (lambda: G.hinf("x", "F", mv.StateSpace.from_arrays([[1.0]], [[1.0]], [[1.0]], [[0.0]])), "does not decay"),
    (lambda: G.hinf("x", "F", [(1.0, 2.0)]), "pairs"),
    (lambda: G.hinf("x", "F", most=0.0), "most"),
    (lambda: G.rolloff(0.0), "frequency"),
    (lambda: G.rolloff(1.0, -20.0), "decibels"),
    (lambda: G.hinf("x", "F", mv.StateSpace.from_arrays([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]])).of(
        velocity_loop(1.0)), "the weight has the inputs u1, u2"),
])  # fmt: skip
def test_refusals(make, words):
    with pytest.raises((ModelError, ResponseError), match=words):
        make()


@pytest.mark.slow
def test_designs_tell_the_worst_of_all_plants():
    """Each goal by plant as the library has it; two of one name are numbered; norms count by their weights."""
    plants = [oscillator(c=0.1), oscillator(k=40.0, m=5.0, c=0.3)]
    goals = [G.rms("x", {"F": 4.0}, weight=2.0), G.rms("x", {"v.noise": 0.05}), G.damping(0.05), G.margin(0.2),
             G.hinf("x", "F", most=1e-3)]  # fmt: skip
    design = mv.tune(plants, T.gain("F", "v", bounds={"gain": (-6.0, -0.1)}), goals, starts=1)
    labels = ["rms x (1)", "rms x (2)", "damping >= 0.05", "margin >= 0.2", "hinf x / F <= 0.001"]
    assert list(design.achieved) == list(design.by_plant) == labels
    for label, goal in zip(labels, goals, strict=True):
        values = [goal.of(loop).value for loop in design.loop]
        assert design.by_plant[label] == pytest.approx(values)
        assert design.achieved[label] == pytest.approx((min if "least" in label or ">=" in label else max)(values))
        assert len(set(values)) == 2 or "margin" in label
    assert design.objective == pytest.approx(max(2.0 * design.achieved["rms x (1)"], design.achieved["rms x (2)"]))
    assert design.reached == {labels[2]: True, labels[3]: True, labels[4]: False}
    assert not design.success
    rows = {row[0]: row[2] for row in design.table()["rows"]}
    assert rows == {labels[0]: "minimised", labels[1]: "minimised", labels[2]: "reached", labels[3]: "reached",
                    labels[4]: "not reached"}  # fmt: skip
    assert design.table()["notes"][:2] == ["Not reached: hinf x / F <= 0.001.", "Values are the worst of 2 plants."]


def test_goals_without_a_value_are_named():
    """White noise comes through to an acceleration directly."""
    system = mv.System.from_matrices([[M]], [[0.3]], [[K]], B=[[1.0]], Cv=[[1.0], [0.0]], Cq=[[0.0], [0.0]],
                                     Ca=[[0.0], [1.0]], inputs=["F"], outputs=["v", "a"])  # fmt: skip
    for goal in (G.rms("a", {"F": 1.0}), G.rms("a", {"F": 1.0}, most=3.0)):
        with pytest.raises(ResponseError, match=r"the goal 'rms a.*' is infinite although the loop is stable"):
            mv.tune(system, T.gain("F", "v"), [goal], starts=1)
