"""Zeros of systems with more outputs than inputs, or fewer: against minors of the system matrix in rational numbers."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from flint import fmpq, fmpq_poly

import mbsvib as mv
import mbsvib_export as mx

QUANTITIES = ("displacement", "velocity", "acceleration")


def determinant(rows):
    """Bareiss' elimination, in which every division is exact."""
    m, sign, before = [list(row) for row in rows], 1, fmpq_poly([1])
    for k in range(len(m) - 1):
        pivot = next((i for i in range(k, len(m)) if m[i][k] != 0), None)
        if pivot is None:
            return fmpq_poly([0])
        if pivot != k:
            m[k], m[pivot], sign = m[pivot], m[k], -sign
        for i in range(k + 1, len(m)):
            for j in range(k + 1, len(m)):
                m[i][j] = (m[i][j] * m[k][k] - m[i][k] * m[k][j]) // before
        before = m[k][k]
    return m[-1][-1] * sign


def exact_zeros(mass, damping, stiffness, forces, measured, power):
    """Roots of the greatest common divisor of all minors of full size; ``power`` of s in the outputs."""
    def polynomial(*terms):
        return fmpq_poly([fmpq(*Fraction(float(term)).as_integer_ratio()) for term in terms])

    n, inputs = forces.shape
    rows = [[polynomial(stiffness[i, j], damping[i, j], mass[i, j]) for j in range(n)]
            + [polynomial(-forces[i, k]) for k in range(inputs)] for i in range(n)]  # fmt: skip
    rows += [[polynomial(*[0] * power, value) for value in row] + [polynomial(0)] * inputs for row in measured]
    common = fmpq_poly([0])
    for chosen in combinations(rows, n + inputs):
        minor = determinant(chosen)
        common = minor if common == 0 else common.gcd(minor)
    assert common != 0
    roots = common.complex_roots() if common.degree() > 0 else []
    return [complex(root) for root, count in roots for _ in range(count)]


def chain(seed, n, inputs, outputs):
    """M, C, K of masses in a row, and the ports at some of them."""
    rng = np.random.default_rng(seed)
    joined = np.eye(n) - np.eye(n, k=-1)
    c, k = rng.integers(0, 9, n) / 8.0, rng.integers(1, 99, n).astype(float)
    forces, measured = np.eye(n)[:, rng.choice(n, inputs, False)], np.eye(n)[rng.choice(n, outputs, False)]
    return np.diag(rng.integers(1, 9, n) / 2.0), joined.T * c @ joined, joined.T * k @ joined, forces, measured


def assert_zeros(found, expected, tolerance=1e-6):
    """The same zeros, double ones at 0 to the root of rounding."""
    found = list(found)
    assert len(found) == len(expected)
    for value in expected:
        nearest = found.pop(int(np.argmin(np.abs(np.subtract(found, value)))))
        assert abs(nearest - value) <= tolerance * max(abs(value), 1.0)


@pytest.mark.few(3)
@pytest.mark.parametrize("power", range(3), ids=QUANTITIES)
@pytest.mark.parametrize(("seed", "n", "inputs", "outputs"), [
    (1, 4, 1, 2), (2, 4, 1, 3), (3, 5, 2, 3), (4, 5, 1, 2), (5, 5, 2, 3), (6, 5, 1, 2), (9, 6, 1, 2), (24, 6, 1, 2),
    (239, 6, 1, 2), (299, 6, 2, 3),
])  # fmt: skip
def test_chains_with_more_outputs_than_inputs(seed, n, inputs, outputs, power):
    m, c, k, forces, measured = chain(seed, n, inputs, outputs)
    expected = exact_zeros(m, c, k, forces, measured, power)
    none = np.zeros_like(measured)
    system = mv.System.from_matrices(m, c, k, forces, *[measured if i == power else none for i in range(3)])
    assert_zeros(system.transmission_zeros(), expected)
    assert_zeros(system.state_space().transmission_zeros(), expected, 1e-5)
    if power == 0:  # the transposed system has more inputs than outputs, and the same zeros
        other = mv.System.from_matrices(m, c, k, measured.T, forces.T)
        assert_zeros(other.transmission_zeros(), expected)


@pytest.mark.parametrize("n", [6, 20])
def test_from_one_end_to_two_bodies_at_the_other_there_is_no_zero(n):
    rng = np.random.default_rng(n)
    joined = np.eye(n) - np.eye(n, k=-1)
    stiffness = joined.T * rng.uniform(50, 150, n) @ joined
    system = mv.System.from_matrices(np.diag(rng.uniform(0.5, 2, n)), 0 * stiffness, stiffness, np.eye(n)[:, :1],
                                     np.eye(n)[n - 2 :])  # fmt: skip
    assert not len(system.transmission_zeros())
    assert not len(system.state_space().transmission_zeros())


def test_random_systems_of_first_order_have_none_but_those_made():
    """Three outputs of two inputs: none by chance; C times (A - z) has the zero z in all outputs."""
    rng = np.random.default_rng(8)
    a, b, c = rng.normal(size=(6, 6)), rng.normal(size=(6, 2)), rng.normal(size=(3, 6))
    assert not len(mv.StateSpace.from_arrays(a, b, c, np.zeros((3, 2))).transmission_zeros())
    made = mv.StateSpace.from_arrays(a, b, c @ (a + 1.5 * np.eye(6)), c @ b)  # (s + 1.5) C (s - A)^-1 B
    np.testing.assert_allclose(made.transmission_zeros(), [-1.5, -1.5], rtol=1e-6)


@pytest.mark.few(2)
@pytest.mark.parametrize("coupling", [1.0, 1e-6, 1e-10, 1e-12, 1e-14, 1e-20, 0.0])
def test_a_zero_beside_an_output_that_is_hardly_moved(coupling):
    """An absorber keeps its mass still, m s^2 + c s + k = 0; another output feels another force by a weak spring.

    The transposed system has the same zeros.
    """
    mass, damping = np.diag([1.0, 0.1, 1.0, 1.0]), np.zeros((4, 4))
    stiffness, select = np.zeros((4, 4)), np.eye(4)
    springs = [((1, 0, 0, 0), 100.0, 1.0), ((1, -1, 0, 0), 20.0, 0.05), ((0, 0, 1, 0), 80.0, 0.9),
               ((0, 0, 1, -1), coupling, 0.0), ((0, 0, 0, 1), 60.0, 0.7)]  # fmt: skip
    for row, k, c in springs:
        stiffness, damping = stiffness + k * np.outer(row, row), damping + c * np.outer(row, row)
    displacements, velocities = select[[0, 0, 3]] * [[1], [0], [1]], select[[0, 0, 3]] * [[0], [1], [0]]
    wide = mv.System.from_matrices(mass, damping, stiffness, select[:, [0, 2]], displacements, velocities)
    tall = mv.System.from_matrices(mass, damping, stiffness, select[:, [0, 0, 3]] * [1.0, 2.0, 1.0], select[[0, 2]])
    for system in (wide, tall):
        zeros = system.transmission_zeros(), system.state_space().transmission_zeros()
        for found in zeros:
            np.testing.assert_allclose(found, np.roots([0.1, 0.05, 20.0]), rtol=1e-9)


def test_zeros_of_what_does_not_respond_are_refused():
    """Two masses side by side: every s is a zero from one to the other, not those of the masses."""
    model = mv.Model("pair")
    for name in ("a", "b"):
        model.add_body(name, 2.0, (1, 1, 1))
        model.add_joint(f"rail {name}", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_spring(f"spring {name}", "ground", name, (-1, 0, 0), (0, 0, 0), 800.0, 4.0)
        model.add_input(f"F {name}", name, "x")
        model.add_output(f"x {name}", name, "x")
    model.add_output("aside", "a", "y")
    system = model.linearize()
    loop = system.feedback([[-1.0]], "x a", "F a")
    for linear in (system, system.state_space(), loop, loop.sampled(50.0)):
        for output in ("x b", "aside"):
            with pytest.raises(mv.ResponseError, match=f"zeros: of 'pair.*', {output} does not respond to F a"):
                linear.transmission_zeros(output, "F a")
    assert len(system.frequency_grid())
    assert not mx.to_transfer_function(system, "x b", "F a")[0].num[0][0].any()
    assert not mx.to_transfer_function(loop.sampled(50.0), "x b", "F a")[0].num[0][0].any()
