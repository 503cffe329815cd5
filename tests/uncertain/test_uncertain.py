"""Uncertain plants: the linear fractional map is exact, bounds hold, and values do what is said of them."""

import itertools
import pickle
from types import SimpleNamespace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from mbsvib.uncertain import certain
from mbsvib.uncertain.certain import Proof
from mbsvib.uncertain.results import RobustStability
from mbsvib.uncertain.scalings import Channels, _Problem, bases, best_scalings, cover, least
from mbsvib.uncertain.search import gain, growth, perturbed, values_at
from tests.random.scenes import oscillator, two_masses

M, C, K = 2.0, 3.0, 800.0


def platform():
    model = library.cubic_hexapod()
    model.add_force_output("leg1.force", "leg1.k", "z")
    return model.linearize()


def closed(plant, delta):
    """The map with its changes closed, in units of half the width."""
    problem = perturbed(plant)
    a, b, c, d = problem.closure(np.asarray(delta)).closed
    return mv.StateSpace.from_arrays(a, b, c, d, plant.inputs, plant.outputs)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(3))
def test_the_map_is_the_system_at_other_values(seed):
    """Within the limits and beyond, a mass and its inertia too, to rounding of the responses."""
    plant = platform().uncertain({"leg*.k.stiffness": 0.1, "leg2.k.damping": 0.9, "platform.mass": (9.0, 13.0),
                                  "platform.inertia.zz": 0.15})  # fmt: skip
    delta = np.random.default_rng(seed).uniform(-1.5, 1.5, 9)
    values, w = values_at(plant, delta), np.array([11.0, 320.0, 900.0])
    expected = plant.at(values).frequency_response(w)
    got = closed(plant, delta).frequency_response(w)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(got / size, expected / size, atol=1e-11)


@pytest.mark.parametrize("delta", [-1.0, 0.3, 1.0])
def test_stiffness_of_springs_with_relaxations_enters_with_all_of_them(delta):
    """x/F = 1 / (m s^2 + c s + k (1 + g s t/(1 + s t))): the nodes of relaxations have no mass."""
    model = mv.Model("relaxing")
    model.add_body("a", M, (1, 1, 1), (0, 0, 1))
    model.add_joint("guide", "prismatic", "ground", "a", axis=(0, 0, 1))
    model.add_spring("k", "ground", "a", (0, 0, 0), (0, 0, 1), K, C, dynamic=mv.Dynamic.prony([0.3, 0.5], [0.5, 0.02]))
    model.add_input("F", "a", "z")
    model.add_output("x", "a", "z")
    plant, w = model.linearize().uncertain({"k.stiffness": 0.2}), np.array([1.0, 20.0, 300.0])
    s, factor = 1j * w, 1.0 + sum(g * 1j * w * t / (1.0 + 1j * w * t) for g, t in ((0.3, 0.5), (0.5, 0.02)))
    got = closed(plant, np.full(plant.blocks["k.stiffness"], delta)).frequency_response(w)[0, 0]
    np.testing.assert_allclose(got, 1.0 / (M * s**2 + C * s + K * (1.0 + 0.2 * delta) * factor), rtol=1e-11)


def test_repetitions_are_the_ranks():
    """A leg enters once, also where its force is an output; a mass three times, an inertia about one axis once."""
    plant = platform().uncertain({"leg1.k.stiffness": 0.1, "platform.mass": 0.1, "platform.inertia.zz": 0.1})
    assert plant.blocks == {"leg1.k.stiffness": 1, "platform.mass": 3, "platform.inertia.zz": 1}
    assert plant.linear.inputs[:5] == ("leg1.k.stiffness.w", "platform.mass.w1", "platform.mass.w2",
                                       "platform.mass.w3", "platform.inertia.zz.w")  # fmt: skip
    assert plant.limits["platform.mass"] == (9.0, 11.0)
    assert "platform.mass" in str(plant)
    assert repr(plant) == "UncertainPlant('cubic_hexapod': 3 parameters, 5 channels)"


@pytest.mark.slow
def test_measured_forces_keep_their_actuators():
    """Actuators are in measured forces of a study's plant, which its model does not know."""
    active = isolation.actuated(library.cubic_hexapod(damping=20.0), "platform")
    plant = active.system.uncertain({"leg*.k.stiffness": 0.1})
    there = plant.at({"leg1.k.stiffness": 1.05e6})
    row, column = (names.index(name) for names, name in
                   ((there.outputs, "leg1.k.force"), (there.inputs, "leg1.k.actuator")))  # fmt: skip
    assert there.D[row, column] == active.system.D[row, column] != 0.0
    delta, w = np.array([0.5, 0, 0, 0, 0, 0]), np.array([100.0, 600.0])
    size = np.abs(there.frequency_response(w)).max()
    np.testing.assert_allclose(closed(plant, delta).frequency_response(w) / size, there.frequency_response(w) / size,
                               atol=1e-10)  # fmt: skip


@pytest.mark.slow
def test_units_of_changes_make_no_difference():
    """The same mechanism in millimetres and grams, as its margins are numbers."""
    factors = []
    for length, mass in ((1.0, 1.0), (1e3, 1e3)):
        force = mass * length  # s is the same
        model = mv.Model("scaled")
        model.add_body("b", M * mass, np.ones(3) * mass * length**2)
        model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
        model.add_spring("s", "ground", "b", (0, 0, -length), (0, 0, 0), stiffness=K * force / length,
                         damping=C * force / length)  # fmt: skip
        model.add_input("F", "b", "z")
        model.add_output("x", "b", "z")
        plant = model.linearize().uncertain({"s.stiffness": 0.3, "s.damping": 0.4})
        factors.append((plant.robust_stability().upper, plant.worst_gain().upper * force / length))
    np.testing.assert_allclose(factors[1], factors[0], rtol=1e-6)


@pytest.mark.slow
def test_a_damper_that_may_vanish():
    """Stable as long as c > 0 and k > 0: c goes to 0 at three times the distance from 3 to 2."""
    stable = oscillator().linearize().uncertain({"s.stiffness": 0.2, "s.damping": (2.0, 5.0)}).robust_stability()
    np.testing.assert_allclose(stable.upper, 3.0, rtol=1e-9)
    assert 0.95 * 3.0 < stable.lower < 3.0
    np.testing.assert_allclose(stable.values["s.damping"], 0.0, atol=1e-9)
    np.testing.assert_allclose(stable.omega, np.sqrt(stable.values["s.stiffness"] / M), rtol=1e-6)
    assert "Stable at all values within the limits." in str(stable)


@pytest.mark.slow
def test_static_divergence():
    """A spring that loses all of its stiffness, 1/0.2 times its width; no frequency but 0 shows it."""
    stable = oscillator().linearize().uncertain({"s.stiffness": 0.2}).robust_stability()
    np.testing.assert_allclose([stable.upper, stable.omega], [5.0, 0.0], rtol=1e-9, atol=1e-9)
    assert 0.95 * 5.0 < stable.lower < 5.0


@pytest.mark.slow
def test_worst_peak_in_closed_form():
    """1 / (k 2 z sqrt(1 - z^2)) is largest for the softest spring and the weakest damper."""
    worst = oscillator().linearize().uncertain({"s.stiffness": 0.2, "s.damping": (2.0, 5.0)}).worst_gain("x", "F")
    k, c = 0.8 * K, 2.0
    z = 0.5 * c / np.sqrt(k * M)
    np.testing.assert_allclose(worst.lower, 1.0 / (k * 2.0 * z * np.sqrt(1.0 - z * z)), rtol=1e-8)
    assert worst.lower < worst.upper < 1.005 * worst.lower
    np.testing.assert_allclose(worst.omega, np.sqrt(k / M * (1.0 - 2.0 * z * z)), rtol=1e-6)
    assert f"at {worst.omega / (2.0 * np.pi):.4g} Hz" in str(worst)
    assert worst.values == {"s.stiffness": pytest.approx(k), "s.damping": pytest.approx(c)}


def flutter():
    """Two masses whose velocity feedback is not collocated: some values let a mode grow."""
    plant = two_masses().linearize().uncertain({"k2.stiffness": 0.4, "m2.mass": (0.7, 1.5)})
    return plant.feedback([[-3.0]], ["v2"], ["F1"])


@pytest.mark.slow
def test_flutter_against_a_search_of_all_values():
    loop = flutter()
    stable = loop.robust_stability()

    def grows(t):
        limits = t * perturbed(loop, [], []).limits
        grid = itertools.product(*[np.linspace(low, high, 41) for low, high in limits])
        return any(np.linalg.eigvals(closed(loop, delta).A).real.max() > 0.0 for delta in grid)

    assert not grows(0.97 * stable.upper)
    assert 0.95 * stable.upper < stable.lower < stable.upper
    pole = loop.at(stable.values).poles()
    last = pole[np.argmax(pole.real)]
    assert abs(last.real) < 1e-8 * abs(last)
    np.testing.assert_allclose(abs(last.imag), stable.omega, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("limits", [{"k1.stiffness": 0.3, "m1.mass": 0.3},
                                    {"k1.stiffness": 0.3, "k2.stiffness": 0.3, "m2.mass": 0.3}])  # fmt: skip
def test_masses_and_springs_exchange_energy_only(limits):
    """A mechanism with dampers is stable for all positive masses and stiffness: up to 1 / 0.3 of the distances."""
    stable = two_masses().linearize().uncertain(limits).robust_stability()
    assert stable.upper == pytest.approx(1.0 / 0.3, rel=2e-3)
    assert stable.lower > 0.98 * stable.upper


@pytest.mark.slow
def test_a_mass_that_vanishes_makes_the_equations_singular():
    stable = oscillator().linearize().uncertain({"b.mass": 0.5}).robust_stability()
    assert (stable.upper, stable.omega) == (pytest.approx(2.0, rel=1e-9), np.inf)
    assert stable.lower > 0.98 * stable.upper
    assert "2 times as far, the equations become singular" in str(stable)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_bounds_of_gains_do_not_depend_on_units(size):
    """0.5 + 0.1 d / (1 - 0.5 d) is 0.7 at most; the unit of the channel between parameter and gain is free."""
    for bound, proven in ((0.71, True), (0.69, False)):
        m = np.array([[0.5, 0.1 * size], [1.0 / size, 0.5]], dtype=complex) / np.array([[1.0], [bound]])
        scalings, _ = best_scalings(m, (1,), 1)
        phi = scalings.phi(m, 1)
        unit = 1.0 / np.sqrt([scalings.d[0, 0].real, 1.0])
        assert bool(np.linalg.eigvalsh(unit[:, None] * phi * unit)[0] > 0.0) is proven


@pytest.mark.slow
def test_worst_gain_of_a_loop_against_samples():
    loop = platform().uncertain({"leg*.k.stiffness": 0.1, "platform.mass": (9.0, 12.0)}).feedback(
        -3e4 * np.eye(6), ["x", "y", "z", "rx", "ry", "rz"], ["Fx", "Fy", "Fz", "Mx", "My", "Mz"])  # fmt: skip
    worst = loop.worst_gain("z", "Fz")
    assert worst.lower <= worst.upper < 1.02 * worst.lower
    np.testing.assert_allclose(loop.at(worst.values).hinf_norm("z", "Fz").value, worst.lower, rtol=1e-9)
    assert all(plant.hinf_norm("z", "Fz").value <= worst.upper for plant in loop.sample(12, seed=3))


@pytest.mark.slow
def test_worst_root_mean_square():
    """S / (4 c k): the least damper and spring; the noise of a sensor through a gain."""
    plant = oscillator().linearize().uncertain({"s.stiffness": 0.2, "s.damping": (2.0, 5.0)})
    worst = plant.worst_rms(["x", "v"], {"F": 1.0})
    np.testing.assert_allclose(worst.lower["x"], np.sqrt(1.0 / (4.0 * 2.0 * 0.8 * K)), rtol=1e-9)
    np.testing.assert_allclose(plant.at(worst.values["x"]).rms("x", {"F": 1.0})["x"], worst.lower["x"], rtol=1e-12)
    loop = plant.feedback([[-100.0, -4.0]], ["x", "v"], ["F"], noise=True)
    noisy = loop.worst_rms("x", {"x.noise": 1e-6})
    np.testing.assert_allclose(noisy.lower["x"], 100.0 * np.sqrt(1e-6 / (4.0 * 6.0 * (0.8 * K + 100.0))), rtol=1e-9)
    assert "proven" in str(worst)


@pytest.mark.slow
def test_an_unstable_plant_within_the_limits_has_no_gain():
    worst = oscillator(c=0.5).linearize().uncertain({"s.damping": (-0.1, 2.0)}).worst_gain("x", "F")
    assert worst.lower == worst.upper == np.inf
    assert "not stable at these values" in str(worst)


def test_scalings_of_a_repeated_parameter():
    """M = a 1 is singular at delta = 1 / a: Phi can be positive below only, for real and for complex a."""
    for a, expected in ((0.9, True), (1.1, False), (0.5 + 3.0j, True), (1.05 + 0.01j, True)):
        matrix = a * np.eye(3, dtype=complex)
        assert (best_scalings(matrix, (3,), 0, 0.0)[1] > 0.0) is expected, a


@pytest.mark.parametrize("share", [1.0, 0.1, 1e-2, 1e-3])
def test_scalings_of_a_lightly_damped_mode(share):
    """M = g u v^T is singular where u1 v1 d1 + u2 v2 d2 = 1 / g: for no real d, however real g nearly is."""
    m = (1.0 - 1j * share) * np.outer((2.5, -1.7), (1.0, 0.6))
    assert best_scalings(m, (1, 1), 0, 0.1)[1] > 0.1


@pytest.mark.slow
def test_light_damping_is_proven_stable_within_the_limits():
    """One mass on a spring and a damper of a damping ratio of 1e-3: stable for all positive values."""
    plant = oscillator(1.67, 857.0, 0.08).linearize().uncertain({"b.mass": (1.5, 1.84), "s.stiffness": 0.06})
    assert plant.robust_stability().lower > 1.0


@pytest.mark.few(2)
@pytest.mark.parametrize(("sizes", "ports"), [((1,), (0, 0)), ((2, 1), (0, 0)), ((1, 1), (1, 2)), ((3,), (2, 1))])
def test_no_other_scalings_are_better(sizes, ports):
    """The least eigenvalue of Phi is concave: what no small change with the same trace improves is the best."""
    rng, (inputs, outputs), n = np.random.default_rng(sum(sizes)), ports, sum(sizes)
    for size in (0.05, 0.1, 0.2):
        m = size * (rng.normal(size=(n + outputs, n + inputs)) + 1j * rng.normal(size=(n + outputs, n + inputs)))
        problem = _Problem(m, bases(sizes), n, inputs)
        x, s = problem.solved(np.inf)
        assert s > 0.0  # else the search ends as soon as this is known
        assert np.linalg.eigvalsh(problem._phi(x))[0] >= s - 1e-9
        assert np.linalg.eigvalsh(problem._d(x))[0] > 0.0
        assert problem.trace @ x == pytest.approx(n + bool(inputs))
        for step in np.geomspace(1e-3, 0.3, 4):
            for change in rng.normal(size=(40, len(x))):
                change -= problem.trace * (problem.trace @ change) / (problem.trace @ problem.trace)
                there = x + step * change
                values = np.linalg.eigvalsh(problem._phi(there))
                if np.linalg.eigvalsh(problem._d(there))[0] > 0.0 and values[-1] < problem.bound:
                    assert values[0] < s + 1e-3


def test_a_cover_finds_a_single_frequency():
    """A real mu that is 0 at all frequencies but one: a mode of which only the damping is uncertain."""
    for limit, proven in ((0.9, True), (1.1, False)):
        a = np.array([[0.0, 1.0], [-1.0, -0.02]])
        channels = Channels(a, np.array([[0.0], [-0.02 * limit]]), np.array([[0.0, 1.0]]), np.zeros((1, 1)), (1,), 0)
        scalings = []
        w = cover(channels, scalings)
        assert (w is None) is proven
        grid = np.geomspace(1e-3, 1e3, 4001)
        if proven:
            best = np.max([least(channels, part, grid) for part in scalings], axis=0)
            assert (best > 0.0).all()
            assert cover(channels, [], most=len(scalings)) is None
            assert cover(channels, [], most=len(scalings) - 1) is not None


def test_what_is_said_of_factors():
    for lower, upper, words in ((0.4, 0.9, "Not stable at all values"), (1.1, 1.2, "Stable at all values"),
                                (0.9, 1.1, "is neither proven nor refuted.")):  # fmt: skip
        assert words in str(RobustStability("plant", lower, upper, {}, np.nan))


@pytest.mark.parametrize("measure", [growth, gain])
def test_gradients_of_growth_and_gain(measure):
    """Along random changes of equations without symmetry, against differences."""
    rng = np.random.default_rng(2)
    n, inputs, outputs = 4, 2, 3
    full = rng.normal(size=(n + outputs, n + inputs))
    full[:n, :n] -= 3.0 * np.eye(n)

    def value(matrix):
        return measure((matrix[:n, :n], matrix[:n, n:], matrix[n:, :n], matrix[n:, n:]))

    slopes, step = value(full)[1], 1e-6
    for change in rng.normal(size=(3, *full.shape)):
        difference = (value(full + step * change)[0] - value(full - step * change)[0]) / (2.0 * step)
        assert (slopes * change).sum() == pytest.approx(difference, rel=1e-6)


@pytest.mark.slow
def test_a_gain_that_is_highest_within_the_limits():
    """A second mass that is tuned to the drive carries most: neither limit of its spring is the worst value."""
    plant = two_masses().linearize().uncertain({"k2.stiffness": (150.0, 600.0)})
    found, delta = perturbed(plant, "x2", "F1").highest(gain)
    w = np.linspace(10.0, 45.0, 2001)
    peaks = {k: np.abs(plant.at({"k2.stiffness": k}).frequency_response(w, "x2", "F1")).max()
             for k in np.linspace(150.0, 600.0, 16)}  # fmt: skip
    best = max(peaks, key=peaks.get)
    assert 160.0 < best < 590.0
    assert found >= 0.999 * peaks[best]
    assert values_at(plant, delta)["k2.stiffness"] == pytest.approx(best, abs=30.0)


@pytest.mark.few(1)
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_a_gain_is_proven_above_its_peak_only(size):
    """1 / (s + 2 + 0.5 d) has the gain 1 / 1.5 at most."""
    a, one = np.array([[-2.0]]), np.ones((1, 1))
    proof = Proof((a, np.hstack((one, one)), np.vstack((-0.5 * one, size * one)), np.zeros((2, 2))), (1,), 1.0)
    limits = np.array([[-1.0, 1.0]])
    assert proof.holds(limits, [], 1.01 * size / 1.5, most=10)
    assert not proof.holds(limits, [], 0.99 * size / 1.5, most=10)


def test_samples_and_copies():
    plant = platform().uncertain({"platform.mass": (9.0, 12.0)})
    first, second = plant.sample(2, seed=5)
    again = plant.sample(2, seed=5)[0]
    np.testing.assert_array_equal(first.M, again.M)
    assert 9.0 <= first.M[0, 0] <= 12.0
    assert first.M[0, 0] != second.M[0, 0]
    assert pickle.loads(pickle.dumps(plant)).blocks == plant.blocks


@pytest.mark.parametrize(("limits", "words"), [
    ({}, "parameters with limits"),
    ({"leg9.k.stiffness": 0.1}, "no parameter 'leg9"),
    ({"leg1.k.stiffness": -0.1}, "half its width"),
    ({"leg1.k.stiffness": 20}, "20; expected half its width .* 0.1 is 10 %; more than 1 changes its sign"),
    ({"leg1.k.stiffness": (2e6, 3e6)}, "is not within its limits"),
    ({"platform.inertia.xy": 0.1}, "is 0, so that a relative width"),
    ({"leg1.k.end.x": (-1.0, 1.0)}, "is no straight line"),
    ({"leg1*": 0.1, "*.stiffness": 0.1}, "two patterns match|is 0, so that"),
    ({"platform.mass": (-1.0, 12.0)}, "platform.mass"),
])  # fmt: skip
def test_refused_limits(limits, words):
    with pytest.raises(mv.MbsvibError, match=words):
        platform().uncertain(limits)


def test_other_refusals():
    plant = platform().uncertain({"leg1.k.stiffness": 0.1})
    with pytest.raises(mv.ModelError, match="not an uncertain parameter"):
        plant.at({"leg2.k.stiffness": 1e6})
    with pytest.raises(mv.ResponseError, match="does not decay at the nominal"):
        oscillator(c=0.0).linearize().uncertain({"s.stiffness": 0.1}).robust_stability()
    with pytest.raises(mv.ResponseError, match="filtered white noise"):
        plant.worst_rms("z", {"Fz": [(1.0, 1.0), (2.0, 1.0)]})
    with pytest.raises(mv.ModelError, match=r"^uncertain: .*mass = -.* is within the limits"):
        mv.library.quarter_car().linearize().uncertain({"body.mass": (-100.0, 1000.0)})
    with pytest.raises(mv.ModelError, match=r"^uncertain: 'system' was made of matrices"):
        mv.System.from_matrices([[1.0]], None, [[1.0]]).uncertain({"k": 0.1})


@pytest.mark.slow
def test_a_free_body_that_nothing_shows_changes_no_bound():
    def bounds(free):
        model = mv.Model("m")
        model.add_body("a", 2.0, (1, 1, 1))
        model.add_joint("r", "prismatic", "ground", "a", axis=(1, 0, 0))
        model.add_spring("k", "ground", "a", (-1, 0, 0), (0, 0, 0), stiffness=800.0, damping=4.0)
        model.add_input("F", "a", "x")
        model.add_output("x", "a", "x")
        if free:
            model.add_body("f", 1.0, (1, 1, 1), position=(0, 3, 0))
            model.add_joint("q", "prismatic", "ground", "f", axis=(1, 0, 0))
        plant = model.linearize().uncertain({"k.stiffness": 0.2})
        gain, rms = plant.worst_gain("x", "F"), plant.worst_rms("x", {"F": 1.0})
        return plant.robust_stability().upper, gain.lower, gain.upper, rms.lower["x"], rms.upper["x"]

    found = bounds(True)
    # the softest spring: 1 / (c w_d) at 640 N/m
    assert found[1] == pytest.approx(1.0 / (4.0 * np.sqrt(640.0 / 2.0 - 1.0)), rel=1e-9)
    np.testing.assert_allclose(found, bounds(False), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [False, True])
def test_loops_are_those_of_the_plant_at_other_values(noise):
    """Closed one after the other, with the noise of the first controller."""
    plant = two_masses().linearize().uncertain({"k2.stiffness": 0.4, "m2.mass": (0.7, 1.5), "k1.damping": 0.3})
    loop = plant.feedback([[-0.4]], ["v2"], ["F1"], "first", noise)
    law = mv.StateSpace.from_arrays([[-30.0]], [[1.0]], [[-500.0]], [[-20.0]], ["v2"], ["F2"])
    both = loop.feedback(law)
    with pytest.raises(mv.ResponseError, match="give noise=True with its first controller"):
        loop.feedback(law, noise=True)
    assert loop.inputs == ("F1", "F2", *(("v2.noise", "F1.noise") if noise else ()))
    assert loop.outputs == ("x1", "x2", "v2")
    assert "first" in loop.name
    w = np.array([3.0, 19.0, 40.0])
    for delta in ([0.3, -0.8, 0.5], [-1.0, 1.2, -0.4]):
        values = values_at(plant, delta)
        for closed_plant in (loop, both):
            there = closed_plant.at(values)
            np.testing.assert_allclose(closed(closed_plant, delta).frequency_response(w), there.frequency_response(w),
                                       rtol=1e-8)  # fmt: skip
        by_hand = plant.at(values).feedback([[-0.4]], ["v2"], ["F1"], noise=noise)
        np.testing.assert_allclose(loop.at(values).frequency_response(w), by_hand.frequency_response(w), rtol=1e-12)


@pytest.mark.slow
def test_bounds_of_the_worst_gain_come_as_near_as_asked(monkeypatch):
    """Of bounds that hold from 1.0012 of the gain that is reached on, one is halfway nearer than the first that holds.
    """
    plant = oscillator().linearize().uncertain({"s.damping": (2.0, 5.0)})
    reached = plant.worst_gain("x", "F").lower
    proof = SimpleNamespace(unit=1.0, holds=lambda _limits, _starts, g: g >= 1.0012 * reached)
    monkeypatch.setattr(certain, "_proof", lambda *_: proof)
    assert 1.0012 <= plant.worst_gain("x", "F").upper / reached < 1.003


@pytest.mark.slow
def test_worst_gain_of_more_outputs_than_inputs():
    """(1 + w^2) / ((k - m w^2)^2 + c^2 w^2) of displacement and velocity, highest with the weakest damper."""
    worst = oscillator().linearize().uncertain({"s.damping": (2.0, 5.0)}).worst_gain(["x", "v"], "F")
    w = np.linspace(19.9, 20.1, 100_001)
    highest = np.sqrt(((1.0 + w * w) / ((K - M * w * w) ** 2 + 4.0 * w * w)).max())
    assert worst.lower == pytest.approx(highest, rel=1e-7)
    assert worst.lower <= worst.upper < 1.005 * worst.lower
