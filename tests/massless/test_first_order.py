"""First-order states: massless motions that dampers feel, with a minimal and proper state space."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.massless.scenes import along_z


def descriptor(system, s):
    """The response of the second-order equations at one s, as they stand."""
    square = system.K + s * system.C + s * s * system.M
    return (system.Cq + s * system.Cv + s * s * system.Ca) @ np.linalg.solve(square, system.B) + system.D


def of_states(space, s):
    return space.C @ np.linalg.solve(s * np.eye(len(space.A)) - space.A, space.B) + space.D


def ranks(space):
    """Ranks of the scaled controllability and observability matrices, by exact rational powers."""
    with mpmath.workdps(200):
        a, b, c = (mpmath.matrix(array.tolist()) for array in (space.A, space.B, space.C))
        reach, see = [b], [c]
        for _ in range(len(space.A) - 1):
            reach.append(a * reach[-1])
            see.append(see[-1] * a)
        result = []
        for parts, axis in ((reach, 1), (see, 0)):
            full = np.concatenate([np.array(p.tolist(), dtype=object) for p in parts], axis=axis)
            values = mpmath.svd_r(mpmath.matrix(full.tolist() if axis else full.T.tolist()), compute_uv=False)
            result.append(sum(1 for v in values if v > mpmath.mpf(10) ** -40 * values[0]))
        return result


def test_a_spring_in_series_with_a_damper_alone():
    """k x + c x' = F: one state, the pole -k/c."""
    model = along_z({"node": 0.0}, {"k": ("ground", "node", 3.0, 5.0)})
    model.add_input("F", "node", "z")
    model.add_output("x", "node", "z")
    model.add_output("v", "node", "z", quantity="velocity")
    system = model.linearize()
    space = system.state_space()
    assert (system.dof, system.massless, space.states) == (1, 1, ("node.rail.z",))
    assert_allclose(space.A, [[-3.0 / 5.0]], rtol=1e-15)
    assert_allclose(space.D, [[0.0], [0.2]], rtol=1e-15)
    assert_allclose(of_states(space, 2j), descriptor(system, 2j), rtol=1e-14)


def relaxation(relative):
    springs = {"k": ("ground", "b", 2.0, 0), "k1": ("b", "node", 3.0, 0), "c": ("node", "ground", 0, 5.0)}
    model = along_z({"node": 0.0, "b": 7.0}, springs, relative)
    for body in ("node", "b"):
        model.add_input(f"F{body}", body, "z")
        model.add_output(f"x{body}", body, "z")
        model.add_output(f"v{body}", body, "z", quantity="velocity")
    model.add_output("a", "b", "z", quantity="acceleration")
    return model


@pytest.mark.parametrize("relative", [False, True])
def test_a_relaxation_isolator(relative):
    """(s^2 m + k)(k1 + c s) + k1 c s = 0 has three roots."""
    system = relaxation(relative).linearize()
    space = system.state_space()
    k, k1, c, mass = 2.0, 3.0, 5.0, 7.0
    assert len(space.states) == 3 == 2 * system.dof - system.massless
    expected = np.sort_complex(np.roots([mass * c, mass * k1, k * c + k1 * c, k * k1]))
    assert_allclose(np.sort_complex(np.linalg.eigvals(space.A)), expected, rtol=1e-13)
    for s in (0.0, 0.3j, 1j, 20j, 0.1 + 2j):
        assert_allclose(of_states(space, s), descriptor(system, s), rtol=1e-12, atol=1e-15)
    assert ranks(space) == [3, 3]


def test_rates_that_are_sums_say_so():
    space = relaxation(relative=True).linearize().state_space()
    assert space.states[2] in ("d(b.rail.z + node.rail.z)/dt", "d(node.rail.z + b.rail.z)/dt")
    assert space.state_units == ("m", "m", "m/s")
    space = relaxation(relative=False).linearize().state_space()
    assert space.states == ("node.rail.z", "b.rail.z", "d(b.rail.z)/dt")


def test_accelerations_that_would_need_the_rate_of_an_input_are_refused():
    model = relaxation(relative=True)
    model.add_output("jerk", "node", "z", quantity="acceleration")
    with pytest.raises(mv.ModelError, match=r"output 'jerk' would need the derivative of input 'Fnode'.*or velocity"):
        model.linearize()


def test_mixed_nodes_with_and_without_dampers():
    springs = {
        "k1": ("ground", "n1", 2.0, 0), "k2": ("n1", "n2", 3.0, 0), "c": ("n2", "b", 1.0, 0.7),
        "k3": ("b", "n3", 4.0, 0), "k4": ("n3", "ground", 5.0, 0), "c3": ("b", "ground", 0.0, 0.2),
    }  # fmt: skip
    for relative in (False, True):
        model = along_z({"n1": 0.0, "n2": 0.0, "b": 3.0, "n3": 0.0}, springs, relative)
        for body in ("n1", "n2", "b", "n3"):
            model.add_input(f"F{body}", body, "z")
            model.add_output(f"x{body}", body, "z")
        system = model.linearize()
        assert (system.dof, system.massless) == (2, 1)
        space = system.state_space()
        assert len(space.states) == 3
        absolute = {"n1": 0, "n2": 1, "b": 2, "n3": 3}
        for s in (0.5j, 3j):
            z = np.zeros((4, 4), dtype=complex)
            z[2, 2] = 3.0 * s * s
            for first, second, k, c in springs.values():
                row = np.zeros(4)
                for name, sign in ((first, -1), (second, 1)):
                    if name in absolute:
                        row[absolute[name]] = sign
                z += (k + s * c) * np.outer(row, row)
            assert_allclose(of_states(space, s), np.linalg.inv(z), rtol=1e-12)
        assert ranks(space) == [3, 3]
