"""Eigenvalues that all but merge: critical damping to 1e-14, alone and coupled, and double roots of two masses."""

import numpy as np
import pytest

import mbsvib as mv
from tests.support import fast_digits
from tests.support.digits import mp
from tests.support.exact import Exact
from tests.support.sizes import few

OFF = few([0.0, 1e-14, -1e-10, -1e-6, 1e-4, -1e-14, 1e-12, 1e-8], 5)


def critical(off, coupling, damper=0.0):
    """Three masses on springs of their own with critical damping times 1 + ``off``, and weaker links between them."""
    model = mv.Model("critical")
    for i, (m, k) in enumerate(((1.0, 100.0), (2.0, 200.0), (0.5, 450.0))):
        model.add_body(f"b{i}", m, (1, 1, 1), position=(i, 0, 0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        c = 2 * np.sqrt(k * m) * (1 + off)
        model.add_spring(f"s{i}", "ground", f"b{i}", (i - 1, 0, 0), (i, 0, 0), stiffness=k, damping=c)
        model.add_input(f"f{i}", f"b{i}", "x")
        model.add_output(f"x{i}", f"b{i}", "x")
    for i in (1, 2) if coupling else ():
        model.add_spring(f"l{i}", f"b{i - 1}", f"b{i}", (i - 1, 0, 0), (i, 0, 0), stiffness=coupling, damping=damper)
    return model


def merging(off):
    """Two masses one of which is damped so that a double complex root is all but there (exactly at ``off`` = 0)."""
    root = 1j * np.sqrt(100 + 1j)
    damper = 2 / root.imag
    stiffness = 99.0 - damper * root.real, 99.0
    model = mv.Model("merging")
    for i in (1, 2):
        model.add_body(f"b{i}", 1.0, (1, 1, 1))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        model.add_input(f"f{i}", f"b{i}", "x")
        model.add_output(f"x{i}", f"b{i}", "x")
        model.add_spring(f"k{i}", "ground", f"b{i}", (-1, 0, 0), (0, 0, 0), stiffness=stiffness[i - 1])
    model.add_spring("c", "ground", "b1", (-1, 0, 0), (0, 0, 0), damping=damper * (1 + off))
    model.add_spring("k", "b1", "b2", (0, 0, 0), (1, 0, 0), stiffness=1.0)
    return model


def scenes(off):
    return {
        "alone": critical(off, 0.0, 0.0), "links": critical(off, 3.0), "soft links": critical(off, 1e-10),
        "damped links": critical(off, 1e-6, 1e-8), "merging": merging(off),
    }  # fmt: skip


SCENES = tuple(scenes(0.0))


@pytest.mark.few(8)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("off", OFF)
def test_residuals_and_honest_errors(scene, off):
    """An eigenvalue may be off by the square root of rounding; its residual may not, and the error is promised."""
    model = scenes(off)[scene]
    system = model.linearize()
    modes = system.modes()
    for k in range(system.dof):
        value, shape = modes.eigenvalues[2 * k], modes.shapes[:, k]
        terms = [value**2 * (system.M @ shape), value * (system.C @ shape), system.K @ shape]
        assert np.linalg.norm(sum(terms)) <= 1e-13 * sum(np.linalg.norm(term) for term in terms)
    expected = list(Exact(model).eigenvalues)
    for result, promised in zip(modes.eigenvalues, modes.errors, strict=True):
        nearest = expected.pop(int(np.argmin(np.abs(np.array(expected) - result))))
        assert abs(result - nearest) <= (2 * promised + 1e-15) * abs(nearest)
        assert abs(result - nearest) <= 1e-7 * abs(nearest)


@pytest.mark.few(6)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("off", OFF)
def test_frequency_response(scene, off):
    model = scenes(off)[scene]
    omega = np.array([0.01, 3.0, 9.9, 10.0, 10.1, 30.0, 31.0, 1e3])
    result, expected = model.linearize().frequency_response(omega), Exact(model).frequency_response(omega)
    assert (np.abs(result - expected) <= 2e-12 * np.abs(expected).max(axis=(0, 1))).all()


@pytest.mark.few(2)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("off", [1e-14, -1e-6])
def test_time_response(scene, off):
    """Even and uneven steps from a state that moves, against the exponential of the state matrix in 50 digits."""
    check_time_response(scene, off, "first")


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("off", OFF)
@pytest.mark.parametrize("hold", ["zero", "first"])
def test_time_response_at_length(scene, off, hold):
    check_time_response(scene, off, hold)


def check_time_response(scene, off, hold):
    model = scenes(off)[scene]
    system = model.linearize()
    n, inputs = system.dof, len(system.inputs)
    rng = np.random.default_rng(3)
    start = rng.normal(size=(2, n))
    for time in (np.linspace(0, 0.8, 9), np.array([0.0, 1e-4, 0.01, 0.2, 0.23, 1.5])):
        u = rng.normal(size=(inputs, len(time)))
        result = system.time_response(time, u, hold=hold, initial=(start[0], start[1] * 10))
        expected = marched(model, system.coordinates, time, u, hold, (start[0], start[1] * 10))
        assert np.abs(result - expected).max() <= 1e-12 * np.abs(expected).max()


def marched(model, names, time, u, hold, initial):
    """Outputs in 50 digits: x(t + h) by the exponential of [[A, B, 0], [0, 0, 1], [0, 0, 0]] h."""
    exact = Exact(model)
    n, k = exact.dof, len(u)
    back = mp.matrix(exact.change(names))  # this reference's coordinates from the named ones
    lower = mp.matrix(exact.M)
    a = mp.zeros(2 * (n + k))
    a[:n, n : 2 * n] = mp.eye(n)
    for position, matrix in ((0, exact.K), (n, exact.C)):
        a[n : 2 * n, position : position + n] = -fast_digits.inverse(lower) * mp.matrix(matrix)
    a[n : 2 * n, 2 * n : 2 * n + k] = fast_digits.inverse(lower) * mp.matrix(exact.B)
    a[2 * n : 2 * n + k, 2 * n + k :] = mp.eye(k)
    state = [*(back * mp.matrix(list(map(float, initial[0])))), *(back * mp.matrix(list(map(float, initial[1]))))]
    show = mp.matrix(exact.Cq)
    result = [[float(v) for v in show * mp.matrix(state[:n])]]
    for i in range(len(time) - 1):
        h = mp.mpf(float(time[i + 1])) - mp.mpf(float(time[i]))
        now, then = (mp.matrix([mp.mpf(float(v)) for v in u[:, j]]) for j in (i, i + 1))
        slope = (then - now) / h if hold == "first" else now * 0
        full = mp.matrix([*state, *now, *slope])
        state = list((fast_digits.exponential(a * h) * full)[: 2 * n])
        result.append([float(v) for v in show * mp.matrix(state[:n])])
    return np.array(result).T


def test_the_reference_marches_exactly():
    """One mass, critically damped, from rest under a constant force: (1 - (1 + w t) exp(-w t)) / k."""
    model = critical(0.0, 0.0)
    time = np.array([0.0, 0.05, 0.4])
    u = np.zeros((3, 3))
    u[0] = 1.0
    system = model.linearize()
    result = marched(model, system.coordinates, time, u, "zero", (np.zeros(3), np.zeros(3)))
    expected = [float((1 - (1 + 10 * mp.mpf(t)) * mp.exp(-10 * mp.mpf(t))) / 100) for t in time]
    assert np.abs(result[0] - expected).max() <= 1e-16
