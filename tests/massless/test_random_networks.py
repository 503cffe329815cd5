"""Random networks in space against the equations before any condensation, in 50 digits."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support import fast_digits

DIGITS = 50


def network(seed, light=0.0):
    """Bodies that a net of springs holds; some without mass, of which dampers touch some and others not."""
    rng = np.random.default_rng(seed)
    model = mv.Model("net")
    masses = {"a": 1.3, "b": 0.7, "n": light, "o": light, "p": light}
    location = {name: rng.uniform(-1, 1, size=3) for name in masses} | {"ground": np.zeros(3)}
    for name, mass in masses.items():
        inertia = 0.1 * mass * (1.0 + rng.uniform(0, 0.5, size=3))
        model.add_body(name, mass, inertia, position=location[name])
        free = ("x", "y", "z", "rx") if name == "a" else ("x", "y", "z") if mass else ("x", "y")
        before = "a" if name in ("n", "b") else "ground"
        free = ("x", "y") if name in ("n", "o", "p") else free
        model.add_joint(f"{name}.j", None, before, name, position=location[name], free=free,
                        orientation=rng.uniform(-1, 1, size=3))  # fmt: skip
    links = (("ground", "a"), ("ground", "a"), ("ground", "a"), ("ground", "a"), ("ground", "b"), ("b", "n"),
             ("a", "o"), ("o", "n"), ("n", "a"), ("o", "b"), ("ground", "o"), ("a", "b"), ("b", "a"), ("a", "p"),
             ("b", "p"), ("ground", "p"))  # fmt: skip
    for i, (first, second) in enumerate(links):
        ends = [location[name] + 0.2 * rng.uniform(-1, 1, size=3) for name in (first, second)]
        damped = i in (0, 4) or "n" in (first, second)
        model.add_spring(f"s{i}", first, second, *ends, stiffness=10.0 ** rng.uniform(-1, 2),
                         damping=rng.uniform(0.1, 1.0) if damped else 0.0)  # fmt: skip
    model.add_input("F", "a", "x")
    model.add_input("G", "p", rng.uniform(-1, 1, size=3))
    for name in masses:
        model.add_output(f"x{name}", name, rng.uniform(-1, 1, size=3))
    model.add_output("v", "b", "y", quantity="velocity")
    model.add_output("w", "n", "y", quantity="velocity")
    model.add_output("acc", "a", "z", quantity="acceleration")
    return model


def descriptor(seed):
    """M, C, K of the whole network in mpmath, with the masses zeroed that are none."""
    system = network(seed, light=1.0).linearize()
    number = {name: i for i, name in enumerate(system.bodies)}
    w = system.inertia_factor.copy()
    for name in ("n", "o", "p"):
        w[6 * number[name] : 6 * number[name] + 6] = 0.0
    w, d = mpmath.matrix(w.tolist()), mpmath.matrix(system.elastic_rows.tolist())
    k, c = (mpmath.diag(list(map(mpmath.mpf, values))) for values in (system.row_stiffness, system.row_damping))
    return system, w.T * w, d.T * c * d, d.T * k * d


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(3))
def test_eigenvalues_of_the_descriptor_pencil(seed):
    system = network(seed).linearize()
    assert (system.dof, system.massless) == (10, 3)
    with mpmath.workdps(DIGITS):
        full, mass, damping, stiffness = descriptor(seed)
        m = full.dof
        pencil = mpmath.zeros(2 * m)
        # eigenvalues 1 / lambda of K^-1 [[-C, -M], [K, 0]]
        flexibility = fast_digits.inverse(stiffness)
        pencil[:m, :m], pencil[:m, m:] = -flexibility * damping, -flexibility * mass
        pencil[m:, :m] = mpmath.eye(m)
        result = fast_digits.eigenvalues(pencil)
        expected = np.array([complex(1 / mu) for mu in result if abs(mu) > mpmath.mpf(10) ** (-DIGITS // 4)])
    poles = system.poles()
    assert len(poles) == len(expected) == 2 * system.dof - system.massless
    for pole in poles:
        assert np.abs(expected - pole).min() <= 1e-12 * abs(pole)
    for value in expected:
        assert np.abs(poles - value).min() <= 1e-12 * abs(value)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_responses_of_the_descriptor_equations(seed):
    system = network(seed).linearize()
    space = system.state_space()
    assert len(space.states) == 2 * system.dof - system.massless
    omega = np.array([0.3, 2.0, 17.0])
    result = system.frequency_response(omega)
    with mpmath.workdps(DIGITS):
        full, mass, damping, stiffness = descriptor(seed)
        b, cq, cv, ca = (mpmath.matrix(a.tolist()) for a in (full.B, full.Cq, full.Cv, full.Ca))
        for i, w in enumerate(omega.tolist()):
            s = mpmath.mpc(0, w)
            answer = (cq + s * cv + s * s * ca) * mpmath.inverse(stiffness + s * damping + s * s * mass) * b
            expected = np.array(answer.tolist(), dtype=complex)
            size = np.abs(expected).max()
            assert_allclose(result[:, :, i], expected, rtol=1e-10, atol=1e-12 * size)
            states = space.C @ np.linalg.solve(1j * w * np.eye(len(space.A)) - space.A, space.B) + space.D
            assert_allclose(states, expected, rtol=1e-9, atol=1e-11 * size)


def test_small_masses_come_near_in_proportion():
    """Eigenvalues of the network with light nodes go to those without, as their mass goes to zero."""
    limit = network(1).linearize().poles()
    off = []
    for light in (1e-9, 1e-10):
        poles = network(1, light).linearize().poles()
        off.append(max(np.abs(poles - pole).min() / abs(pole) for pole in limit))
    assert off[0] < 1e-2
    assert off[1] / off[0] == pytest.approx(0.1, rel=0.1)
