"""Derivatives of root mean squares against differences of fourth order, and closed forms."""

import numpy as np
import pytest
from scipy.linalg import expm

import mbsvib as mv
from mbsvib import isolation, library
from mbsvib.feedback.sampled_power import mean_powers, power_slopes
from mbsvib.random import slopes
from mbsvib.random.budget import random
from tests.random.scenes import oscillator, two_masses

NAMES = ["m1.mass", "k1.stiffness", "k1.damping", "k2.stiffness", "k2.damping", "k2.end.z"]
SHAPED = isolation.shaped([20.0], [1.0, 20.0])
TABLE = [(0.5, 1.0), (30.0, 0.1)]


def plain(model):
    return model.linearize()


def static(model):
    return model.linearize().feedback([[-40.0, -2.0]], ["x2", "v2"], ["F1"], noise=True)


def dynamic(model):
    law = mv.StateSpace.from_arrays([[-30.0]], [[1.0]], [[-500.0]], [[-20.0]], ["v2"], ["F2"])
    return model.linearize().feedback(law, noise=True)


def sampled(model):
    return dynamic(model).sampled(40.0, 5e-3)


def sampled_late(model):
    return static(model).sampled(100.0, 0.013)


def difference(value, at, step):
    low2, low, high, high2 = (value(at + k * step) for k in (-2.0, -1.0, 1.0, 2.0))
    return (low2 - 8.0 * low + 8.0 * high - high2) / (12.0 * step)


@pytest.mark.slow
@pytest.mark.parametrize(("plant", "noise", "settings"), [
    (plain, {"F1": 1.0, "F2": SHAPED}, {}),
    (plain, {"F1": TABLE}, {}),
    (plain, {"F1": 1.0}, {"band": (0.5, 20.0)}),
    (plain, {"F1": 1.0, "F2": 4.0}, {"correlation": [[1.0, 0.6], [0.6, 1.0]]}),
    (plain, {"F1": TABLE, "F2": TABLE}, {"correlation": [[1.0, 0.3 + 0.4j], [0.3 - 0.4j, 1.0]]}),
    (plain, {"F1": 1.0}, {"weighting": isolation.shaped([1.0, 0.0], [1.0, 9.0])}),
    (static, {"F2": 1.0, "x2.noise": 1e-4, "F1.noise": SHAPED}, {}),
    (dynamic, {"F1": TABLE, "v2.noise": 1e-3}, {}),
    (sampled, {"F1": SHAPED, "v2.noise": SHAPED}, {"weighting": isolation.shaped([1.0, 0.0], [1.0, 9.0])}),
    (sampled_late, {"F1": 1.0, "x2.noise": 1e-4, "F1.noise": SHAPED}, {}),
    (sampled_late, {"F1": SHAPED, "F2": SHAPED}, {"correlation": [[1.0, -0.6], [-0.6, 1.0]]}),
    (sampled, {"F1": TABLE, "v2.noise": TABLE, "F2": 1.0}, {"weighting": isolation.shaped([1.0, 0.0], [1.0, 9.0])}),
    (sampled_late, {"F1": TABLE, "F2": TABLE}, {"correlation": [[1.0, 0.3 + 0.4j], [0.3 - 0.4j, 1.0]]}),
    (dynamic, {"F1": lambda f: 1.0 / (1.0 + f), "F2.noise": 0.1}, {"weighting": lambda f: 1.0 / (1.0 + 0.1j * f)}),
])  # fmt: skip
def test_derivatives_to_parameters(plant, noise, settings):
    model = two_masses()
    exact = plant(model).budget(noise, ["x1", "v2"], **settings).sensitivities(NAMES)
    for name in NAMES:
        start = model.parameters[name]

        def rms(value, name=name):
            changed = plant(model.with_values({name: value})).rms(["x1", "v2"], noise, **settings)
            return np.array(list(changed.values()))

        expected = difference(rms, start, 2e-3 * abs(start))
        got = [exact[output][name] for output in ("x1", "v2")]
        np.testing.assert_allclose(got, expected, rtol=2e-7, atol=1e-9 * abs(rms(start) / start).max())


def test_closed_form():
    """rms = sqrt(S / 4 c k): its derivatives are -rms / 2 c, -rms / 2 k and 0."""
    system = oscillator().linearize()
    budget = system.budget({"F": 1.0}, "x")
    found, rms = budget.sensitivities(["s.stiffness", "s.damping", "b.mass"])["x"], budget.rms["x"]
    np.testing.assert_allclose(list(found.values()), [-rms / 1600.0, -rms / 6.0, 0.0], rtol=1e-12, atol=1e-16)


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "closing"), [
    ({"F1": 1.0, "v2.noise": 1e-2}, lambda loop: loop), ({"F1": TABLE, "v2.noise": 1e-2}, lambda loop: loop),
    ({"F1": 1.0, "v2.noise": 1e-2}, lambda loop: loop.sampled(40.0, 5e-3)),
    ({"F1": TABLE, "v2.noise": TABLE}, lambda loop: loop.sampled(40.0, 5e-3)),
])  # fmt: skip
def test_derivatives_to_the_controller(noise, closing):
    model = two_masses()
    loop = closing(dynamic(model))
    exact = loop.budget(noise, ["x1", "v2"]).controller_sensitivities()
    for key in "ABCD":
        start = getattr(loop.law, key)[0, 0]

        def rms(value, key=key):
            entries = {part: getattr(loop.law, part) for part in "ABCD"} | {key: [[value]]}
            law = mv.StateSpace.from_arrays(*(entries[part] for part in "ABCD"), ["v2"], ["F2"])
            changed = closing(model.linearize().feedback(law, noise=True)).rms(["x1", "v2"], noise)
            return np.array(list(changed.values()))

        got = [exact[output][key][0, 0] for output in ("x1", "v2")]
        np.testing.assert_allclose(got, difference(rms, start, 1e-3 * abs(start)), rtol=1e-7)


def lifted_variance(m, c, k, gain, rate):
    """Of x under white force of density 1, with the velocity fed back: equations of a period, analytic in all."""
    h = 1.0 / rate
    a, b = np.array([[0.0, 1.0], [-k / m, -c / m]]), np.array([[0.0], [1.0 / m]])

    def over(t):
        noise = expm(np.block([[-a, 0.5 * b @ b.T], [np.zeros((2, 2)), a.T]]) * t)
        drift = expm(np.block([[a, b], [np.zeros((1, 3))]]) * t)
        return drift[:2, :2] + drift[:2, 2:] @ np.array([[0.0, gain]]), noise[2:, 2:].T @ noise[:2, 2:]

    e, q = over(h)
    p = np.linalg.solve(np.eye(4) - np.kron(e, e), q.reshape(4)).reshape(2, 2)
    result = 0.0
    for x, weight in zip(*np.polynomial.legendre.leggauss(8), strict=True):
        phi, more = over(0.5 * h * (x + 1.0))
        result = result + 0.5 * weight * (phi @ p @ phi.T + more)[0, 0]
    return result


def test_sampled_loops_against_complex_steps():
    """rms' = Im rms(p + i h p) / (h p) of equations of a period that are written out."""
    values, loop = [2.0, 3.0, 800.0, -20.0, 60.0], oscillator().linearize().feedback([[-20.0]], ["v"], ["F"])
    budget = loop.sampled(60.0).budget({"F": 1.0}, "x")
    found = [*budget.sensitivities(["b.mass", "s.damping", "s.stiffness"])["x"].values(),
             budget.controller_sensitivities()["x"]["D"][0, 0]]  # fmt: skip
    for which, slope in enumerate(found):
        step = np.array(values, dtype=complex)
        step[which] *= 1.0 + 1e-30j
        expected = np.sqrt(lifted_variance(*step)).imag / (values[which] * 1e-30)
        np.testing.assert_allclose(slope, expected, rtol=1e-10)


@pytest.mark.slow
def test_sampled_loops_with_an_integrator_that_is_not_seen():
    """A PI controller of a velocity drifts with what is sampled, and holds the mass elsewhere: its velocity decays."""
    def at(stiffness):
        law = mv.StateSpace.from_arrays([[0.0]], [[1.0]], [[-90.0]], [[-8.0]], ["v"], ["F"])
        return oscillator(k=stiffness).linearize().feedback(law).sampled(60.0, 0.02).budget({"F2": 1.0}, ["x", "v"])

    budget = at(800.0)
    found = budget.sensitivities("s.stiffness")
    assert budget.rms["x"] == np.inf
    assert np.isnan(found["x"]["s.stiffness"])
    slope = difference(lambda k: at(k).rms["v"], 800.0, 1.0)
    np.testing.assert_allclose(found["v"]["s.stiffness"], slope, rtol=1e-8, equal_nan=False)


def test_powers_of_single_frequencies():
    """Along all entries of a plant with feedthrough and of its controller, in a loop that acts late."""
    rng, w = np.random.default_rng(3), np.array([3.0, 70.0])
    plant = [rng.normal(size=shape) for shape in ((4, 4), (4, 3), (3, 4), (3, 3))]
    plant[0] -= 4.0 * np.eye(4)
    law = [np.diag([-5.0, -30.0]), *[0.7 * rng.normal(size=(2, 2)) for _ in range(3)]]
    ways = [[rng.normal(size=part.shape) for part in parts] for parts in (plant, law)]
    amplitudes = rng.normal(size=(2, 2, 3)) + 1j * rng.normal(size=(2, 2, 3))

    def loop(of_plant, of_law):
        moved = [[part + share * way for part, way in zip(parts, own, strict=True)]
                 for share, parts, own in zip((of_plant, of_law), (plant, law), ways, strict=True)]  # fmt: skip
        space = mv.StateSpace.from_arrays(*moved[0], ["d", "a", "b"], ["y", "z", "r"])
        k = mv.StateSpace.from_arrays(*moved[1], ["z", "r"], ["a", "b"])
        return space.feedback(k).sampled(30.0, 0.05).with_ports("y", ["d", "a"])

    def power(*shares):
        return float((mean_powers(loop(*shares), w, amplitudes).sum(axis=(0, 1)) * [1.0, 4.0]).sum())

    found = power_slopes(loop(0.0, 0.0), w, amplitudes, np.array([1.0, 4.0]))
    for entries, own, at in zip(found, ways, (lambda s: power(s, 0.0), lambda s: power(0.0, s)), strict=True):
        along = (entries * np.block([[own[0], own[1]], [own[2], own[3]]])).sum()
        np.testing.assert_allclose(along, difference(at, 0.0, 1e-3), rtol=1e-8)


def test_several_sensors_and_actuators():
    """All 6 x 6 gains of a platform: the sum of entries times a direction is the slope along it."""
    system = library.cubic_hexapod().linearize()
    gains = -1e3 * np.eye(6)
    noise = {"Fz": 1.0, "z.noise": 1e-14, "Mx.noise": 1e-3}

    def loop(k):
        return system.feedback(k, list(system.outputs), list(system.inputs), noise=True)

    exact = loop(gains).budget(noise, ["z", "rx"]).controller_sensitivities()
    direction = np.random.default_rng(1).normal(size=(6, 6)) * 1e3

    def rms(share):
        return np.array(list(loop(gains + share * direction).rms(["z", "rx"], noise).values()))

    got = [(exact[name]["D"] * direction).sum() for name in ("z", "rx")]
    np.testing.assert_allclose(got, difference(rms, 0.0, 1e-2), rtol=1e-6)


def test_changes_that_make_it_infinite():
    """Noise drives a mass that nothing holds along another direction: a tilted spring would let it drift."""
    model = mv.Model("plane")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", None, "ground", "b", (0, 0, 0), free=("x", "z"))
    model.add_spring("s", "ground", "b", (0, 0, -1), (0, 0, 0), stiffness=100.0, damping=2.0)
    model.add_input("F", "b", "z")
    model.add_output("z", "b", "z")
    budget = model.linearize().budget({"F": 1.0})
    found = budget.sensitivities(["s.stiffness", "s.start.x"])["z"]
    np.testing.assert_allclose(found["s.stiffness"], -budget.rms["z"] / 200.0, rtol=1e-12)
    assert found["s.start.x"] == np.inf


def test_refusals():
    with pytest.raises(mv.ModelError, match="has matrices and no parameters"):
        plain(two_masses()).state_space().budget({"F1": 1.0}).sensitivities()
    driven = mv.Model("driven")
    driven.add_body("b", 1.0, (1, 1, 1))
    driven.add_joint("j", "prismatic", "ground", "b", (0, 0, 0), axis=(0, 0, 1))
    driven.add_spring("s", "ground", "b", (0, 0, -1), (0, 0, 0), 100.0, 2.0)
    driven.add_motion_input("u", "s")
    driven.add_input("F", "b", "z")
    driven.add_output("z", "b", "z")
    with pytest.raises(mv.ModelError, match="'driven' has motions as inputs"):
        driven.linearize().budget({"F": 1.0}).sensitivities()
    with pytest.raises(mv.ResponseError, match="has no controller"):
        plain(two_masses()).budget({"F1": 1.0}).controller_sensitivities()
    with pytest.raises(mv.ResponseError, match="averages over a time"):
        plain(two_masses()).budget({"F1": 1.0}, weighting=isolation.moving_average(1.0)).sensitivities()
    with pytest.raises(mv.ModelError, match="no parameter 'k9"):
        plain(two_masses()).budget({"F1": 1.0}).sensitivities("k9.stiffness")
    blind = oscillator().linearize().budget({"F": 0.0, "F2": 0.0}, ["x", "v"])
    assert all(np.isnan(value) for parts in blind.sensitivities("s.*").values() for value in parts.values())
    undamped = two_masses(c1=0.0, c2=0.0).linearize().budget({"F1": 1.0}, "x1").sensitivities("k1.stiffness")
    assert np.isnan(undamped["x1"]["k1.stiffness"])


@pytest.mark.slow
@pytest.mark.parametrize("plant", [plain, static, dynamic])
def test_derivatives_of_equations_are_those_of_responses(plant):
    """[C R 1] dX [R B; 1] along parameters and, of loops, along the controller."""
    model, s, names = two_masses(), 5j, ["k1.stiffness", "k2.damping", "m1.mass"]
    scene = slopes.Scene(plant(model))
    a, b, c, d = scene.equations
    r = np.linalg.inv(s * np.eye(len(a)) - a)
    left, right = np.hstack((c @ r, np.eye(len(c)))), np.vstack((r @ b, np.eye(b.shape[1])))
    np.testing.assert_allclose(c @ r @ b + d, plant(model).frequency_response([5.0])[:, :, 0], rtol=1e-9)
    found = scene.along(scene.system.matrix_derivatives(names))
    for k, name in enumerate(names):
        start = model.parameters[name]

        def response(value, name=name):
            return plant(model.with_values({name: value})).frequency_response([5.0])[:, :, 0]

        expected = difference(response, start, 1e-3 * start)
        np.testing.assert_allclose(left @ found[k] @ right, expected, atol=1e-8 * np.abs(expected).max())
    if scene.closure is not None:
        shape = scene.closure.to_law(np.zeros((len(a) + len(c), len(a) + b.shape[1]))).shape
        change = np.random.default_rng(0).normal(size=(1, *shape))
        both = scene.along(scene.system.matrix_derivatives(names[:1]), change)
        alone = scene.along(None, change)
        np.testing.assert_allclose(both, alone + found[:1], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("weighting", [None, isolation.shaped([1.0, 0.0], [1.0, 9.0])])
@pytest.mark.parametrize(("noise", "correlation"), [({"F1": 1.0, "F2": SHAPED}, None),
                                                    ({"F1": 1.0, "F2": 4.0}, [[1.0, 0.6], [0.6, 1.0]])])  # fmt: skip
def test_squares_of_stable_equations_are_the_sum_of_all(noise, correlation, weighting):
    """A way of its own for searches, without the separation of what lasts."""
    under = random(two_masses().linearize(), noise, ["x1", "v2"], None, correlation, weighting)
    value, slope = slopes.stable_squares(under, under.plant)
    np.testing.assert_allclose(value, under.mean_squares().total.sum(), rtol=1e-11)
    expected = sum(slopes.gradient(under, under.plant, row) for row in range(2))
    np.testing.assert_allclose(slope(), expected, rtol=1e-8, atol=1e-12 * np.abs(expected).max())
    through = random(oscillator().linearize(), {"F": 1.0}, ["x", "a"], None, None, None)
    value, slope = slopes.stable_squares(through, through.plant)
    assert (value, slope().shape) == (np.inf, (4, 3))
    assert not slope().any()


def test_squares_of_stable_equations_keep_digits_in_any_unit():
    """A resonator of 5 MHz: x^2 = S / (4 c k), whose rate is 1e15 times as large in the square."""
    m, c, k, force = 2e-12, 2e-9, 2e3, 1e-24
    system = mv.System.from_matrices([[m]], [[c]], [[k]], B=[[1.0]], Cq=[[1.0]], inputs=["F"], outputs=["x"])
    under = random(system, {"F": force}, None, None, None, None)
    one = under.plant._replace(a=np.array([[0.0, 1.0], [-k / m, -c / m]]), b=np.array([[0.0], [1.0 / m]]),
                               c=np.array([[1.0, 0.0]]), d=np.zeros((1, 1)))  # fmt: skip
    value, slope = slopes.stable_squares(under, one)
    square = force / (4.0 * c * k)
    to_a, to_b = slope()[:2, :2], slope()[1, 2]
    np.testing.assert_allclose([value, to_b / m], [square, 2.0 * square], rtol=1e-12)
    np.testing.assert_allclose([to_a[1, 0] * k / m, to_a[1, 1] * c / m], [square, square], rtol=1e-12)
