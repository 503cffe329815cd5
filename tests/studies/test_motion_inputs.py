"""Studies of models with motion inputs: the quarter car on a road, against its matrices by hand."""

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

import mbsvib as mv
from mbsvib import isolation, studies

BODY, WHEEL, STRUT, TYRE, DAMPER, RUBBER = 300.0, 40.0, 2e4, 2e5, 1500.0, 100.0


def car(quantity="velocity"):
    model = mv.Model("car")
    for name, mass, z in (("body", BODY, 0.6), ("wheel", WHEEL, 0.3)):
        model.add_body(name, mass, (1, 1, 1), position=(0, 0, z))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name, (0, 0, z), axis=(0, 0, 1))
    model.add_spring("strut", "wheel", "body", (0, 0, 0.3), (0, 0, 0.6), STRUT, DAMPER)
    model.add_spring("tyre", "ground", "wheel", (0, 0, 0), (0, 0, 0.3), TYRE, RUBBER)
    model.add_motion_input("road", "tyre", quantity=quantity)
    model.add_input("push", "body", "z")
    model.add_output("az", "body", "z", quantity="acceleration")
    return model


def rms(damper, level):
    """Root mean square of the body's acceleration under white velocity of the road, (Lyapunov, states by hand)."""
    m, k = np.diag([BODY, WHEEL]), np.array([[STRUT, -STRUT], [-STRUT, STRUT + TYRE]])
    c = np.array([[damper, -damper], [-damper, damper + RUBBER]])
    a = np.zeros((5, 5))  # body, wheel, their rates, road
    a[:2, 2:4] = np.eye(2)
    a[2:4, :2], a[2:4, 2:4] = -np.linalg.solve(m, k), -np.linalg.solve(m, c)
    a[2:4, 4] = np.linalg.solve(m, [0.0, TYRE])
    b = np.concatenate((np.zeros(2), np.linalg.solve(m, [0.0, RUBBER]), [1.0]))
    # only deflections move: z - road, so that the integrator of the road leaves the states
    t = np.array([[1, 0, 0, 0, -1], [0, 1, 0, 0, -1], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0]], dtype=float)
    inverse = np.concatenate((np.eye(4), np.zeros((1, 4))))
    reduced, column = t @ a @ inverse, t @ b
    p = scipy.linalg.solve_continuous_lyapunov(reduced, -0.5 * level * np.outer(column, column))
    return float(np.sqrt(reduced[2] @ p @ reduced[2]))


def test_quantities_of_studies_see_the_motion():
    floor = {"road": isolation.white(1e-4)}
    sweep = mv.sweep(car(), {"strut.damping": [800.0, 1500.0, 3000.0]}, studies.rms("az", floor))
    (values,) = sweep.results.values()
    np.testing.assert_allclose(np.ravel(values), [rms(d, 1e-4) for d in (800.0, 1500.0, 3000.0)], rtol=1e-9)
    plain = mv.sweep(car(), {"strut.damping": [800.0]}, studies.rms("az", floor), plant=lambda one: one.state_space())
    assert np.ravel(next(iter(plain.results.values())))[0] == pytest.approx(rms(800.0, 1e-4), rel=1e-9)


@pytest.mark.slow
def test_the_best_damper_is_that_of_a_scalar_search():
    found = mv.optimize(car(), {"strut.damping": (200.0, 6000.0)}, studies.rms("az", {"road": isolation.white(1e-4)}))
    exact = scipy.optimize.minimize_scalar(lambda d: rms(d, 1e-4), bounds=(200.0, 6000.0), method="bounded",
                                           options={"xatol": 1e-3})  # fmt: skip
    assert found.success
    assert found.values["strut.damping"] == pytest.approx(exact.x, rel=1e-4)
    assert found.objective == pytest.approx(exact.fun, rel=1e-9)


def test_a_loop_around_the_car_takes_the_motion_too():
    """Skyhook: a force against the speed of the body, from the integrated accelerometer."""
    model = car()
    model.add_output("v", "body", "z", quantity="velocity")
    close = lambda one, gain=0.0: one.feedback([[-gain]], "v", "push")  # noqa: E731
    sweep = mv.sweep(model, {"gain": [0.0, 2000.0]}, studies.peak("az", "road"), plant=close)
    plain, calm = np.ravel(next(iter(sweep.results.values())))
    assert plain == pytest.approx(np.ravel(next(iter(mv.sweep(
        model, {"strut.damping": [DAMPER]}, studies.peak("az", "road")).results.values())))[0], rel=1e-6)
    assert calm < 0.7 * plain


@pytest.mark.slow
def test_modes_and_tolerances_go_on_as_before():
    model = car("displacement")
    frequencies = mv.sweep(model, {"body.mass": [280.0, 320.0]}, "modes.frequencies")["modes.frequencies"]
    expected = [model.with_values({"body.mass": mass}).linearize().modes().frequencies for mass in (280.0, 320.0)]
    np.testing.assert_allclose(frequencies, expected, rtol=1e-12)
    off = mv.tolerances(model, {"body.mass": "5 %"}, studies.gain("az", "road", [2.0]), samples=200)
    assert off.first[0] == pytest.approx(off.std[0], rel=0.15)
