"""The largest stable step of a mass and a filtered spring force, against a map from step to step by hand."""

import numpy as np
import pytest
from scipy.linalg import expm

from mbsvib_export.cosimulation.masters import largest_stable_step, loop_of


def held(a, b, h):
    """exp(A h) and its integral times B: the exact step under constant inputs."""
    n, m = b.shape
    both = expm(h * np.block([[a, b], [np.zeros((m, n + m))]]))
    return both[:n, :n], both[:n, n:]


@pytest.mark.parametrize(("ratio", "gain", "rolloff", "step"), [
    (0.0253, 0.5, 10.0, 0.1), (0.0246, 0.5, 10.0, 0.1),  # far below the shortest time constant
    (0.0253, 0.5, 10.0, 1e-3), (0.1, 0.5, 10.0, 0.1), (0.01, -0.05, 1.0, 1.0), (1.5, 0.1, 10.0, 0.1),
])  # fmt: skip
def test_the_largest_stable_step(ratio, gain, rolloff, step):
    """x'' + 2 D x' + x = F with F = -g / (s / w + 1) x: both units hold the other's last output over a step."""
    a, b, c = np.array([[0.0, 1.0], [-1.0, -2.0 * ratio]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    law = np.array([[-rolloff]]), np.array([[1.0]]), np.array([[-gain * rolloff]])
    none, swap = np.zeros((1, 1)), np.eye(2)[::-1]

    def make(h):
        return loop_of([(*unit, none) for unit in ((a, b, c), law)], swap, np.zeros((2, 0)), h)

    def radius(h):
        (move, push), (law_move, law_push) = held(a, b, h), held(*law[:2], h)
        return np.abs(np.linalg.eigvals(np.block([[move, push @ law[2]], [law_push @ c, law_move]]))).max()

    growth = np.linalg.eigvals(np.block([[a, b @ law[2]], [law[1] @ c, law[0]]])).real.max()

    def excess(h):  # of the radius, but for rounding, above that of the loop itself
        return radius(h) - np.exp(max(growth, 0.0) * h) - 1e-7

    h = largest_stable_step(make, "jacobi", step, growth)
    if ratio > 1.0:  # no step makes it grow
        assert h == np.inf
        h = 100.0 * step
        assert max(excess(shorter) for shorter in np.geomspace(1e-3 * h, h, 50)) < 0.0
        return
    assert excess(0.998 * h) < 0.0 < excess(1.002 * h)
    assert max(excess(shorter) for shorter in np.geomspace(1e-3 * h, 0.998 * h, 50)) < 0.0


ORDERS = {"jacobi": 1, "gauss-seidel": 1, "slopes": 2, "iteration": 2}


@pytest.mark.parametrize("through", [0.0, -0.4])
@pytest.mark.parametrize("method", list(ORDERS))
def test_a_master_converges_to_the_closed_loop(method, through):
    """x'' + 0.1 x' + x = F + d, d = 1, with F = -0.5 / (s / 3 + 1) (x + 0.3 d) + g x', g a feedthrough: closed by hand.

    Errors of the states of both units fall with the power of the step that is known of each master.
    """
    plant = np.array([[0.0, 1.0], [-1.0, -0.1]]), np.array([[0.0, 0.0], [1.0, 1.0]]), np.eye(2), np.zeros((2, 2))
    law = np.array([[-3.0]]), np.array([[1.0, 0.0, 0.3]]), np.array([[-1.5]]), np.array([[0.0, through, 0.0]])
    coupling = np.block([[np.zeros((2, 2)), np.eye(2, 1)], [np.eye(3, 2), np.zeros((3, 1))]])
    outside = np.array([[0.0], [1.0], [0.0], [0.0], [1.0]])
    a = np.array([[0.0, 1.0, 0.0], [-1.0, -0.1 + through, -1.5], [1.0, 0.0, -3.0]])
    x, e, end = np.array([0.3, -0.2, 0.1]), np.array([1.0]), 2.0
    rest = np.linalg.solve(a, -np.array([0.0, 1.0, 0.3]))
    exact = rest + expm(a * end) @ (x - rest)
    errors = []
    for count in (32, 64):
        h = end / count
        loop = loop_of((plant, law), coupling, outside, h)
        z = loop.start(x, e, method == "slopes")
        for _ in range(count):
            z = loop.step(method, z, e)
        errors.append(np.abs(z[:3] - exact).max())
    assert errors[0] < 0.05
    assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[method], abs=0.15)
