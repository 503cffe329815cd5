"""Responses without symmetry against 60 digits: frequency and time responses, zeros, grids and modal states."""

from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import mbsvib as mv
from mbsvib.errors import ResponseError
from mbsvib.responses.general_responses import solved, trusted
from tests.modes.test_general import FAMILIES
from tests.support import fast_digits
from tests.support import unsymmetric as reference
from tests.support.sizes import few
from tests.support.unsymmetric import chain, massless, unsymmetric

CHOSEN = [name for name in FAMILIES if name not in ("flutter", "massless and spin")]


@pytest.mark.few(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_frequency_response(family):
    system = FAMILIES[family](0)
    speeds = np.abs(system.poles())
    low, high = speeds[speeds > 0.0].min(), speeds.max()
    omega = np.concatenate((np.geomspace(0.01, 9.0, 6) * low, [0.97 * high, 3.0 * high]))
    exact = reference.frequency_response(system, omega)
    error = np.abs(system.frequency_response(omega) - exact) / np.abs(exact)
    assert error.max() <= 1e-11
    direct = solved(system, system.basis.modal.state, 1j * omega)
    assert (np.abs(direct - exact) <= 1e-9 * np.abs(exact)).all()


@pytest.mark.few(2)
@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("family", CHOSEN)
def test_time_response(family, hold):
    system = FAMILIES[family](0)
    speeds = np.abs(system.poles())
    t = np.linspace(0.0, 20.0 / np.median(speeds[speeds > 0.0]), 30)
    rng = np.random.default_rng(0)
    u, initial = rng.normal(size=(2, 30)), rng.normal(size=(2, system.dof))
    exact = reference.time_response(system, t, u, hold, initial)
    error = np.abs(system.time_response(t, u, hold, initial) - exact) / np.abs(exact).max(axis=1, keepdims=True)
    assert error.max() <= 1e-10


@pytest.mark.parametrize("beyond", [0.1, 1e-5, 1e-9, 1e-13])
def test_time_response_where_spin_just_stabilises(beyond):
    """Undamped modes that all but meet: their poles, where no response is a number, are no place to look at sums."""
    base = chain(2, 0, damp=0.0)
    factor, spin = np.zeros_like(base.inertia_factor[:2]), (4.0 + beyond) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    factor[:, :] = np.eye(2)
    system = replace(base, inertia_factor=factor, M=np.eye(2), elastic_rows=np.eye(2), row_stiffness=np.full(2, -4.0),
                     row_damping=np.zeros(2), K=-4.0 * np.eye(2), C=spin, gyroscopic=spin,
                     row_owner=np.zeros(2, dtype=int))  # fmt: skip
    t, u, initial = np.linspace(0.0, 5.0, 11), np.ones((2, 11)), np.array([[1.0, -0.5], [0.3, 0.2]])
    exact = reference.time_response(system, t, u, "zero", initial)
    error = np.abs(system.time_response(t, u, "zero", initial) - exact) / np.abs(exact).max(axis=1, keepdims=True)
    assert error.max() <= 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("pairs", few([((0, 1), (1, 0)), ((0, 0), (1, 1))], 1), ids=["across", "own"])
@pytest.mark.parametrize("family", ["spin and dampers", "spin", "all", "follower loads", "free", "massless ones",
                                    "massless and all"])  # fmt: skip
def test_zeros(family, pairs):
    system = FAMILIES[family](1)
    for output, source in pairs:
        result = system.transmission_zeros(system.outputs[output], system.inputs[source]).tolist()
        exact = reference.zeros(system, output, source)
        assert len(result) == len(exact)
        for zero in result:
            near = exact.pop(min(range(len(exact)), key=lambda i: abs(exact[i] - zero)))
            assert abs(near - zero) <= 1e-9 * max(abs(near), 1e-6)


def test_undamped_spin_at_a_pole():
    system = unsymmetric(chain(4, 0, damp=0.0), 1.0)
    pole = float(system.poles()[2].imag)
    with pytest.raises(ResponseError, match="omega\\[1\\]"):
        system.frequency_response([1.0, pole])
    grid = system.frequency_grid("x", "F0")
    assert np.isfinite(system.frequency_response(grid)).all()


def test_accelerations_of_massless_motions_are_refused():
    """q'' of a motion that dampers hold follows the derivative of a force on it; its velocity follows the force."""
    system = massless(chain(6, 0, damp=3.0), [0])
    with pytest.raises(ResponseError, match=r"output 'a'.*'F0'.*mass"):
        system.time_response([0.0, 1.0], np.zeros((2, 2)))
    proper = replace(system, Ca=0.0 * system.Ca)
    t = np.linspace(0.0, 1.0, 5)
    u = np.ones((2, 5))
    exact = reference.time_response(proper, t, u, "zero", np.zeros((2, 6)))
    assert exact[1, 0] != 0.0  # at once
    np.testing.assert_allclose(proper.time_response(t, u, "zero"), exact, rtol=1e-11, atol=1e-14)


@pytest.mark.slow
def test_nearly_defective():
    """Two oscillators coupled by spin and circulation so that pairs all but meet: the equations are solved."""
    base = chain(2, 0, damp=0.0)
    w = np.eye(2)
    for off in (1e-13, 1e-7, 1e-3):
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
        k = np.array([1.0, 3.0])  # flutter begins where the circulatory part is half of the difference
        part = (1.0 + off) * turn
        spring = np.array([[1.0, 0.0], [0.0, 3.0]])
        system = replace(base, inertia_factor=w, M=w, elastic_rows=w, row_stiffness=k, row_damping=np.full(2, 0.02),
                         C=0.02 * w, K=spring + part, circulatory=part, row_owner=np.zeros(2, dtype=int))  # fmt: skip
        omega = np.linspace(0.1, 3.0, 30)
        exact = reference.frequency_response(system, omega)
        np.testing.assert_allclose(system.frequency_response(omega), exact, rtol=1e-11)
        trusted(system.basis.modal, np.eye(2), omega)
        t = np.linspace(0.0, 20.0, 40)
        u = np.cos(np.arange(80.0)).reshape(2, 40)
        exact = reference.time_response(system, t, u, "first", np.zeros((2, 2)))
        result = system.time_response(t, u)
        assert (np.abs(result - exact).max(axis=1) <= 1e-11 * np.abs(exact).max(axis=1)).all()
        errors = system.modes().errors
        mean = (k[0] + k[1]) / 2.0
        split = np.sqrt(complex(((k[1] - k[0]) / 2.0) ** 2 - (1.0 + off) ** 2))
        for square in (mean + split, mean - split):
            true = np.roots([1.0, 0.02, square])
            near = np.abs(system.poles()[:, None] - true).min(axis=0)
            assert (near <= 2.0 * max(1e-8 if off < 1e-10 else 1e-12, errors.max()) * np.abs(true)).all()


def test_modal_states():
    """The modal realization has the same transfer function."""
    for family in ("spin and dampers", "all", "free", "massless ones", "massless and all", "massless and free"):
        system = FAMILIES[family](2)
        space = system.state_space("modal")
        omega = np.array([0.3, 2.0, 30.0])
        exact = reference.frequency_response(system, omega)
        for i, w in enumerate(omega):
            g = space.C @ np.linalg.solve(1j * w * np.eye(len(space.A)) - space.A, space.B) + space.D
            assert (np.abs(g - exact[:, :, i]) <= 1e-9 * np.abs(exact[:, :, i])).all()


def test_thrust_that_turns_along():
    """A rocket: its sideways acceleration follows its angle, so that four integrators stand one behind the other."""
    model = mv.Model("rocket")
    model.add_body("stage", 100.0, (30.0, 30.0, 2.0))
    model.add_input("M", "stage", "ry")
    model.add_output("x", "stage", "x")
    model.add_output("w", "stage", "ry", quantity="velocity")
    base = model.linearize()
    thrust, motion = 300.0, base.body_motion[0]
    push = -motion[:3].T @ np.array([[0, thrust, 0], [-thrust, 0, 0], [0, 0, 0]]) @ motion[3:]
    values, rows = np.linalg.eigh(0.5 * (push + push.T))
    used = np.abs(values) > 1.0
    system = replace(base, K=push, circulatory=0.5 * (push - push.T), elastic_rows=rows[:, used].T.copy(),
                     row_stiffness=values[used], row_damping=np.zeros(4), row_owner=np.zeros(4, dtype=int))  # fmt: skip
    modes = system.modes()
    np.testing.assert_array_equal(modes.eigenvalues, np.zeros(12))
    assert np.isfinite(modes.shapes).all()
    assert np.linalg.matrix_rank(modes.shapes) == 6
    gain, w, t = thrust / 100.0 / 30.0, np.array([0.1, 3.0, 200.0]), np.linspace(0.0, 2.0, 9)
    np.testing.assert_allclose(system.frequency_response(w)[0, 0], gain / w**4, rtol=1e-10)
    np.testing.assert_allclose(system.time_response(t, np.ones(9)), [gain * t**4 / 24.0, t / 30.0], rtol=1e-12)
    space = system.state_space("modal")
    for point in (0.1, 3.0):
        g = space.C @ np.linalg.solve(1j * point * np.eye(12) - space.A, space.B) + space.D
        np.testing.assert_allclose(g[:, 0], [gain / point**4, 1.0 / (30.0j * point)], rtol=1e-10)


def test_thrust_that_turns_along_beside_a_vibration():
    """A stage on rails with its thrust, and fuel on a spring: four integrators in a row, and one pair."""
    model = mv.Model("rocket")
    for name, mass in (("frame", 1.0), ("fuel", 4.0)):
        model.add_body(name, mass, (1, 1, 1), position=(0, 0, 0) if name == "frame" else (0, 1, 0))
        model.add_joint(f"rail.{name}", "prismatic", "ground", name, axis=(0, 1, 0))
    model.add_body("stage", 2.0, (3.0, 3.0, 3.0))
    model.add_joint("hinge", "revolute", "frame", "stage", (0, 0, 0), axis=(0, 0, 1))
    model.add_spring("slosh", "frame", "fuel", (0, 0, 0), (0, 1, 0), 120.0)
    model.add_load("thrust", "stage", force=(6.0, 0, 0), follower=True)
    model.add_input("M", "stage", "rz")
    model.add_output("y", "stage", "y")
    system = model.linearize()
    modes = system.modes()
    assert np.count_nonzero(modes.eigenvalues == 0.0) == 4
    np.testing.assert_allclose(modes.natural[-1], np.sqrt(120.0 * (1.0 / 3.0 + 1.0 / 4.0)), rtol=1e-13)
    w = np.array([0.1, 3.0, 200.0])
    angle, held, of_load = -1.0 / (3.0 * w**2), 120.0 - 3.0 * w**2, 120.0 - 4.0 * w**2
    np.testing.assert_allclose(system.frequency_response(w)[0, 0], 6.0 * angle * of_load / (held * of_load - 120.0**2),
                               rtol=1e-11)  # fmt: skip


def shaft_on_a_node(speed):
    """A shaft turns on a node without mass, whose own turning is damped so weakly that it comes to rest in 0.1 us."""
    axes, own = (Rotation.from_rotvec(turn).as_matrix() for turn in ((0.4, -0.7, 0.9), (1, 2, 3)))
    model, at = mv.Model("shaft"), (-0.45, -0.5, -0.9)
    model.add_body("base", 2.0, (0.3, 0.4, 0.5), position=(0.1, 0.9, 0.4))
    model.add_body("node", 0.0, (0, 0, 0), position=(0.16, 0.95, 0.57))
    model.add_body("shaft", 1.4, (0.056, 0.056, 0.025), position=at, orientation=axes)
    model.add_joint("bearing", "revolute", "node", "shaft", position=at, axis=axes[:, 2])
    model.add_bushing("feet", "ground", "base", position=(0, 0.1, 0), stiffness=(3e4, 4e4, 5e4, 300, 400, 500),
                      damping=(30, 40, 50, 0.3, 0.4, 0.5))  # fmt: skip
    model.add_bushing("tie", "base", "node", position=(0.1, 0.92, 0.55), orientation=own,
                      stiffness=(34475, 4004, 25282, 230, 38, 125), damping=(3e-3, 4e-4, 2e-3, 2e-5, 4e-6, 1e-5))
    model.add_torsion_spring("brake", "base", "shaft", axes[:, 2], stiffness=20.0, damping=0.1)
    if speed:
        model.add_rotor("spin", "shaft", axis=axes[:, 2], inertia=0.02, speed=speed)
    model.add_input("F", "shaft", (-0.3, 0.5, 2.3), position=(-0.2, -0.57, -0.95))
    model.add_base_motion("floor", "z")
    model.add_force_output("ground", "ground", (-0.99, -0.95, 1.4))
    return model


@pytest.mark.parametrize("speed", [0.0, 50.0])
def test_forces_beside_a_motion_without_mass_that_comes_to_rest_at_once(speed):
    """Sums of forces do not see its acceleration, which is 1e14 times its angle: rounding of that is no force."""
    system, omega = shaft_on_a_node(speed).linearize(), 3.3
    assert np.abs(system.poles()).max() > 1e7
    space, time, loads = system.state_space(), np.linspace(0.0, 0.5, 6), np.ones((2, 6))
    with mp.workdps(40):
        s = mp.mpc(0, omega)
        m, c, k, b, cq, cv, ca, d = (mp.matrix(getattr(system, name).tolist()) for name in
                                     ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D"))  # fmt: skip
        exact = (cq + s * cv + s * s * ca) * fast_digits.solve(k + s * c + s * s * m, b) + d
        exact = np.array(exact.tolist(), dtype=complex)
    assert_allclose(space.frequency_response([omega])[0, :, 0], exact[0], rtol=1e-9)
    assert_allclose(system.time_response(time, loads), space.time_response(time, loads), rtol=1e-7, atol=1e-12)
