"""What a search minimises: unknowns within bounds, norms with penalties of limits and barriers of slow poles."""

import itertools

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ModelError, ResponseError
from mbsvib.tuning.goals import as_goals
from mbsvib.tuning.problem import SLOW, SPARE, Unknowns
from mbsvib.tuning.searching import End, rank
from mbsvib.tuning.structures import Signals, Value, law
from mbsvib.tuning.tuning import _initial, _problem
from tests.tuning.test_tune import K, M, chain, oscillator

T, G = mv.tunable, mv.goals
INF = np.inf
VALUES = [Value("free", 3.0, -0.5, 0.2), Value("scale", 3.0, 2.0, 0.2, positive=True),
          Value("both", 3.0, 0.2, 0.3, bounds=(-6.0, 2.0)), Value("low", 3.0, 0.9, 0.3, bounds=(1.5, INF)),
          Value("high", 2.0, -0.4, 0.3, bounds=(-INF, 1.0)), Value("share", 3.0, 1.0, 0.3, True, (0.3, 9.0)),
          Value("from", 3.0, 1.0, 0.3, True, (0.3, INF)), Value("to", 3.0, 1.0, 0.3, True, (0.0, 9.0))]  # fmt: skip


def test_unknowns_of_a_start_give_its_values():
    unknowns = Unknowns.of(VALUES)
    p, _ = unknowns.values(unknowns.begin(None))
    np.testing.assert_allclose(p, [v.size * v.start for v in VALUES], rtol=1e-12)


@pytest.mark.parametrize("far", [0.1, 1.0, 4.0])
def test_values_stay_within_bounds_and_have_slopes(far):
    unknowns, rng = Unknowns.of(VALUES), np.random.default_rng(int(far))
    low, high = np.array([v.bounds for v in VALUES]).T
    for _ in range(10):
        x = far * rng.normal(size=len(VALUES))
        p, slope = unknowns.values(x)
        assert ((p >= low * (1.0 + 1e-12 * np.sign(-low))) & (p <= high * (1.0 + 1e-12 * np.sign(high)))).all()
        assert (p[[v.positive for v in VALUES]] > 0.0).all()
        step = 1e-6
        difference = (unknowns.values(x + step)[0] - unknowns.values(x - step)[0]) / (2.0 * step)
        np.testing.assert_allclose(slope, difference, rtol=1e-6, atol=1e-7)


@pytest.mark.slow
def test_random_starts_lie_about_the_start():
    """Of free values by their spread, of positive ones by that of the logarithm; those beyond bounds are moved in."""
    unknowns, rng = Unknowns.of(VALUES), np.random.default_rng(0)
    points = np.array([unknowns.values(unknowns.begin(rng))[0] for _ in range(2000)])
    size, start = np.array([v.size for v in VALUES]), np.array([v.start for v in VALUES])
    for k, spread in ((0, 0.2), (1, 0.2), (5, 0.3), (7, 0.3)):
        away = np.log(points[:, k] / size[k] / start[k]) if VALUES[k].positive else points[:, k] / size[k] - start[k]
        assert abs(away.mean()) < 0.03
        assert away.std() == pytest.approx(spread, rel=0.08)
    low, high = np.array([v.bounds for v in VALUES]).T
    assert ((points > low) & (points < high)).all()
    assert points[:, 4].max() > 0.9 * high[4] - 0.1
    assert points[:, 3].min() < 1.1 * low[3]


def test_large_logarithms_go_no_further():
    p, slope = Unknowns.of(VALUES[1:2]).values(np.array([40.0]))
    assert (p[0], slope[0]) == (pytest.approx(3e5), 0.0)
    p, slope = Unknowns.of(VALUES[1:2]).values(np.array([-40.0]))
    assert (p[0], slope[0]) == (pytest.approx(3e-5), 0.0)


def velocity(goals, gain, plants=None, **settings):
    problem = _problem(plants or oscillator(), T.gain("F", "v", start={"gain": -gain}), as_goals(goals), {}, **settings)
    return problem, problem.unknowns.begin(None)


def test_the_objective_is_the_largest_norm_with_penalties_and_a_barrier():
    """A velocity gain c: rms = 1 / sqrt(4 c k), damping ratio c / (2 sqrt(k m)), growth -c / 2 m, peak of v/F 1 / c."""
    c = 0.02
    rms, ratio = 1.0 / np.sqrt(4.0 * c * K), c / (2.0 * np.sqrt(K * M))
    goals = [G.rms("x", {"F": 1.0}), G.hinf("v", "F", weight=1e-3), G.damping(0.5), G.hinf("v", "F", most=20.0),
             G.hinf("v", "F", most=80.0)]  # fmt: skip
    problem, x = velocity(goals, c)
    missed, over = (0.5 - ratio) / 0.5, (1.0 / c - 20.0) / 20.0
    assert problem.measured(x) == (pytest.approx(rms, rel=1e-9), pytest.approx(max(missed, over), rel=1e-6))
    assert rank(problem, x) == (pytest.approx(max(missed, over), rel=1e-6), pytest.approx(rms, rel=1e-9))
    plain = rms + 3.0 * (missed + over + 2.0 * SPARE)
    assert problem.objective(x, 3.0)[0] == pytest.approx(plain, rel=1e-7)
    growth = problem.growth(x)[0]
    assert growth == pytest.approx(-c / (2.0 * M) / np.sqrt(K / M), rel=1e-6)
    assert -growth < SLOW
    assert problem.objective(x, 3.0, 0.7)[0] == pytest.approx(plain - 0.7 * np.log(-growth / SLOW), rel=1e-7)
    heavier, _ = velocity([*goals[:1], G.hinf("v", "F", weight=1.0)], c)
    assert heavier.measured(x) == (pytest.approx(1.0 / c, rel=1e-6), -INF)
    limits, _ = velocity(goals[2:], c)
    assert limits.objective(x, 3.0)[0] == pytest.approx(max(missed, over), rel=1e-6)
    quick, y = velocity(goals, 5.0)
    assert quick.objective(y, 3.0, 0.7)[0] == quick.objective(y, 3.0)[0]  # a fast loop feels no barrier


@pytest.mark.parametrize(("barrier", "gain"), [(0.0, 0.02), (0.7, 0.02), (0.7, 1.0)])
def test_objectives_have_gradients(barrier, gain):
    plants = [oscillator(), oscillator(k=20.0, m=3.0)]
    goals = [G.rms("x", {"F": 1.0}), G.damping(0.5), G.hinf("v", "F", most=2.0)]
    structure = T.gain("F", "v", start={"gain": -gain}) + T.gain("F", "x", name="k", start={"gain": -0.3})
    problem = _problem(plants, structure, as_goals(goals), {})
    x = problem.unknowns.begin(None)
    for function in (lambda y: problem.objective(y, 2.0, barrier), problem.growth):
        slope = function(x)[1]
        for along in np.eye(2):
            high, low = (function(x + side * 1e-6 * along)[0] for side in (1.0, -1.0))
            assert slope @ along == pytest.approx((high - low) / 2e-6, rel=1e-4, abs=1e-7 * np.linalg.norm(slope))


def test_growth_is_that_of_the_plant_where_it_is_largest():
    problem, x = velocity(G.damping(0.5), 0.5, [oscillator(), oscillator(m=20.0), oscillator(k=100.0)])
    rate = problem.scenes[0].rate
    assert rate == pytest.approx((np.sqrt(K / M) * np.sqrt(K / 20.0) * np.sqrt(100.0 / M)) ** (1.0 / 3.0), rel=1e-9)
    assert problem.growth(x)[0] == pytest.approx(-0.5 / 40.0 / rate, rel=1e-9)


def test_loops_that_do_not_decay_have_no_objective():
    problem, x = velocity([G.rms("x", {"F": 1.0}), G.damping(0.5)], -0.1)
    assert problem.objective(x, 1.0)[0] == INF
    assert problem.measured(x) == (INF, INF)
    assert problem.growth(x)[0] > 0.0
    mixed, y = velocity(G.damping(0.5), 0.1, [oscillator(), oscillator(c=-0.2)])
    assert mixed.stable(y) is None


PEAKS = [G.hinf("x", "F"), G.hinf("v", "F"), G.hinf("x", "F", mv.isolation.shaped([3.0], [1.0, 3.0])), G.margin(0.5),
         G.rolloff(0.1, 20.0)]  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("goal", PEAKS, ids=lambda goal: goal.label)
@pytest.mark.parametrize("sensor", ["v", "x"])
def test_a_search_is_told_where_the_library_finds_peaks(goal, sensor):
    """The response is as high as the norm at its frequency, and the search knows that frequency in its own unit."""
    plants = [oscillator(c=0.6), oscillator(c=0.6, k=300.0)]
    structure = T.gain("F", sensor, start={"gain": -1.3})
    problem = _problem(plants, structure, as_goals(goal), {})
    x = problem.unknowns.begin(None)
    told = problem.knowing(x)
    for number, (loop, scene) in enumerate(zip(problem.closed(problem.unknowns.values(x)[0]), problem.scenes,
                                               strict=True)):  # fmt: skip
        norm = goal.of(loop)
        (known,) = told.known[0][number]
        assert known * scene.rate == pytest.approx(norm.omega, rel=1e-12)
        w = np.array([norm.omega])
        f = w[0] / (2.0 * np.pi)
        sensitivity = loop.sensitivity(w)[0, 0, 0]
        found = {"margin": 1.0 / abs(sensitivity), "roll": abs(sensitivity * loop.loop_gain(w)[0, 0, 0]) * f / 0.1}
        plain = abs(loop.frequency_response(w, goal.outputs, "F")[0, 0, 0]) if goal.label.startswith("hinf") else 0.0
        found["hinf"] = plain * (3.0 / abs(3.0 + 1j * w[0]) if "weighted" in goal.label else 1.0)
        value = next(number for name, number in found.items() if goal.label.startswith(name))
        assert value == pytest.approx(norm.value, rel=1e-6)
    again = told.knowing(x)
    assert [len(known) for known in again.known[0]] == [2, 2]
    assert told.measured(x)[0] == pytest.approx(problem.measured(x)[0], rel=1e-6)


def test_goals_say_what_is_reached():
    """Values that are minimised have no answer; limits hold from above, least ones from below, at equality too."""
    for goal, value, rated, reached in (
        (G.hinf("x", "F", weight=3.0), 2.0, (6.0, 3.0), None), (G.hinf("x", "F", most=4.0), 5.0, (0.25, 0.25), False),
        (G.hinf("x", "F", most=4.0), 4.0, (0.0, 0.25), True), (G.rms("x", {}, most=4.0), 3.0, (-0.25, 0.25), True),
        (G.damping(0.5), 0.4, (0.2, -2.0), False), (G.damping(0.5), 0.5, (0.0, -2.0), True),
        (G.margin(0.5), 0.75, (-0.5, -2.0), True), (G.rolloff(3.0), 1.5, (0.5, 1.0), False),
    ):  # fmt: skip
        assert goal.rated(value) == pytest.approx(rated)
        assert goal.reached(value) is reached


def test_labels_of_goals():
    labels = [goal.label for goal in (
        G.hinf(), G.hinf("x", ["F", "G"], most=0.5), G.hinf("x", "F", [(1.0, 2.0), (2.0, 3.0)]), G.rms(["x", "v"], {}),
        G.rms("x", {}, most=2.0), G.damping(0.25), G.margin(0.5), G.rolloff(30.0, 40.0))]  # fmt: skip
    assert labels == ["hinf all / all", "hinf x / F, G <= 0.5", "hinf x / F, weighted", "rms x, v", "rms x <= 2",
                      "damping >= 0.25", "margin >= 0.5", "roll-off 40 dB/decade from 30 Hz <= 1"]  # fmt: skip


def test_poles_that_do_not_vibrate_have_no_damping_ratio():
    fast = mv.StateSpace.from_arrays([[-1.0]], [[1.0]], [[1.0]], [[0.0]], inputs=["F"], outputs=["x"])
    problem = _problem(fast, T.gain("F", "x"), as_goals(G.damping(0.5)), {})
    assert problem.measured(problem.unknowns.begin(None))[1] == pytest.approx(-1.0)
    assert G.damping(0.5).of(fast.feedback([[-1.0]], "x", "F")).value == 1.0


def test_initial_values_begin_the_search():
    bounds = {"k2.damping": (0.1, 5.0)}
    problem = _problem(chain(), T.pid("F", "v"), as_goals(G.damping(0.1)), bounds)
    given = {"F/v.kp": -3.0, "F/v.tau": 0.02, "k2.damping": 0.7}
    values = problem.values(problem.unknowns.values(_initial(problem, given))[0])
    assert {name: values[name] for name in given} == pytest.approx(given)
    start = problem.values(problem.unknowns.values(problem.unknowns.begin(None))[0])
    assert all(values[name] == pytest.approx(start[name]) for name in start if name not in given)
    assert start["k2.damping"] == pytest.approx(0.2)
    for wrong, words in (({"F/v.tau": -1.0}, "a positive number"), ({"F/v.kq": 1.0}, "not a value of this problem")):
        with pytest.raises(ModelError, match=words):
            _initial(problem, wrong)


@pytest.mark.parametrize(("bounds", "positive"), [((0.0, 5.0), False), ((0.1, 5.0), True), ((0.1, INF), True),
                                                  ((-5.0, 5.0), False), ((-INF, INF), False)])  # fmt: skip
def test_parameters_are_searched_by_logarithms_where_they_are_positive(bounds, positive):
    problem = _problem(chain(), T.gain("F", "v"), as_goals(G.damping(0.1)), {"k2.damping": bounds})
    assert problem.unknowns.positive[-1] == positive
    x = problem.unknowns.begin(None)
    assert problem.unknowns.values(x)[0][-1] == pytest.approx(0.2)
    for far in (-2.0, 0.5, 3.0):
        assert bounds[0] <= problem.unknowns.values(np.append(x[:-1], far))[0][-1] <= bounds[1]


def test_sizes_of_signals_follow_units():
    """Responses between actuators and sensors of these sizes are about 1; units of ports change nothing of that."""
    def plant(y, u):
        return mv.System.from_matrices([[M]], [[0.3]], [[K]], B=[[u[0], 3.0 * u[1]]], Cq=[[y[0]], [0.0]],
                                       Cv=[[0.0], [y[1]]], inputs=["F", "G"], outputs=["x", "v"])  # fmt: skip

    def sizes(y, u):
        problem = _problem(plant(y, u), T.gain(["F", "G"], ["x", "v"]), as_goals(G.damping(0.1)), {})
        return problem.scenes[0].signals()

    plain, other = sizes((1.0, 1.0), (1.0, 1.0)), sizes((1e3, 0.1), (1e-3, 50.0))
    ratio = {n: other.sensors[n] / plain.sensors[n] for n in "xv"}, {n: other.actuators[n] / plain.actuators[n]
                                                                     for n in "FG"}  # fmt: skip
    for n, m in itertools.product("xv", "FG"):
        expected = {"x": 1e3, "v": 0.1}[n] * {"F": 1e-3, "G": 50.0}[m]
        assert ratio[0][n] / ratio[1][m] == pytest.approx(expected, rel=1e-9)
    assert plain.actuators["F"] / plain.actuators["G"] == pytest.approx(3.0, rel=1e-9)
    assert plain.sensors["x"] / plain.actuators["F"] == pytest.approx(1.0 / K, rel=0.5)


def test_ends_rank_by_missed_limits_first():
    ends = [End(np.zeros(0), rank, None, ()) for rank in ((0.1, 1.0), (0.0, 5.0), (0.0, 3.0))]
    assert min(ends, key=lambda end: end.rank).rank == (0.0, 3.0)


def test_a_plant_out_of_reach_is_named():
    """Of a mode that no sensor sees, and of one without stiffness."""
    for cq, words in (([[1.0, 0.0]], r"no sensor sees the mode at 0\.4775 Hz"),
                      ([[0.0, 1.0]], r"no sensor sees the mode at 0\.3183 Hz")):
        system = mv.System.from_matrices(np.eye(2), np.zeros((2, 2)), np.diag([4.0, 9.0]), B=[[1.0], [1.0]], Cq=cq,
                                         inputs=["F"], outputs=["x"])  # fmt: skip
        with pytest.raises(ResponseError, match=words):
            mv.tune(system, T.pid("F", "x", terms="pd"), [G.hinf("x", "F")], starts=1)
    free = mv.System.from_matrices(np.eye(2), np.diag([0.0, 1.0]), np.diag([0.0, 9.0]), B=[[0.0], [1.0]], Cq=np.eye(2),
                                   inputs=["F"], outputs=["x", "y"])  # fmt: skip
    with pytest.raises(ResponseError, match="no actuator reaches a rigid-body mode at 0 Hz"):
        mv.tune(free, T.pid("F", "x", terms="pd"), [G.hinf("x", "F")], starts=1)


def test_start_and_bounds_of_values():
    signals = Signals({"a": 3.0}, {"b": 0.2})

    def value(**settings):
        return law(T.gain("a", "b", **settings), signals, 1.0).values[0]

    assert value().start * value().size == pytest.approx(-1.5)
    started = value(start={"gain": -40.0})
    assert (started.size, started.start) == (40.0, -1.0)
    assert value(start={"gain": 0.0}).size == pytest.approx(15.0)
    for bounds, begin in (((-9.0, -5.0), -5.0), ((-1.0, 4.0), -1.0), ((-9.0, 4.0), -1.5), ((2.0, 4.0), 2.0)):
        bounded = value(bounds={"gain": bounds})
        assert bounded.size * bounded.start == pytest.approx(begin)
        assert bounded.positive is (bounds[0] > 0.0)
    assert value(bounds={"gain": (-9.0, 9.0)}, start={"gain": 3.0}).start * 3.0 == pytest.approx(3.0)
    for settings in ({"bounds": {"gain": (-9.0, 1.0)}, "start": {"gain": 3.0}}, {"bounds": {"gain": (1.0, 9.0)},
                     "start": {"gain": 0.5}}, {"bounds": {"gain": 3.0}}):  # fmt: skip
        with pytest.raises(ModelError):
            value(**settings)
