"""Undamped modes, with an accuracy that is asked for.

Shapes come from the cheapest solver that will do; frequencies always from the factors. With E = diag(sqrt k) D phi and
H = W phi, omega = |E| / |H| is off by the *square* of the error of phi, and what the other modes leave in phi is seen
in the products E_j . E_i and H_j . H_i: it is taken out of the shape to first and out of the frequency to second order,
and its size is the error that is promised. Where that is more than asked for, the next solver climbs one rung:

products  symmetric-definite eigenproblem of M and K; loses (highest / lowest frequency)^2 eps in the shapes
factors   singular vectors of diag(sqrt k) D R^-1, R^T R = M from a QR of W; loses highest / lowest frequency
jacobi    one-sided Jacobi (LAPACK gejsv) on the factors in the basis found so far; loses neither
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib.loops import pivoted_qr

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.system import System

    Array = NDArray[np.float64]

EPS = float(np.finfo(float).eps)
# Below this share of the largest frequency a mode may be a rigid-body mode, and the rank of the rows decides.
SUSPECT = 1e-5
# Rows of unit length that depend on each other differ by rounding of the geometry, far below this.
RANK = 1e-11
# Two modes are told apart where what they share is less than this part of the distance of their squared frequencies.
SEPARATE = 0.1
# Rotations by an angle a are orthonormal to a^4 when they are taken to second order.
SMALL_ANGLE = 1e-4
# Rounding of |H|^2 counts half in |H|. Calibrated in the tests.
ROUNDING = 0.5
# Loops whose smallest pivot p is above this lose nothing that counts; others lose eps / p of every frequency at most.
WELL_CLOSED = 0.1


@dataclass(frozen=True, slots=True)
class Undamped:
    """Undamped modes: ``square`` (m,) holds omega^2 [rad^2/s^2], ascending, exactly 0 for the ``rigid`` first ones and
    negative where stiffness is; ``shapes`` (m, m) with shapes^T M shapes = 1; ``errors`` (m,) of omega, relative;
    ``method`` is the rung of the ladder that was enough, ``doubt`` the largest error that a higher one could mend.
    """

    square: Array
    shapes: Array
    errors: Array
    rigid: int
    method: str
    doubt: float

    @property
    def omega(self) -> Array:
        """Magnitude of the natural angular frequencies [rad/s], shape (m,)."""
        return np.sqrt(np.abs(self.square))


@dataclass(frozen=True, slots=True)
class _Scene:
    """What the rungs work on: ``mass`` and ``stiffness``, rows ``w`` and ``e`` = diag(sqrt |k|) D, ``sign`` of k."""

    mass: Array
    stiffness: Array
    w: Array
    e: Array
    sign: Array | None
    null: Array | None = None


def undamped(system: System, rtol: float) -> Undamped:
    """Return the undamped modes, K phi = omega^2 M phi.

    Parameters
    ----------
    system : System
        The equations of motion.
    rtol : float
        Relative accuracy asked of every frequency.

    Returns
    -------
    Undamped
        Squares of the frequencies, mass-normalised shapes and error estimates; the last rung may fall short of rtol.
    """
    m = system.dof
    if m == 0:
        return Undamped(np.zeros(0), np.zeros((0, 0)), np.zeros(0), 0, "no degree of freedom", 0.0)
    used = system.stiffness != 0.0
    k = system.stiffness if used.all() else system.stiffness[used]
    rows = system.elastic_rows if used.all() else system.elastic_rows[used]
    negative = bool((k < 0.0).any())
    w = system.inertia_factor
    scene = _Scene(system.M, system.K, w[w.any(axis=1)], rows * np.sqrt(np.abs(k))[:, None],
                   np.sign(k) if negative else None)  # fmt: skip
    shapes, square = by_products(scene)
    if float(np.abs(square).min()) <= SUSPECT**2 * float(np.abs(square).max()):
        scene = replace(scene, null=_null_space(scene, rows))
    result = _accepted(scene, shapes, square, rtol)
    rungs: tuple[tuple[str, Callable[..., Array]], ...] = (("factors", by_factors), ("jacobi", by_jacobi))
    for method, rung in rungs if not negative else ():
        if result.doubt <= rtol:
            break
        better = refined(scene, rung(scene, result.shapes), method, rtol)
        if better.doubt < result.doubt:
            result = better
    return _with_loops(result, system)


def _with_loops(result: Undamped, system: System) -> Undamped:
    """Add to the errors what nearly singular loops have done to the coordinates, which the factors don't show."""
    kept = min((group.kept for group in system.provenance.reduction.groups), default=1.0)
    if kept >= WELL_CLOSED:
        return result
    flexible = np.arange(len(result.square)) >= result.rigid
    return replace(result, errors=result.errors + flexible * (EPS / kept))


def _accepted(scene: _Scene, shapes: Array, square: Array, rtol: float) -> Undamped:
    """The first rung as it is where its a-priori bound will do, which spares the look at the factors; else refined."""
    if scene.null is None and scene.sign is None:
        # forming M, and K in its Cholesky factor's coordinates, rounds by eps times the cancellation in phi
        growth = (np.sqrt(scene.mass.diagonal()) @ np.abs(shapes)) ** 2
        bound = 2.0 * EPS * float(growth.max()) * float(square[-1]) / square
        if float(bound[0]) <= rtol:
            return Undamped(square, shapes, bound, 0, "products", 0.0)
    return refined(scene, shapes, "products", rtol)


def by_products(scene: _Scene) -> tuple[Array, Array]:
    """Return shapes and squared frequencies from M and K, brought to a unit diagonal of M."""
    scale = 1.0 / np.sqrt(scene.mass.diagonal())
    k = scene.stiffness * scale[:, None] * scale
    square, vectors, failed = lapack.dsygvd(k, scene.mass * scale[:, None] * scale)
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues of M and K did not converge")
    vectors *= scale[:, None]
    return vectors, square


def by_factors(scene: _Scene, _shapes: Array) -> Array:
    """Return shapes from the singular vectors of diag(sqrt k) D R^-1."""
    root = triangle(scene.w)
    half = lapack.dtrtrs(root, scene.e.T, trans=1)[0]
    vectors = np.linalg.svd(half, full_matrices=half.shape[1] < len(half))[0]
    result: Array = lapack.dtrtrs(root, vectors[:, ::-1])[0]
    return result


def by_jacobi(scene: _Scene, shapes: Array) -> Array:
    """Return shapes from one-sided Jacobi on the factors in the basis ``shapes``, rigid-body modes left aside.

    A change of basis is exact whatever the basis, so the frequencies are those of the pair (E, H) = (e, w) shapes. Both
    are brought to triangles by QR with rows sorted by size and columns pivoted, which keeps the digits of small rows.

    Source: Drmac & Veselic, SIAM J. Matrix Anal. Appl. 29 (2008); Cox & Higham, BIT 38 (1998).
    """
    rigid = 0 if scene.null is None else scene.null.shape[1]
    basis = shapes[:, rigid:]
    upper, order = _sorted_qr(scene.e @ basis)
    root, place = _sorted_qr(scene.w @ basis)
    back = np.argsort(order)[place]
    quotient = lapack.dtrtrs(root, upper[:, back].T, trans=1)[0].T
    _, _, vectors, _, _, failed = lapack.dgejsv(quotient, joba=0, jobu=3, jobv=0)
    if failed:
        return shapes
    result = np.empty_like(shapes)
    result[:, :rigid] = shapes[:, :rigid]
    turned = lapack.dtrtrs(root, vectors[:, ::-1])[0]
    result[:, rigid:] = basis[:, place] @ turned
    return result


def _sorted_qr(a: Array) -> tuple[Array, NDArray[np.intp]]:
    qr, order, _ = pivoted_qr(a[np.argsort(-np.abs(a).max(axis=1), kind="stable")])
    return np.triu(qr[: a.shape[1]]), order


def refined(scene: _Scene, shapes: Array, method: str, rtol: float) -> Undamped:
    """Return frequencies from the factors, shapes cleaned of each other, and the error of what is left.

    Parameters
    ----------
    scene : _Scene
        Mass and factors.
    shapes : array, shape (m, m)
        Approximate modes.
    method : str
        Name of the rung that they come from.
    rtol : float
        Relative accuracy asked of every frequency; decides how closely errors are looked at.

    Returns
    -------
    Undamped
        Modes in ascending order.

    Source: second-order perturbation theory; Ogita & Aishima, Japan J. Indust. Appl. Math. 35 (2018), for the shapes.
    """
    phi = shapes
    rigid = 0
    if scene.null is not None and scene.null.shape[1]:
        rigid = scene.null.shape[1]
        phi = _without_rigid(scene, shapes)
    h = scene.w @ phi
    length = np.sqrt(np.einsum("ij,ij->j", h, h))
    h /= length
    phi = phi / length
    e = scene.e @ phi
    elastic = e.T @ (e if scene.sign is None else scene.sign[:, None] * e)
    elastic[:rigid] = elastic[:, :rigid] = 0.0
    square = elastic.diagonal().copy()
    inertia = h.T @ h
    # row j, column i: what mode j sees of the residual of mode i, and from it how much of mode j is in mode i
    shared = _off_diagonal(np.subtract(elastic, inertia * square, out=elastic))
    mixing, unresolved = _mixing(shared, square)
    taken = np.multiply(mixing, shared, out=shared)
    value = square + taken.sum(axis=0)
    doubt = np.abs(taken, out=taken).sum(axis=0) + unresolved + _rounding(scene.e, phi, e)
    # the sum of column lengths bounds that of the rows, which costs a product more
    rounding = EPS * (np.sqrt(scene.mass.diagonal()) @ np.abs(phi))
    if ROUNDING * float(rounding.max()) > rtol:
        rounding = _rounding(scene.w, phi, h)
    size = np.abs(value)
    flexible = np.arange(len(value)) >= rigid
    errors = np.divide(0.5 * doubt, size, out=np.where(flexible, np.inf, 0.0), where=flexible & (size > 0.0))
    left = float(errors.max(initial=0.0))
    errors += flexible * (2.0 * EPS + ROUNDING * rounding)
    value[:rigid] = 0.0
    phi = _cleaned(phi, inertia, mixing)
    order = np.concatenate((np.arange(rigid), rigid + np.argsort(value[rigid:], kind="stable")))
    return Undamped(value[order], phi[:, order], errors[order], rigid, method, left)


def _rounding(rows: Array, phi: Array, moved: Array) -> Array:
    """Bound of what rounding of the rows and of ``moved`` = rows phi does to the sum of squares of each column."""
    cancel = np.abs(rows) @ np.abs(phi)
    first, second = np.einsum("ij,ij->j", np.abs(moved), cancel), np.einsum("ij,ij->j", cancel, cancel)
    return np.asarray(EPS * first + EPS**2 * second)


def _off_diagonal(a: Array) -> Array:
    np.fill_diagonal(a, 0.0)
    return a


def _mixing(shared: Array, square: Array) -> tuple[Array, Array]:
    """Return how much of each mode (row) is in each other (column), and the most that cannot be told apart, (m,)."""
    gap = square - square[:, None]
    gap[gap == 0.0] = np.inf
    mixing = shared / gap
    unresolved = np.zeros(len(square))
    together = np.abs(mixing) >= SEPARATE
    if together.any():
        row, column = np.nonzero(together)
        np.maximum.at(unresolved, column, np.minimum(np.abs(shared[row, column]), np.abs(gap[row, column])))
        mixing[row, column] = 0.0
    return mixing, unresolved


def _cleaned(phi: Array, inertia: Array, mixing: Array) -> Array:
    """Take the others out of each mode: a rotation by the mixing, and what M-norms still lack."""
    angle = mixing - mixing.T
    angle *= 0.5
    lack = _off_diagonal(inertia)
    lack *= 0.5
    one = np.eye(len(angle))
    size = max(float(angle.max(initial=0.0)), -float(angle.min(initial=0.0))) * len(angle)
    if size < SMALL_ANGLE:
        one += angle
        one -= lack
        if size * size > EPS:
            one += 0.5 * (angle @ angle)
        return phi @ one
    # Cayley's rotation keeps the shapes orthonormal for any angle
    straight: Array = phi - phi @ lack
    return straight @ np.linalg.solve(one - 0.5 * angle, one + 0.5 * angle)


def _without_rigid(scene: _Scene, shapes: Array) -> Array:
    """Put the rigid-body modes first and take them out of the others, of which as many as they are drop out."""
    null = scene.null
    assert null is not None
    share = np.einsum("ij,ij->j", *([null.T @ (scene.mass @ shapes)] * 2))
    kept = np.sort(np.argsort(share, kind="stable")[: shapes.shape[1] - null.shape[1]])
    flexible = shapes[:, kept]
    for _ in range(2):  # once more takes out what the first time left by rounding
        flexible = flexible - null @ (null.T @ (scene.mass @ flexible))
    return np.concatenate((null, flexible), axis=1)


def triangle(factor: Array) -> Array:
    """Return R upper triangular with R^T R = factor^T factor, from a QR of the factor."""
    m = factor.shape[1]
    return np.triu(lapack.dgeqrf(factor)[0][:m])


def _null_space(scene: _Scene, rows: Array) -> Array:
    """Return the motions that no spring feels, whatever its stiffness, M-orthonormal (m, rigid)."""
    m = rows.shape[1]
    length = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    unit = rows / length[:, None]
    size = np.sqrt(np.einsum("ij,ij->j", unit, unit))
    size[size == 0.0] = 1.0
    qr, order, _ = pivoted_qr(unit / size)
    pivots = np.abs(qr.diagonal())
    rank = int(np.count_nonzero(pivots > RANK * pivots[0])) if len(pivots) else 0
    null = np.zeros((m, m - rank))
    null[order[rank:], np.arange(m - rank)] = 1.0
    if 0 < rank < m:
        null[order[:rank]] = -lapack.dtrtrs(qr[:rank, :rank], qr[:rank, rank:])[0]
    null /= size[:, None]
    if rank < m:
        null = lapack.dtrtrs(triangle(scene.w @ null), null.T, trans=1)[0].T
    return null
