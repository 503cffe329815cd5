"""Undamped modes, to a required accuracy.

Shapes come from the cheapest solver that is accurate enough; frequencies always from the factors. With
E = diag(sqrt k) D phi and H = W phi, the error of omega = |E| / |H| is of *second* order in that of phi. The products
E_j . E_i and H_j . H_i show how much of the other modes is in phi. This share is removed from the shape to first order
and from the frequency to second order, and its size is the error estimate. If it exceeds the required accuracy, the
next, more accurate solver is used:

products  symmetric-definite eigenproblem of M and K; loses (highest / lowest frequency)^2 eps in the shapes
factors   singular vectors of diag(sqrt k) D R^-1, R^T R = M from a QR of W; loses highest / lowest frequency
jacobi    one-sided Jacobi (LAPACK gejsv) on the factors in the basis of the previous shapes; loses neither

Stiffness of loads has both signs. Shapes are then corrected until rounding alone is left, from those of products or,
if these are too far off, from jacobi's for stiffness without signs. A mode is one of a rigid body if the rounding of
its own stiffness leaves nothing of it, never because other modes are in its shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from mbsvib.common.arrays import Array, Bools
from mbsvib.common.fast_init import fast_init
from mbsvib.common.memory import keep_freed_memory
from mbsvib.equations.equations import Equations
from mbsvib.equations.unresisted_motion import free_motions, orthonormal
from mbsvib.linalg.groups import linked_items
from mbsvib.linalg.rank import EPS
from mbsvib.modes.eigensolvers import Factors, by_factors, by_jacobi, by_products

# A mode of which rounding leaves less is a rigid-body mode if stiffness has both signs. The limit is low because the
# estimate covers only about a fiftieth of the rounding of loads: a pendulum about a vertical axis must not oscillate.
NONE = 0.01
# Corrections of shapes go on while each reduces the error at least to this share.
GAIN = 0.5
# Below this share of the largest frequency a mode may be a rigid-body mode, and the rank of the rows decides.
SUSPECT = 1e-5
# Two modes are separated if their coupling is less than this part of the distance of their squared frequencies.
SEPARATE = 0.1
# Rotations by an angle a are orthonormal to a^4 when they are taken to second order.
SMALL_ANGLE = 1e-4
# Errors of the first solver over its perturbation bound, increasing with the number of modes. Calibrated on chains,
# trees, loops and networks of 2 to 400 coordinates.
PERTURBED, PERTURBED_MORE = 0.5, 0.7
# Share of the required accuracy that bounds may reach which assume random rounding errors.
CERTAIN = 0.3
# Shapes with a relative backward error below this are accurate enough for any use.
CLEAN = 1e-14
# Shapes that mix more than this cannot be the basis for modes that dampers couple.
MIXED = 1e-10
# If the cheap bound of rounding is larger than this, rounding is bounded row by row.
CLOSER = 1e-14
# Loops whose smallest pivot p is above this lose no accuracy; others lose eps / p of every frequency at most.
WELL_CLOSED = 0.1
# Units of the last digit by which the stiffness of loads is rounded, as sums of products of forces and arms are.
FORCES = 4.0


@fast_init
@dataclass(frozen=True, slots=True)
class Undamped:
    """Undamped modes: ``square`` (m,) holds omega^2 [rad^2/s^2], ascending, exactly 0 for the ``rigid`` first ones and
    negative where stiffness is; ``shapes`` (m, m) with shapes^T M shapes = 1; ``errors`` (m,) of omega, relative;
    ``method`` is the solver that was used, ``uncertainty`` the largest error that a more accurate solver could reduce.
    The shapes are the exact modes of a system whose frequencies differ by ``mixed``, relative, at most. ``coupling`` is
    the largest error that the other modes in a shape make, and ``cancelled`` (m,) the modes of which rounding leaves
    nothing, if stiffness has both signs.
    """

    square: Array
    shapes: Array
    errors: Array
    rigid: int
    method: str
    uncertainty: float
    mixed: float = 0.0
    coupling: float = 0.0
    cancelled: Bools | None = None

    @property
    def omega(self) -> Array:
        """Magnitude of the natural angular frequencies [rad/s], shape (m,)."""
        return np.sqrt(np.abs(self.square))


def undamped(
    system: Equations, rtol: float, clean: bool = True, null: Array | None = None, coupled: bool = False
) -> Undamped:
    """Return the undamped modes, K phi = omega^2 M phi.

    ``rtol``: required relative accuracy of every frequency. ``clean``: whether the shapes must be as accurate as the
    frequencies, as responses require. ``null`` (m, r): motions without stiffness, M-orthonormal, if they are known.
    ``coupled``: whether the shapes are only a basis in which the factors are used again, as for modes coupled by
    damping: they may then mix up to ``MIXED``, and errors are without the rounding of the factors in this basis.
    Returns squares of the frequencies, mass-normalised shapes and error estimates, which may exceed rtol.
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
    if scene.sign is not None:
        return _with_loops(_of_both_signs(scene, result, rtol), system)
    solvers: tuple[tuple[str, Callable[..., Array]], ...] = (("factors", by_factors), ("jacobi", by_jacobi))
    for method, solve in solvers:
        if result.uncertainty <= rtol:
            break
        better = refined(scene, solve(scene, result.shapes), method, rtol)
        if better.uncertainty < result.uncertainty:
            result = better
    return _with_loops(result, system)


def _of_both_signs(scene: Factors, result: Undamped, rtol: float) -> Undamped:
    """Return the modes where stiffness has both signs; those in which it cancels are rigid-body modes."""
    result = _corrected(scene, result, rtol)
    if result.coupling > rtol:
        better = _corrected(scene, refined(scene, by_jacobi(scene, result.shapes), "jacobi", rtol), rtol)
        result = better if better.coupling < result.coupling else result
    if result.cancelled is not None and np.count_nonzero(result.cancelled):
        scene.null = result.shapes[:, result.cancelled | (np.arange(len(result.square)) < result.rigid)]
        result = refined(scene, result.shapes, result.method, rtol)
    return result


def _corrected(scene: Factors, result: Undamped, rtol: float) -> Undamped:
    """Correct shapes as long as this reduces the error that the other modes in them make."""
    while result.coupling > rtol:
        better = refined(scene, _apart(scene, result.shapes), result.method, rtol)
        if not better.coupling <= GAIN * result.coupling:
            break
        result = better
    return result


def _apart(scene: Factors, shapes: Array) -> Array:
    """Return shapes in which groups of modes that are not separated are the modes of their subspaces."""
    inertia, elastic = _forms(scene, shapes)
    square = elastic.diagonal()
    coupled = np.abs(elastic - inertia * square) > SEPARATE * np.abs(square - square[:, None])
    result = shapes.copy()
    for inside in linked_items(coupled | coupled.T):
        at = np.ix_(inside, inside)
        result[:, inside] = shapes[:, inside] @ eigh(elastic[at], inertia[at])[1]
    return result


def _forms(scene: Factors, phi: Array) -> tuple[Array, Array]:
    """Return M and K in a basis, from the factors."""
    h, e = scene.w @ phi, scene.stretch(phi)
    return h.T @ h, e.T @ (e if scene.sign is None else scene.sign[:, None] * e)


def _with_loops(result: Undamped, system: Equations) -> Undamped:
    """Add the errors of the coordinates of nearly singular loops, which the factors do not show."""
    smallest_pivot = min((group.retained for group in system.provenance.reduction.groups), default=1.0)
    if smallest_pivot >= WELL_CLOSED:
        return result
    flexible = np.arange(len(result.square)) >= result.rigid
    return replace(result, errors=result.errors + flexible * (EPS / smallest_pivot))


def _as_it_is(
    scene: Factors, shapes: Array, square: Array, rtol: float, clean: bool, coupled: bool
) -> Undamped | None:
    """The result of the first solver if its a-priori bound suffices, inaccurate frequencies from the factors; or None.

    Rounding of M, of K, of A = L^-1 K L^-T and of its eigenvalues is a perturbation of A whose size in each mode is
    known a priori. The error of a frequency is of first order in it, that of the quotient |E| / |H| of second order.
    """
    power = shapes * shapes
    inertia, elastic = scene.mass.diagonal().dot(power), scene.stiffness.diagonal().dot(power) / square
    cancel = np.sqrt(inertia)
    bound = (square[-1] / square) * (1.0 + cancel) + inertia + elastic
    bound *= EPS * (PERTURBED + PERTURBED_MORE * math.sqrt(len(square)))
    drift = scene.drift
    bound += drift
    mixed = float(bound[bound.argmax()])
    if coupled and mixed <= (CLEAN if clean else MIXED):
        return Undamped(square, shapes, np.full(len(square), 2.0 * EPS + drift), 0, "products", 0.0, mixed)
    if mixed <= (min(rtol, CLEAN) if clean else CERTAIN * rtol):
        return Undamped(square, shapes, bound, 0, "products", 0.0, mixed)
    if clean or coupled:
        return None
    inaccurate = (bound > CERTAIN * rtol).nonzero()[0]
    every = len(inaccurate) == len(square)
    bound[inaccurate] = 2.0 * EPS + drift + (_crossed(bound * square, square) / square)[inaccurate]
    if float(bound[bound.argmax()]) > rtol:
        return None
    phi = shapes if every else shapes.take(inaccurate, axis=1)
    h, e = scene.w.dot(phi), scene.stretch(phi)
    mass, energy = h.T.dot(h).diagonal(), e.T.dot(e).diagonal()
    of_springs, of_masses = EPS * np.sqrt(elastic[inaccurate]) * energy, EPS * cancel[inaccurate]
    bound[inaccurate] += _rounding(scene.e, phi, e, of_springs, energy, rtol) / energy
    bound[inaccurate] += _rounding(scene.w, phi, h, of_masses, mass, rtol)
    square[inaccurate] = energy / mass
    shapes[:, inaccurate] = phi / np.sqrt(mass)
    if float(bound[bound.argmax()]) > rtol or (square[1:] < square[:-1]).any():
        return None
    return Undamped(square, shapes, bound, 0, "products", 0.0, mixed)


def _crossed(perturbation: Array, square: Array) -> Array:
    """Changes of squared frequencies by perturbations (m,) that mix modes: squares over the distance to the next."""
    gap = square[1:] - square[:-1]
    mixed = np.zeros(len(square) + 1)
    np.divide(np.maximum(perturbation[1:], perturbation[:-1]) ** 2, gap, out=mixed[1:-1], where=gap > 0.0)
    mixed[1:-1][gap <= 0.0] = np.inf
    return np.maximum(mixed[1:], mixed[:-1])


def refined(scene: Factors, shapes: Array, method: str, rtol: float) -> Undamped:
    """Return frequencies from the factors, orthonormalized shapes, and error estimates.

    ``shapes`` (m, m): approximate modes. ``rtol``: required relative accuracy of every frequency; decides how closely
    rounding is bounded.

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
    square, value, mixing, uncertainty = perturbed(inertia, elastic)
    size = np.abs(value)
    power = phi * phi
    # stiffness of both signs cancels: terms are larger than their sum, and those of loads are rounded by themselves
    energy = np.abs(square) if scene.sign is None else np.einsum("ij,ij->j", e, e)
    least = EPS * np.sqrt(energy * (scene.stiffness_diagonal @ power))
    noise = 2.0 * _rounding(scene.e, phi, e, least, size, rtol)
    flexible = np.arange(len(value)) >= rigid
    coupling, cancelled = 0.0, None
    if scene.sign is not None:
        noise += FORCES * EPS * energy
        whole = 2.0 * (size + noise)
        cancelled = flexible & (noise >= 2.0 * NONE * size)
        counts = flexible & ~cancelled & (whole > 0.0)  # what others do in a mode without any digit says nothing
        coupling = float(np.divide(uncertainty, whole, out=np.zeros_like(whole), where=counts).max())
    uncertainty += noise
    errors = np.divide(0.5 * uncertainty, size, out=np.where(flexible, np.inf, 0.0), where=flexible & (size > 0.0))
    largest_error = float(errors.max(initial=0.0))
    cheap = EPS * np.sqrt(scene.mass.diagonal() @ power)
    rounding = _rounding(scene.w, phi, h * length, cheap, np.ones(len(size)), rtol)
    errors += flexible * (2.0 * EPS + scene.drift + rounding)
    value[:rigid] = 0.0
    phi = cleaned(phi, inertia, mixing)
    if np.count_nonzero(value[1:] < value[:-1]):
        order = np.concatenate((np.arange(rigid), rigid + np.argsort(value[rigid:], kind="stable")))
        value, phi, errors = value[order], phi[:, order], errors[order]
        cancelled = None if cancelled is None else cancelled[order]
    return Undamped(value, phi, errors, rigid, method, largest_error, 0.0, coupling, cancelled)


def _rounding(rows: Array, phi: Array, image: Array, least: Array, size: Array, rtol: float) -> Array:
    """Half of the error of the sum of squares of each column of ``image`` = rows phi by rounding: ``least``, or a bound
    row by row where ``least`` is not small compared with ``size``.
    """
    large = (least > max(CLOSER, CERTAIN * rtol) * size).nonzero()[0]
    if len(large):
        every = len(large) == len(size)
        phi, image = (phi, image) if every else (phi[:, large], image[:, large])
        cancel = np.abs(rows) @ np.abs(phi)
        first, second = np.einsum("ij,ij->j", np.abs(image), cancel), np.einsum("ij,ij->j", cancel, cancel)
        least[large] = 0.5 * EPS * (first + EPS * second)
    return least


def perturbed(inertia: Array, elastic: Array) -> tuple[Array, Array, Array, Array]:
    """Return what M and K in a basis (..., m, m) say of its modes: the quotients |E|^2 of each and the squares of the
    frequencies (..., m); the share of each mode (row) in each other (column); and errors of the squares, (..., m).

    ``elastic`` is used up.
    """
    square = np.einsum("...ii->...i", elastic).copy()
    # row j, column i: projection of the residual of mode i on mode j, and from it the share of mode j in mode i
    shared = np.subtract(elastic, inertia * square[..., None, :], out=elastic)
    np.einsum("...ii->...i", shared)[...] = 0.0
    gap, uncertainty = square[..., None, :] - square[..., None], np.zeros(square.shape)
    together = np.abs(shared) > SEPARATE * np.abs(gap)
    if np.count_nonzero(together):
        at = *variant, _, column = together.nonzero()
        np.add.at(uncertainty, (*variant, column), shift_by_coupling(np.abs(shared[at]), np.abs(gap[at])))
        gap[at] = np.inf
    gap[gap == 0.0] = np.inf
    mixing = shared / gap
    corrections = np.multiply(mixing, shared, out=shared)
    value = square + corrections.sum(axis=-2)
    uncertainty += np.abs(corrections, out=corrections).sum(axis=-2)
    return square, value, mixing, uncertainty


def shift_by_coupling(coupling: Array, gap: Array) -> Array:
    """Return how far a coupling s >= 0 moves squared frequencies that are g >= 0 apart, (sqrt(g^2 + 4 s^2) - g) / 2.
    """
    twice = 2.0 * coupling
    return np.asarray(coupling * (twice / np.maximum(gap + np.hypot(gap, twice), np.finfo(float).tiny)))


def cleaned(phi: Array, inertia: Array, mixing: Array) -> Array:
    """Return shapes (..., m, m) with the other modes removed from each by a rotation, and the M-norms corrected."""
    angle = 0.5 * (mixing - mixing.swapaxes(-1, -2))
    lack, identity = 0.5 * inertia, np.eye(phi.shape[-1])
    np.einsum("...ii->...i", lack)[...] = 0.0
    size = np.sqrt(np.einsum("...ij,...ij->...", angle, angle))
    step = identity + angle
    step -= lack
    if np.count_nonzero(size * size > EPS):
        step += np.where(size * size > EPS, 0.5, 0.0)[..., None, None] * (angle @ angle)
    result: Array = phi @ step
    large = size >= SMALL_ANGLE
    if large.any():  # Cayley's rotation keeps the shapes orthonormal for any angle
        straight, half = phi[large] - phi[large] @ lack[large], 0.5 * angle[large]
        result[large] = straight @ np.linalg.solve(identity - half, identity + half)
    return result


def _without_rigid(scene: Factors, shapes: Array) -> Array:
    """Put the rigid-body modes first, drop as many of the others, and orthogonalize the rest to them."""
    null = scene.null
    assert null is not None
    share = np.einsum("ij,ij->j", *([null.T @ (scene.mass @ shapes)] * 2))
    flexible_columns = np.sort(np.argsort(share, kind="stable")[: shapes.shape[1] - null.shape[1]])
    flexible = shapes[:, flexible_columns]
    for _ in range(2):  # the second pass removes the rounding of the first
        flexible = flexible - null @ (null.T @ (scene.mass @ flexible))
    # with stiffness of both signs some columns are nearly rigid-body modes, and lose most of their length here
    flexible = flexible if scene.sign is None else orthonormal(scene.w, flexible)
    return np.concatenate((null, flexible), axis=1)
