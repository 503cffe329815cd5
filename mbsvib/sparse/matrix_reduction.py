"""Reduced models of sparse matrices: by modes, with a bound of the error of their frequency response, and by moments.

Damping C = alpha M + beta K leaves modes uncoupled. The modes left out, all above the cut, contribute
sum c_j b_j^T / omega_j^2 w_j, w = 1 / (1 - r^2 + 2 i zeta r), and w - 1 if their static part is in D. By Cauchy and
Schwarz its norm is at most max |w| sqrt(|R_c| |R_b|), where R_c = c (K^-1 - sum of retained modes) c^T is what they
contribute to the static compliance of the outputs, and R_b to that of the inputs. This needs no further mode.

Responses by moments are exact at some frequencies, with their derivatives. With P(s) = s^2 M + s C + K the motions
x_0 = P(s0)^-1 [B, H^T], x_j = -P(s0)^-1 (P'(s0) x_j-1 + M x_j-2) about s0 = 2 pi i f are Taylor's coefficients of the
motion under forces at the inputs and at the outputs. Matrices that are projected on their real and imaginary parts have
the same response at s0, and the same first 2 q - 1 derivatives with q coefficients; f = 0 is the static correction. One
basis for both sides keeps M, C and K symmetric and as definite as they were, so that the reduced system is stable, and
passive between collocated ports.

Source: Bai & Su, SIAM J. Sci. Comput. 26 (2005) 1692 (second-order Krylov subspaces); Beattie & Gugercin, Systems &
Control Letters 58 (2009) 225.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from scipy.linalg import null_space
from scipy.sparse import csc_matrix

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import AnyArray, Array, Complex
from mbsvib.common.expected import reals
from mbsvib.equations.equations import Equations, Truncation
from mbsvib.errors import ResponseError
from mbsvib.linalg.multifrontal import SymmetricFactor
from mbsvib.linalg.qr import extended
from mbsvib.linalg.rank import EPS, UNSYMMETRIC
from mbsvib.modes.undamped import undamped
from mbsvib.reduction.modal import independent_rows
from mbsvib.reduction.reduced import error_bound
from mbsvib.sparse.equations import SparseEquations, SparseMatrices
from mbsvib.sparse.from_matrices import matrices_of, motions_of, projected, quadratic_of
from mbsvib.sparse.matrix_subspace import flexible_static
from mbsvib.sparse.modes import SomeModes, modes
from mbsvib.sparse.reduction import RTOL

E = TypeVar("E", bound=Equations)

# What is left of a motion beside those before it, in parts of it, below which it is one of them.
REPEATED = 1e-9
# Modes that are asked for to find the free motions: six of a body, and one more.
FREE = 7
IDLE = 3


def krylov(system: SparseEquations, order: int, near: float | Sequence[float], form: type[E]) -> E:
    """Return the system of ``order`` motions that match moments about frequencies ``near`` [Hz], all in turn."""
    given, frequencies = matrices_of(system), _frequencies(near)
    ends = np.concatenate((system.input_rows.toarray(), *(rows.toarray() for rows in system.output_rows))).T
    ends = ends[:, ends.any(axis=0)]
    if not ends.shape[1]:
        raise ResponseError(f"reduced: '{system.name}' has no inputs and outputs, about which method = 'krylov' is. "
                            f"Take method = 'modal'.")  # fmt: skip
    free = _free(system, form)
    speed = quadratic_of(system).speed
    scale = max(2.0 * np.pi * max(frequencies), speed)
    metric = given.M + given.K / scale**2
    z = extended(free[:, :0], free, REPEATED, order, metric)
    series = [_Moments(given, 2j * np.pi * f, ends, speed) for f in frequencies if f or not free.shape[1]]
    if not series:
        raise ResponseError(f"reduced: near = {shown(near)} with method = 'krylov': '{system.name}' moves freely, and "
                            f"has no static response; expected frequencies above 0.")  # fmt: skip
    idle = 0  # undamped, every other coefficient about 0 is nothing; after more, these are all that inputs reach
    while z.shape[1] < order and idle < IDLE:
        before = z.shape[1]
        for one in series:
            block = one.next()
            z = extended(z, np.concatenate((block.real, block.imag), axis=1), REPEATED, order, metric)
        idle = idle + 1 if z.shape[1] == before else 0
    mass = z.T @ (given.M @ z)
    size, turn = np.linalg.eigh(0.5 * (mass + mass.T))
    if size[0] <= REPEATED * size[-1]:
        raise ResponseError(f"reduced: method = 'krylov': inputs or outputs of '{system.name}' are at coordinates "
                            f"without mass, whose motions alone have none; take method = 'static-corrected'.")
    root = turn / np.sqrt(size)
    return projected(system, _rotated(z @ root, given.K, free), free.shape[1], form)


def _rotated(z: Array, stiffness: Any, free: Array) -> Array:
    """The same span by its own modes of unit mass, the free motions first."""
    inner = z.T @ (stiffness @ z)
    turned = z @ np.linalg.eigh(0.5 * (inner + inner.T))[1]
    turned[:, : free.shape[1]] = free
    return np.asarray(turned)


def _frequencies(near: Any) -> list[float]:
    expected = "one or several frequencies [Hz], 0 or more, with method = 'krylov'"
    values = np.atleast_1d(reals(near, "reduced", "near", expected))
    if values.ndim > 1 or not len(values) or not np.isfinite(values).all() or (values < 0.0).any():
        raise ResponseError(f"reduced: near = {shown(near)}; expected {expected}.")
    return list(dict.fromkeys(values.tolist()))


def _free(system: SparseEquations, form: type[Equations]) -> Array:
    """Free motions (size, r) of unit mass."""
    found: Any = modes(system, min(FREE, system.dof), 0.0, form)
    basis = undamped(found.reduced, RTOL)
    return np.asarray((motions_of(found.reduced) @ basis.shapes)[:, : basis.rigid])


class _Moments:
    """Pairs (x_j, x_j-1 / speed) of Taylor's coefficients of the motion about s, orthonormal one against the other.

    Such pairs span what those of the coefficients themselves span, which would all turn to the nearest mode.
    """

    def __init__(self, given: Any, s: complex, ends: Array, speed: float) -> None:
        self.given, self.s, self.ends, self.speed = given, s, ends, speed
        try:
            self.factor = given.factor(s=s) if s else given.factor()
        except np.linalg.LinAlgError:
            raise ResponseError(f"reduced: method = 'krylov' about {abs(s) / 2 / np.pi:g} Hz, an undamped pole of "
                                f"'{given.name}'. Take a frequency beside it or 'modal'.") from None  # fmt: skip
        self.pairs = np.zeros((2 * len(ends), 0), dtype=complex if s else float)
        self.last = 0

    def next(self) -> Complex:
        """Return motions (size, k) that the next coefficients add."""
        n, given = len(self.ends), self.given
        if not self.pairs.shape[1]:
            x = self.factor.solve(self.ends.astype(self.pairs.dtype))
            block = np.concatenate((x, 0.0 * x))
        else:
            x, before = self.pairs[:n, self.last :], self.pairs[n:, self.last :] * self.speed
            right = given.C @ x + 2.0 * self.s * (given.M @ x) + given.M @ before
            block = np.concatenate((-self.factor.solve(right), x / self.speed))
        self.last = self.pairs.shape[1]
        self.pairs = extended(self.pairs, block, REPEATED)
        return self.pairs[:n, self.last :]


# Ports up to which static compliances between all of them are computed.
MOST_PORTS = 400
# The number of modes grows by this factor in the search for an error.
GROWTH = 1.6
# The search for an error ends at this number of modes.
MOST_MODES = 400
METHODS = ("modal", "static-corrected", "craig-bampton", "krylov")


def reduced_matrices(
    system: SparseEquations, order: int | None, error: float | None, method: str, form: type[E],
    near: float | Sequence[float] = 0.0,
) -> E:  # fmt: skip
    """Return the system of the class ``form`` with ``order`` coordinates, or of an ``error`` at most.

    ``near``: frequencies [Hz] about which "krylov" matches moments.
    """
    if (order is None) == (error is None) or method not in METHODS:
        raise ResponseError(f"reduced: order = {order}, error = {error}, method = {method!r}; expected one of order "
                            f"and error, and a method of 'balanced', {', '.join(map(repr, METHODS))}.")  # fmt: skip
    if method == "craig-bampton":
        return _craig_bampton(system, order, error, form)
    if method == "krylov":
        if order is None:
            raise ResponseError(f"reduced: error = {error} with method = 'krylov'; expected an order: the result "
                                f"has its error_bound.")  # fmt: skip
        return _compared(system, order, krylov(system, order, near, form), method)
    corrected = method == "static-corrected"
    most = min(MOST_MODES, system.dof)
    count = min(12, most) if order is None else order
    while True:
        truncation = _truncation(system, count, form)
        bounds = truncation.bounds(corrected)
        if order is not None or bounds[-1] <= (error or 0.0):
            break
        if not np.isfinite(bounds[-1]) or count == most:
            raise ResponseError(
                f"reduced: error = {error}; no bound of the error of '{system.name}' with up to {most} modes is "
                f"that small. It needs outputs of displacements alone, at most {MOST_PORTS} outputs and inputs, and "
                f"damping C = alpha M + beta K with beta > 0; take an order, and see truncation_error."
            )
        count = min(int(GROWTH * count) + 1, most)
    retained = count if error is None else int(np.argmax(bounds <= error))
    return truncation.model(max(retained, truncation.rigid), corrected, method, form)


@dataclass(frozen=True)
class _Modal:
    """The lowest modes ``shapes`` (size, n), with ``square`` of frequencies and static ``compliance`` of all flexible
    modes between outputs and inputs together (p, p), None if there are too many or no displacements alone.
    """

    system: SparseEquations
    shapes: Array
    square: Array
    rigid: int
    compliance: Array | None

    def bounds(self, corrected: bool) -> Array:
        """Return bounds of the error with the first 0, 1, ..., n modes."""
        n, rate = len(self.square), damping_rates(matrices_of(self.system))
        result = np.full(n + 1, np.inf)
        if self.compliance is None or rate is None or rate[1] <= 0.0:
            return result
        outputs = len(self.system.outputs)
        ports = _ports(self.system).T @ self.shapes
        for k in range(self.rigid, n + 1):
            used = slice(self.rigid, k)
            rest = self.compliance - (ports[:, used] / self.square[used]) @ ports[:, used].T
            sizes = [float(np.linalg.norm(part, 2)) + n * EPS * float(np.linalg.norm(whole, 2)) for part, whole in
                     ((rest[:outputs, :outputs], self.compliance[:outputs, :outputs]),
                      (rest[outputs:, outputs:], self.compliance[outputs:, outputs:]))]  # fmt: skip
            cut = float(np.sqrt(self.square[min(k, n - 1)]))
            at = max(cut, float(np.sqrt(max(rate[0], 0.0) / rate[1])))
            damping = 0.5 * (rate[0] / at + rate[1] * at) if at else 0.0
            if damping > 0.0:
                result[k] = largest_response(damping, corrected) * np.sqrt(sizes[0] * sizes[1])
        return result

    def model(self, count: int, corrected: bool, method: str, form: type[E]) -> E:
        """Return the model of the first modes."""
        small = projected(self.system, self.shapes[:, :count], self.rigid, form)
        if corrected:
            used = self.shapes[:, self.rigid : count]
            through = (small.Cq[:, self.rigid :] / self.square[self.rigid : count]) @ (used.T @ _inputs(self.system))
            small = replace(small, D=small.D + _static(self.system, self.shapes[:, : self.rigid]) - through)
        return with_bound(small, method, self.system.dof, float(self.bounds(corrected)[count]))


def with_bound(small: E, method: str, before: int, bound: float) -> E:
    """Return a reduced model with the bound of its error."""
    return replace(small, provenance=replace(small.provenance, truncation=Truncation(method, before, bound)))


def largest_response(damping: float, corrected: bool) -> float:
    """Return the maximum over r of |1 / (1 - r^2 + 2 i zeta r)|, or of that minus 1 if ``corrected``, in closed form.

    It falls with zeta. The latter is at r^2 = x, x^2 - x - 2 zeta^2 = 0.
    """
    if not corrected:
        return 1.0 if damping >= np.sqrt(0.5) else 1.0 / (2.0 * damping * float(np.sqrt(1.0 - damping**2)))
    a = 4.0 * damping**2
    x = 0.5 * (1.0 + float(np.sqrt(1.0 + 2.0 * a)))
    return float(np.sqrt(x * (x + a) / ((1.0 - x) ** 2 + a * x)))


def damping_rates(given: SparseMatrices) -> tuple[float, float] | None:
    """Return alpha and beta of C = alpha M + beta K; None if C is not so."""
    m, k = (matrix / np.abs(matrix.data).max(initial=1e-300) for matrix in (given.M, given.K))
    gram = np.array([[a.multiply(b).sum() for b in (m, k)] for a in (m, k)])
    force = np.array([a.multiply(given.C).sum() for a in (m, k)])
    x = np.linalg.lstsq(gram, force, rcond=None)[0]
    rest = given.C - x[0] * m - x[1] * k
    if np.abs(rest.data).max(initial=0.0) > UNSYMMETRIC * np.abs(given.C.data).max(initial=0.0):
        return None
    largest = [np.abs(matrix.data).max(initial=1e-300) for matrix in (given.M, given.K)]
    return float(x[0] / largest[0]), float(x[1] / largest[1])


def _inputs(system: SparseEquations) -> Array:
    return np.asarray(system.input_rows.toarray().T)


def _ports(system: SparseEquations) -> Array:
    """Rows of displacement outputs, then of inputs, as columns (size, p)."""
    return np.concatenate((system.output_rows[0].toarray().T, _inputs(system)), axis=1)


def _static(system: SparseEquations, rigid: Array) -> Array:
    motion = flexible_static(system, rigid, _inputs(system))
    if motion is None:
        raise ResponseError(f"reduced: free motions of '{system.name}' are missing among its lowest modes, and have no "
                            f"static part; ask for more modes, or for method='modal'.")  # fmt: skip
    return np.asarray(system.output_rows[0] @ motion)


def _truncation(system: SparseEquations, count: int, form: type[Equations]) -> _Modal:
    """The ``count`` lowest modes, and static compliances."""
    found: SomeModes = modes(system, count, 0.0, form)
    small = found.reduced
    basis = undamped(small, RTOL)
    shapes = motions_of(small) @ basis.shapes
    compliance = None
    displacements = not any(rows.nnz for rows in system.output_rows[1:])
    if displacements and len(system.outputs) + len(system.inputs) <= MOST_PORTS:
        motion = flexible_static(system, shapes[:, : basis.rigid], _ports(system))
        compliance = None if motion is None else _ports(system).T @ motion
    return _Modal(system, shapes, basis.square, basis.rigid, compliance)


@dataclass(frozen=True)
class HeldMatrices(SparseMatrices):
    """Matrices whose interface displacements ``rows`` (r, n) are held at zero.

    K has springs on the interface, which do nothing then, so that it is regular.
    """

    rows: Array

    def factor(self, square: float = 0.0, s: complex = 0.0, pivot: float | None = None) -> Any:
        """Factor K + s C + (s^2 - square) M for motions that leave the interface at rest."""
        factor = SparseMatrices.factor(self, square, s, pivot)
        toward = factor.solve(self.rows.T)
        return HeldFactor(factor, self.rows, toward, self.rows @ toward)

    def motions(self) -> Array:
        """Return a basis of the motions that leave the interface at rest."""
        return np.asarray(null_space(self.rows))


@dataclass(frozen=True)
class HeldFactor:
    """A ``factor`` of A, and the interface ``rows`` R with A^-1 R^T and ``flexibility`` F = R A^-1 R^T."""

    inner: SymmetricFactor
    rows: Array
    toward: Array
    flexibility: Array

    def shapes(self) -> Array:
        """Return the motions with unit interface displacements, A^-1 R^T F^-1."""
        return np.asarray(np.linalg.solve(self.flexibility.T, self.toward.T).T)

    def solve(self, right: AnyArray, refinements: int = 1, transposed: bool = False) -> AnyArray:
        """Return x with R x = 0 and A x = right but for forces on the interface."""
        x = self.inner.solve(right, refinements, transposed)
        return np.asarray(x - self.shapes() @ (self.rows @ x))

    def negative(self, layout: object = None) -> int:
        """Return the negative eigenvalues of A on the motions at rest: In [A R^T; R 0] = In A + In -F."""
        positive = int(np.count_nonzero(np.linalg.eigvalsh(0.5 * (self.flexibility + self.flexibility.T)) > 0.0))
        return self.inner.negative(layout) + positive - len(self.rows)


def _interface(system: SparseEquations) -> tuple[Array, list[str]]:
    """Independent rows (r, n) of displacement outputs, then of inputs, with names."""
    names = [*system.outputs, *[f"at {name}" for name in system.inputs]]
    ports = _ports(system).T
    if len(ports) > MOST_PORTS:
        raise ResponseError(f"reduced: method = 'craig-bampton' of '{system.name}' with {len(ports)} outputs and "
                            f"inputs; expected at most {MOST_PORTS}: take those of the interface, "
                            f"system[outputs, inputs].")  # fmt: skip
    retained = independent_rows(ports)
    return ports[retained], [names[k] for k in retained]


def _craig_bampton(system: SparseEquations, order: int | None, error: float | None, form: type[E]) -> E:
    """Displacements of the interface, and modes with these held; the error by way of a modal model with a bound."""
    rows, names = _interface(system)
    given = matrices_of(system)
    if error is not None or order is None or order <= len(rows):
        raise ResponseError(f"reduced: order = {order}, error = {error} with method = 'craig-bampton'; expected an "
                            f"order above {len(rows)}, the coordinates of the interface of '{system.name}': the result "
                            f"has its error_bound.")  # fmt: skip
    weight = (rows**2 @ np.abs(given.K.diagonal())) / np.square(rows).sum(axis=1) ** 2
    springs = csc_matrix(rows.T) @ (csc_matrix(rows * weight[:, None]))
    matrices = HeldMatrices(given.name, given.M, given.C * 0.0, (given.K + springs).tocsc(), rows)
    tableau: Any = matrices
    held = replace(system, matrices=matrices, tableau=tableau,
                   layout=replace(system.layout, multiplier=np.arange(len(rows))))  # fmt: skip
    count = order - len(rows)
    with_interface_held: SomeModes = modes(held, count, 0.0, form)
    if with_interface_held.rigid:
        raise ResponseError(f"reduced: method = 'craig-bampton': '{system.name}' can still move when its outputs and "
                            f"the points of its inputs are held ({', '.join(names[:8])}). Add displacement outputs, or "
                            f"take method='modal'.")  # fmt: skip
    static, fixed = matrices.factor().shapes(), motions_of(with_interface_held.reduced)
    labels = (*names, *[f"fixed_mode{k + 1}" for k in range(count)])
    small = replace(projected(system, np.concatenate((static, fixed), axis=1), 0, form), coordinates=labels)
    return _compared(system, order, small, "craig-bampton")


def _compared(system: SparseEquations, order: int, small: E, method: str) -> E:
    """A model with the bound of its error, by way of a modal one of twice the order that has a bound."""
    reference = reduced_matrices(system, min(2 * order, system.dof), None, "static-corrected", type(small))
    bound = (reference.error_bound or 0.0) + error_bound(reference, small)
    return with_bound(small, method, system.dof, bound)
