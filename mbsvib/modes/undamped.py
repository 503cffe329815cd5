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

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib.common.memory import keep_freed_memory
from mbsvib.equations.unresisted_motion import free_motions, orthonormal
from mbsvib.linalg.rank import EPS
from mbsvib.modes.eigensolvers import Factors, by_factors, by_jacobi, by_products

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations


# Stiffness of either sign whose rounding may be as large as itself is none, and the estimate knows but a fiftieth of
# what loads have: a pendulum that turns about the vertical must not swing, nor grow.
NONE = 0.01
# Below this share of the largest frequency a mode may be a rigid-body mode, and the rank of the rows decides.
SUSPECT = 1e-5
# Two modes are told apart where what they share is less than this part of the distance of their squared frequencies.
SEPARATE = 0.1
# Rotations by an angle a are orthonormal to a^4 when they are taken to second order.
SMALL_ANGLE = 1e-4
# Errors of the first rung over what its perturbation bound says, more where there are more modes. Calibrated on chains,
# trees, loops and networks of 2 to 400 coordinates.
PERTURBED, PERTURBED_MORE = 0.5, 0.7
# Share of the accuracy asked for that is certain enough from bounds that take rounding errors for random.
CERTAIN = 0.3
# Shapes of equations that are off by no more than this are clean enough for any use.
CLEAN = 1e-14
# Shapes that mix more than this are no basis for modes that dampers couple.
MIXED = 1e-10
# A cheap bound of rounding that is larger than this is worth a closer look, row by row.
CLOSER = 1e-14
# Loops whose smallest pivot p is above this lose nothing that counts; others lose eps / p of every frequency at most.
WELL_CLOSED = 0.1


@dataclass(frozen=True, slots=True)
class Undamped:
    """Undamped modes: ``square`` (m,) holds omega^2 [rad^2/s^2], ascending, exactly 0 for the ``rigid`` first ones and
    negative where stiffness is; ``shapes`` (m, m) with shapes^T M shapes = 1; ``errors`` (m,) of omega, relative;
    ``method`` is the rung of the ladder that was enough, ``doubt`` the largest error that a higher one could mend.
    The shapes are the modes of a system whose frequencies are off by ``mixed``, relative, at most.
    """

    square: Array
    shapes: Array
    errors: Array
    rigid: int
    method: str
    doubt: float
    mixed: float = 0.0

    @property
    def omega(self) -> Array:
        """Magnitude of the natural angular frequencies [rad/s], shape (m,)."""
        return np.sqrt(np.abs(self.square))


def undamped(
    system: Equations, rtol: float, clean: bool = True, null: Array | None = None, coupled: bool = False
) -> Undamped:
    """Return the undamped modes, K phi = omega^2 M phi.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    rtol : float
        Relative accuracy asked of every frequency.
    clean : bool
        Whether the shapes have to be as good as the frequencies, as responses ask for; frequencies need less.
    null : array, shape (m, r), optional
        Motions that no row with stiffness feels, M-orthonormal, where they are known.
    coupled : bool
        Whether the shapes are a basis in which the factors are looked at again, as where damping couples them: they
        may then mix up to ``MIXED``, and errors are those of the factors in this basis.

    Returns
    -------
    Undamped
        Squares of the frequencies, mass-normalised shapes and error estimates; the last rung may fall short of rtol.
    """
    m = system.dof
    if m == 0:
        return Undamped(np.zeros(0), np.zeros((0, 0)), np.zeros(0), 0, "no degree of freedom", 0.0)
    keep_freed_memory(m)
    scene = Factors(system)
    shapes, square = by_products(scene)
    size = np.abs(square)
    if null is not None:
        scene.null = null
    elif size[size.argmin()] <= SUSPECT**2 * size[size.argmax()]:
        scene.null = orthonormal(scene.w, free_motions(scene.rows))
    if scene.null is None and scene.sign is None:
        result = _as_it_is(scene, shapes, square, rtol, clean, coupled)
        if result is not None:
            return _with_loops(result, system)
    result = refined(scene, shapes, "products", rtol)
    if scene.sign is not None and np.count_nonzero(result.errors >= NONE):
        none = (result.errors >= NONE) | (np.arange(m) < result.rigid)  # what loads add and take away again
        scene.null = result.shapes[:, none]
        result = refined(scene, result.shapes, "products", rtol)
    rungs: tuple[tuple[str, Callable[..., Array]], ...] = (("factors", by_factors), ("jacobi", by_jacobi))
    for method, rung in rungs if scene.sign is None else ():
        if result.doubt <= rtol:
            break
        better = refined(scene, rung(scene, result.shapes), method, rtol)
        if better.doubt < result.doubt:
            result = better
    return _with_loops(result, system)


def _with_loops(result: Undamped, system: Equations) -> Undamped:
    """Add to the errors what nearly singular loops have done to the coordinates, which the factors don't show."""
    kept = min((group.kept for group in system.provenance.reduction.groups), default=1.0)
    if kept >= WELL_CLOSED:
        return result
    flexible = np.arange(len(result.square)) >= result.rigid
    return replace(result, errors=result.errors + flexible * (EPS / kept))


def _as_it_is(
    scene: Factors, shapes: Array, square: Array, rtol: float, clean: bool, coupled: bool
) -> Undamped | None:
    """The first rung where its a-priori bound will do, frequencies in doubt taken from the factors; None elsewhere.

    Rounding of M, of K, of A = L^-1 K L^-T and of its eigenvalues is a perturbation of A whose size in each mode is
    known beforehand. It moves a frequency by as much, and the quotient |E| / |H| by the square of it only.
    """
    power = shapes * shapes
    inertia, elastic = scene.mass.diagonal().dot(power), scene.stiffness.diagonal().dot(power) / square
    cancel = np.sqrt(inertia)
    bound = (square[-1] / square) * (1.0 + cancel) + inertia + elastic
    bound *= EPS * (PERTURBED + PERTURBED_MORE * math.sqrt(len(square)))
    mixed = float(bound[bound.argmax()])
    if mixed <= (min(rtol, CLEAN) if clean else CERTAIN * rtol):
        return Undamped(square, shapes, bound, 0, "products", 0.0, mixed)
    if clean or (coupled and mixed > MIXED):
        return None
    late = np.flatnonzero(bound > CERTAIN * rtol)
    bound[late] = 2.0 * EPS if coupled else 2.0 * EPS + _crossed(bound * square, square)[late] / square[late]
    if float(bound.max()) > rtol:
        return None
    phi = shapes[:, late]
    h, e = scene.w @ phi, scene.stretch(phi)
    mass, energy = np.einsum("ij,ij->j", h, h), np.einsum("ij,ij->j", e, e)
    bound[late] += _rounding(scene.e, phi, e, EPS * np.sqrt(elastic[late]) * energy, energy, rtol) / energy
    bound[late] += _rounding(scene.w, phi, h, EPS * cancel[late], mass, rtol)
    square[late] = energy / mass
    shapes[:, late] = phi / np.sqrt(mass)
    if float(bound.max()) > rtol or (not coupled and float((square[1:] - square[:-1]).min(initial=0.0)) < 0.0):
        return None
    return Undamped(square, shapes, bound, 0, "products", 0.0, mixed)


def _crossed(moved: Array, square: Array) -> Array:
    """What perturbations (m,) do to squared frequencies by mixing modes: their square over the distance to the next."""
    gap = square[1:] - square[:-1]
    mixed = np.zeros(len(square) + 1)
    np.divide(np.maximum(moved[1:], moved[:-1]) ** 2, gap, out=mixed[1:-1], where=gap > 0.0)
    mixed[1:-1][gap <= 0.0] = np.inf
    return np.maximum(mixed[1:], mixed[:-1])


def refined(scene: Factors, shapes: Array, method: str, rtol: float) -> Undamped:
    """Return frequencies from the factors, shapes cleaned of each other, and the error of what is left.

    Parameters
    ----------
    scene : Factors
        Mass and factors.
    shapes : array, shape (m, m)
        Approximate modes.
    method : str
        Name of the rung that they come from.
    rtol : float
        Relative accuracy asked of every frequency; decides how closely rounding is looked at.

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
    inertia = h.T @ h
    length = 1.0 / np.sqrt(inertia.diagonal())
    inertia *= length[:, None] * length
    phi = phi * length
    e = scene.stretch(phi)
    elastic = e.T @ (e if scene.sign is None else scene.sign[:, None] * e)
    elastic[:rigid] = elastic[:, :rigid] = 0.0
    square = elastic.diagonal().copy()
    # row j, column i: what mode j sees of the residual of mode i, and from it how much of mode j is in mode i
    shared = _off_diagonal(np.subtract(elastic, inertia * square, out=elastic))
    mixing, unresolved = _mixing(shared, square)
    taken = np.multiply(mixing, shared, out=shared)
    value = square + taken.sum(axis=0)
    size = np.abs(value)
    power = phi * phi
    doubt = np.abs(taken, out=taken).sum(axis=0) + unresolved
    doubt += 2.0 * _rounding(scene.e, phi, e, EPS * np.sqrt(np.abs(square) * (scene.spread @ power)), size, rtol)
    flexible = np.arange(len(value)) >= rigid
    errors = np.divide(0.5 * doubt, size, out=np.where(flexible, np.inf, 0.0), where=flexible & (size > 0.0))
    left = float(errors.max(initial=0.0))
    cheap = EPS * np.sqrt(scene.mass.diagonal() @ power)
    errors += flexible * (2.0 * EPS + _rounding(scene.w, phi, h * length, cheap, np.ones(len(size)), rtol))
    value[:rigid] = 0.0
    phi = _cleaned(phi, inertia, mixing)
    if np.count_nonzero(value[1:] < value[:-1]):
        order = np.concatenate((np.arange(rigid), rigid + np.argsort(value[rigid:], kind="stable")))
        value, phi, errors = value[order], phi[:, order], errors[order]
    return Undamped(value, phi, errors, rigid, method, left)


def _rounding(rows: Array, phi: Array, moved: Array, least: Array, size: Array, rtol: float) -> Array:
    """Half of what rounding of ``moved`` = rows phi does to the sum of squares of each column: ``least`` knows what, or
    row by row where that is no small share of ``size``.
    """
    late = np.flatnonzero(least > max(CLOSER, CERTAIN * rtol) * size)
    if len(late):
        every = len(late) == len(size)
        phi, moved = (phi, moved) if every else (phi[:, late], moved[:, late])
        cancel = np.abs(rows) @ np.abs(phi)
        first, second = np.einsum("ij,ij->j", np.abs(moved), cancel), np.einsum("ij,ij->j", cancel, cancel)
        least[late] = 0.5 * EPS * (first + EPS * second)
    return least


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
    if np.count_nonzero(together):
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
    size = float(np.linalg.norm(angle))
    if size < SMALL_ANGLE:
        one += angle
        one -= lack
        if size * size > EPS:
            one += 0.5 * (angle @ angle)
        return phi @ one
    # Cayley's rotation keeps the shapes orthonormal for any angle
    straight: Array = phi - phi @ lack
    angle *= 0.5
    turned: Array = straight @ lapack.dgesv(one - angle, one + angle)[2]
    return turned


def _without_rigid(scene: Factors, shapes: Array) -> Array:
    """Put the rigid-body modes first and take them out of the others, of which as many as they are drop out."""
    null = scene.null
    assert null is not None
    share = np.einsum("ij,ij->j", *([null.T @ (scene.mass @ shapes)] * 2))
    kept = np.sort(np.argsort(share, kind="stable")[: shapes.shape[1] - null.shape[1]])
    flexible = shapes[:, kept]
    for _ in range(2):  # once more takes out what the first time left by rounding
        flexible = flexible - null @ (null.T @ (scene.mass @ flexible))
    # where loads add and take away, some of them were hardly told from rigid-body modes, and lose most of their length
    flexible = flexible if scene.sign is None else orthonormal(scene.w, flexible)
    return np.concatenate((null, flexible), axis=1)
