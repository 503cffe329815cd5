"""Structured singular values against closed forms, bounds from both sides, and loops with uncertain gains."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library

mu = isolation.structured_singular_values


def of_rank_one(products, real):
    """Of a b^T: the level t at which sum a_i b_i d_i = t has a solution, |d_i| <= 1.

    Real parameters reach a zonotope, complex ones a disc: t = min over angles of the support function / cos.
    """
    edges = (np.angle(products[real]) + np.pi) % np.pi - np.pi / 2
    angles = np.concatenate((np.linspace(-np.pi / 2, np.pi / 2, 100_001)[1:-1], edges))
    zonotope = np.abs((products[real][:, None] * np.exp(-1j * angles)).real).sum(axis=0)
    return ((zonotope + np.abs(products[~real]).sum()) / np.cos(angles)).min()


@pytest.mark.few(3)
@pytest.mark.parametrize("seed", range(25))
def test_matrices_of_rank_one(seed):
    rng = np.random.default_rng(seed)
    n = rng.integers(2, 8)
    a, b = rng.normal(size=(2, n)) + 1j * rng.normal(size=(2, n))
    real = rng.random(n) < 0.6
    m = np.outer(a, b)
    bound, expected = mu(m, real=np.flatnonzero(real)), of_rank_one(a * b, real)
    assert -1e-8 * expected <= bound - expected <= 1e-6 * expected + 2e-6 * np.linalg.norm(m, 2)


@pytest.mark.slow
def test_complex_blocks():
    rng = np.random.default_rng(2)
    m = rng.normal(size=(5, 5, 20)) + 1j * rng.normal(size=(5, 5, 20))
    each = np.moveaxis(m, 2, 0)
    radius, norm = np.abs(np.linalg.eigvals(each)).max(axis=1), np.linalg.norm(each, 2, axis=(1, 2))
    assert mu(m).shape == (20,)
    assert (radius * (1 - 1e-9) <= mu(m)).all()
    assert (mu(m) <= norm).all()
    assert mu(m, [5]) == pytest.approx(norm)
    assert (mu(m) <= mu(m, [2, 3]) * (1 + 1e-6)).all()
    positive = rng.uniform(0.1, 1.0, (4, 4))  # Perron's eigenvalue
    assert mu(positive) == pytest.approx(np.abs(np.linalg.eigvals(positive)).max(), rel=1e-6)


@pytest.mark.few(1)
@pytest.mark.parametrize("real", [(), (1, 3), range(5)])
def test_scaling_changes_nothing(real):
    rng = np.random.default_rng(3)
    m = rng.normal(size=(5, 5)) + 1j * rng.normal(size=(5, 5))
    d = np.diag([1.0, 1e2, 1e-3, 5.0, 1e4])
    assert mu(d @ m @ np.linalg.inv(d), real=real) == pytest.approx(mu(m, real=real), rel=1e-5)
    assert mu(1e-200 * m, real=real) == pytest.approx(1e-200 * mu(m, real=real))


@pytest.mark.slow
def test_real_parameters():
    """Between the largest real eigenvalue of M Delta, Delta at all corners, and the bound for complex ones."""
    rng = np.random.default_rng(4)
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 4)).reshape(4, -1).T
    for _ in range(10):
        m = rng.normal(size=(4, 4))
        values = np.linalg.eigvals(m * corners[:, None])
        below = np.abs(values[np.abs(values.imag) < 1e-12]).max()
        bound = mu(m, real=range(4))
        assert below * (1 - 1e-9) <= bound <= mu(m, real=[0]) * (1 + 1e-6) <= mu(m) * (1 + 2e-6)
    assert mu(1j * np.eye(3), real=range(3)) == 0.0
    assert mu(np.diag([1.0, 2j, 3.0])) == pytest.approx(3.0)
    assert mu(np.diag([1.0, 4j, 3.0]), real=[1]) == pytest.approx(3.0)


@pytest.mark.slow
def test_blocks_that_act_one_way():
    """Determinants of triangular matrices are products of their diagonals."""
    assert mu(np.triu(np.full((4, 4), 7.0), 1)) == 0.0
    assert mu(np.triu(np.full((4, 4), 7.0))) == pytest.approx(7.0)
    m = np.zeros((4, 4))
    m[:2, :2], m[2:, 2:], m[:2, 2:] = [[0, 4], [1, 0]], [[0, 9], [1, 0]], 1e6
    assert mu(m) == pytest.approx(3.0)
    assert mu(m, [2, 2]) == pytest.approx(9.0)
    assert mu(np.zeros((2, 2))) == 0.0
    # one way at the second and third of four frequencies, both ways at the others
    m = np.array([[3.0, 4.0], [9.0, 0.0]])[:, :, None] * np.ones(4)
    m[1, 0, 1] = m[0, 1, 2] = 0.0
    largest = 0.5 * (3.0 + np.sqrt(9.0 + 4.0 * 36.0))  # Perron's eigenvalue
    assert mu(m) == pytest.approx([largest, 3.0, 3.0, largest], rel=1e-4)


@pytest.mark.slow
def test_uncertain_actuators_of_a_hexapod():
    """Gains of six actuators, each of its own: the loop becomes unstable no sooner than mu of K G S says."""
    p = isolation.actuated(library.cubic_hexapod(damping=20.0), "platform")
    law = isolation.lqg(p, p.names("acceleration"), 1e-4)
    complementary = p.with_gains(law).sensitivity(np.geomspace(1e-3, 1e6, 600)) - np.eye(6)[:, :, None]
    bounds = mu(complementary)
    assert (bounds <= np.linalg.norm(np.moveaxis(complementary, 2, 0), 2, axis=(1, 2)) * (1 + 1e-12)).all()
    real = mu(complementary, real=range(6), complex_share=0.01)
    assert (real <= bounds * 1.01 * (1 + 1e-6)).all()
    rng = np.random.default_rng(1)
    for _ in range(20):
        factors = 1.0 + 0.98 / real.max() * rng.choice([-1.0, 1.0], 6)
        changed = isolation.Controller("changed", law.A, law.B, factors[:, None] * law.C, factors[:, None] * law.D,
                                       law.inputs, law.outputs)  # fmt: skip
        assert p.with_gains(changed).stable


@pytest.mark.parametrize(("arguments", "message"), [
    ((np.ones((2, 3)),), r"shape \(2, 3\)"), ((np.eye(3), [1, 1]), r"blocks = \[1, 1\]"),
    ((np.eye(2), [2, 0]), "blocks"), ((np.full((2, 2), np.nan),), "NaN"),
    ((np.eye(3), [2, 1], [0]), r"real = \[0\]; expected numbers from 0 of blocks of size 1"),
    ((1j * np.ones((2, 2, 3)), None, [0, 1]), r"blocks \[0, 1\] are all real.*complex_share=0.01"),
    ((np.eye(2), None, [0], -1.0), "complex_share = -1.0"),
    ((np.eye(2), None, [2]), r"real = \[2\]"), ((np.eye(2), None, [1, 1]), r"real = \[1, 1\]"),
])  # fmt: skip
def test_refusals(arguments, message):
    with pytest.raises(mv.ResponseError, match=message):
        mu(*arguments)


@pytest.mark.slow
def test_a_real_parameter_that_makes_a_loop_unstable_is_seen():
    """x'' + c x' + (k + delta) x = 0 is unstable from delta = -k on, at s = 0, and under delta < 0 beside c = 0.

    M(s) = -r / (s^2 + c s + k) sees delta = r d: mu is at least r / k, and where c < 0.02 is small, complex parameters
    say r / (c omega) instead.
    """
    c, k, r = 0.02, 1.0, 0.5
    s = 1j * np.concatenate((np.geomspace(1e-3, 10.0, 200), np.linspace(0.98, 1.02, 201)))
    seen = (-r / (s**2 + c * s + k))[None, None]
    with pytest.raises(mv.ResponseError, match="are all real"):
        mu(seen, real=[0])
    values = [mu(seen, real=[0], complex_share=e).max() for e in (1e-3, 1e-2, 1.0)]
    assert r / k * (1.0 - 1e-6) <= values[0] < values[1] < values[2]
    assert values[0] < 0.6
    assert mu(seen).max() == pytest.approx(r / c, rel=1e-2)
    assert values[2] <= 2.0 * r / c


@pytest.mark.slow
def test_a_complex_share_is_one_more_block():
    """delta + e delta' of one parameter: the least size that makes 1 - (d + e d') z zero, in closed form."""
    for z in (2.0 + 1.0j, 0.5 - 0.2j, 1j):
        # |1/z - d| = e |d'| with |d| = |d'| = t: (1/z - t) at the nearest real d
        target, e = 1.0 / z, 0.3
        t = np.linspace(0.0, 10.0, 2_000_001)
        gap = np.abs(target - np.clip(target.real, -t, t)) - e * t
        assert mu(np.array([[z]]), real=[0], complex_share=e) == pytest.approx(1.0 / t[np.argmax(gap <= 0.0)], rel=1e-4)
