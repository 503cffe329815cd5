"""Transmission zeros: values of s at which some input and motion give zero output.

The invariant zeros are the finite s at which [[K + s C + s^2 M, -B], [Cq + s Cv + s^2 Ca, D]] loses rank. In energy
coordinates orthogonal transformations deflate the infinite zeros, level by level, until the feedthrough of the reduced
system is regular; the zeros are eigenvalues of a matrix. No polynomial is formed. Each zero is then
improved by Newton steps on the sum over modes, which has its full relative accuracy also where frequencies span many
decades.

Source: Emami-Naeini & Van Dooren, Automatica 18 (1982).

The transfer matrix by solving, not by modes: for zeros near repeated eigenvalues, where modal sums cancel.

Rounding of transfer matrices at their zeros, and which zeros are determined despite it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import compress
from typing import Any

import numpy as np
from scipy.linalg import schur, solve_triangular

from mbsvib.common.arrays import AnyArray, Array, Bools, Complex
from mbsvib.common.selection import Names, selected
from mbsvib.equations.equations import Equations
from mbsvib.linalg.rank import EPS
from mbsvib.modes.damped import Damped
from mbsvib.modes.general import General
from mbsvib.responses.basis import Basis
from mbsvib.responses.finite_zeros import POINTS, finite_zeros, port_sizes, refuse_none
from mbsvib.responses.general_terms import cleaned
from mbsvib.responses.modal_sum import ModalSum, modal_sum

# Infinite zeros may come out finite if the deflation is ill-conditioned, for example along a chain of many masses. A
# value is a zero of the transfer matrix only if that grows a thousandfold within a quarter of the way to the nearest
# pole. Otherwise the transfer matrix is far from zero there, or it is rounding of its terms.
GROWTH = 1e3
COARSE = 0.25
AT_POLE = 1e-6  # zeros so near to a pole are those of uncontrollable or unobservable modes


def determined_zeros(
    modal: Damped | General, total: ModalSum | Resolvent, z: Complex, noise: Array, rank: int
) -> Bools:
    """Tell which zeros are determined despite rounding; ``rank``: normal rank of the transfer matrix."""
    if not len(z):
        return np.zeros(0, dtype=bool)
    distance = np.abs(z[:, None] - np.unique(modal.pairs)).min(axis=1)
    size = np.abs(z)
    offset = COARSE * distance * np.where(size > 0.0, z / np.where(size > 0.0, size, 1.0), 1.0)
    with np.errstate(all="ignore"):
        value, left, right = smallest_singular_value(total.at(z), rank)
        change = np.abs(np.einsum("no,oin,ni->n", left.conj(), total.at(z + offset), right))
        rounding = np.einsum("no,oin,ni->n", np.abs(left), noise, np.abs(right))
        clear = change > GROWTH * np.maximum(value, rounding)
    return np.asarray(clear | (distance <= AT_POLE * size) | (size == 0.0))


def transfer_rounding(
    system: Equations, modal: Damped | General, total: ModalSum | Resolvent, ports: tuple[list[int], list[int]],
    z: Complex,
) -> Array:
    """Return the rounding of the transfer matrix at the points z, (outputs, inputs, n).

    That of a sum over modes is the rounding of the largest entry of each vector.
    """
    if not isinstance(total, ModalSum):
        return total.noise(z)
    sources, results = ports
    result = np.zeros((len(results), len(sources), len(z)))
    with np.errstate(all="ignore"):
        if isinstance(modal, Damped):
            right: AnyArray = modal.shapes
            left: AnyArray = modal.shapes
            down = 1.0 / np.abs((z - modal.pairs[:, :1]) * (z - modal.pairs[:, 1:]))
        else:
            values, right, left, slopes = modal.spectrum.complete()
            left, down = left / slopes, 1.0 / np.abs(z - values[:, None])
        b = np.abs(left.T @ system.B[:, sources])
        highest = b.max(axis=0, initial=0.0)
        for order, rate in enumerate((system.Cq, system.Cv, system.Ca)):
            c = np.abs(rate[results] @ right)
            terms = np.einsum("om,i->oim", c, highest) + np.einsum("o,mi->oim", c.max(axis=1, initial=0.0), b)
            result += np.tensordot(terms, down, axes=1) * np.abs(z) ** order
    return EPS * result


def smallest_singular_value(matrices: Complex, rank: int) -> tuple[Array, Complex, Complex]:
    """Return the singular value (n,) number ``rank`` of matrices (outputs, inputs, n), with its vectors (n, ...)."""
    stack = matrices.transpose(2, 0, 1)
    good: Bools = np.asarray(np.isfinite(stack).all(axis=(1, 2)))
    u, s, v = np.linalg.svd(np.where(good[:, None, None], stack, 0.0), full_matrices=False)
    return np.where(good, s[:, rank - 1], np.nan), u[:, :, rank - 1], v[:, rank - 1, :].conj()


# A Newton step that changes a zero by more than this share does not correct rounding errors.
CORRECTION, NEWTON_STEPS = 1e-3, 4
# A Newton step towards m zeros that coincide leaves (1 - 1/m)^m of the transfer matrix, at most 1/e; where a pole
# cancels a zero there is none of both, and a step leads along what the others leave.
FALLEN = 0.5
SECANT = 1e-4  # distance of the secant's points, as a share of that to the nearest pole
# Zeros at 0 are within these shares of the lowest pole, two of them by the square root of rounding and more of them by
# higher roots; they are at 0 if the static response is zero to rounding.
AT_REST, MULTIPLE, STATIC_ROUNDINGS = 1e-5, 1.0, 30.0
CLOSER = np.array([1e-2, 1e-3])  # points, in parts of the lowest pole, where growth indicates a pole at 0
GROWS = 3.0
# Computed zeros at 0 are within these shares of the lowest pole: n of them spread by the n-th root of rounding.
NEAR_ORIGIN = tuple(10.0**-power for power in range(-2, 6))
# If a power differs from an integer by more, some zeros are near 0 but not at 0.
INTEGER_POWER = 0.1


def transmission_zeros(basis: Basis, outputs: Names = None, inputs: Names = None) -> Complex:
    """Return the finite s at which [[K + s C + s^2 M, -B], [Cq + s Cv + s^2 Ca, D]] has less than its normal rank.

    In ascending magnitude. An uncontrollable or unobservable mode is one too: exactly, or up to double precision, such
    as a mode localized far along a chain from both.
    """
    system, modal = basis.equations, basis.modal
    sources, results = numbers(system, "input", inputs), numbers(system, "output", outputs)
    if not system.dof or not sources or not results:
        return np.zeros(0, dtype=complex)
    a, b, c, d, at_zero, unit = _realized(system, modal, sources, results)
    found = finite_zeros(a, b, c, d)
    if not found.rank:
        refuse_none([system.outputs[k] for k in results], [system.inputs[k] for k in sources], system.name)
    zeros, rank = found.zeros * unit, found.rank
    sources, results = [*compress(sources, found.columns)], [*compress(results, found.rows)]
    system = _of_unit_size(system, modal, (sources, results), unit)
    total = _transfer(system, modal, (sources, results), zeros)
    zeros = _refined(modal, total, zeros, rank)
    zeros = _at_rest(system, modal, total, zeros, (sources, results), at_zero, rank)
    if isinstance(total, ModalSum) or total.finite_zeros() != len(zeros) + at_zero:
        rounding = transfer_rounding(system, modal, total, (sources, results), zeros)
        zeros = zeros[determined_zeros(modal, total, zeros, rounding, rank)]
    zeros = np.concatenate((np.zeros(at_zero), zeros))
    return zeros[np.lexsort((-zeros.imag, np.abs(zeros)))]


def numbers(system: Equations, kind: str, names: Names) -> list[int]:
    """Return the numbers of the named inputs or outputs (``kind``); None: of all."""
    known, others = (system.inputs, system.outputs) if kind == "input" else (system.outputs, system.inputs)
    return selected(names, known, kind, system.name, others)


def _realized(
    system: Equations, modal: Damped | General, sources: list[int], results: list[int]
) -> tuple[Array, Array, Array, Array, int, float]:
    """A, B, C, D in energy coordinates, in units of the highest frequency and all of unit size; how many zeros at 0
    were left out: a velocity is a displacement times s, and a square system has just one zero more; and the unit.
    """
    d = system.D[np.ix_(results, sources)].copy()
    cq, cv, ca = (c[results] for c in (system.Cq, system.Cv, system.Ca))
    at_zero = 0
    if len(sources) == len(results):
        for i in range(len(results)):
            if not cq[i].any() and not d[i].any() and cv[i].any() + ca[i].any() == 1:
                at_zero += 1 if cv[i].any() else 2
                cq[i], cv[i], ca[i] = cv[i] + ca[i], 0.0, 0.0
    matrices = {"Cq": cq, "Cv": cv, "Ca": ca, "D": d}
    speeds = np.sqrt(np.abs(modal.square)) if isinstance(modal, Damped) else modal.state.scale
    unit = float(speeds.max(initial=0.0)) or 1.0
    return (*_even(_in_energy(system, modal, (sources, results), matrices), unit), at_zero, unit)


def _in_energy(
    system: Equations, modal: Damped | General, ports: tuple[list[int], list[int]], matrices: dict[str, Any]
) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D in energy coordinates from some inputs to some outputs, with matrices of these outputs."""
    sources, results = ports
    if not isinstance(modal, Damped):
        from mbsvib.responses.general_responses import realization

        part = replace(system, B=system.B[:, sources], inputs=tuple([system.inputs[i] for i in sources]),
                       outputs=tuple([system.outputs[i] for i in results]), **matrices)  # fmt: skip
        equations = realization(part, modal.state)
        return equations.a, equations.b, equations.c, equations.d
    from mbsvib.responses.energy_schur import energy_matrix

    scale, a = energy_matrix(modal)
    b, d = modal.shapes.T @ system.B[:, sources], matrices["D"]
    cq, cv, ca = (matrices[name] @ modal.shapes for name in ("Cq", "Cv", "Ca"))
    gamma = ca * modal.gamma if modal.gamma.ndim == 1 else ca @ modal.gamma
    c = np.concatenate(((cq - ca * modal.square) / scale, cv - gamma), axis=1)
    return a, np.concatenate((np.zeros_like(b), b)), c, cleaned(ca, b, direct=d)


def _even(equations: tuple[Array, Array, Array, Array], highest: float) -> tuple[Array, Array, Array, Array]:
    """Bring A, B, C, D to units of the highest frequency and to unit size."""
    a, b, c, d = equations
    input_norm, output_norm = np.linalg.norm(b, axis=0) / highest, np.linalg.norm(c, axis=1)
    input_norm[input_norm == 0.0] = output_norm[output_norm == 0.0] = 1.0
    return a / highest, b / highest / input_norm, c / output_norm[:, None], d / output_norm[:, None] / input_norm


def _of_unit_size(
    system: Equations, modal: Damped | General, ports: tuple[list[int], list[int]], unit: float
) -> Equations:
    """The system with ports in units in which the transfer matrix is of unit size: powers of two, without rounding."""
    sources, results = ports
    point = np.array([POINTS[0] * unit])
    sizes = port_sizes(_transfer(system, modal, ports, point).at(point)[:, :, 0])
    rows, columns = np.ones(len(system.outputs)), np.ones(len(system.inputs))
    rows[results], columns[sources] = (np.exp2(-np.round(np.log2(size))) for size in sizes)
    rates = {name: getattr(system, name) * rows[:, None] for name in ("Cq", "Cv", "Ca")}
    return replace(system, B=system.B * columns, D=system.D * rows[:, None] * columns, **rates)


def _refined(modal: Damped | General, total: ModalSum | Resolvent, zeros: Complex, rank: int) -> Complex:
    """Improve each zero as long as the smallest singular value of the transfer matrix falls by half or more."""
    undamped = isinstance(modal, Damped) and not modal.gamma.any()
    z = zeros.copy()
    if undamped:  # on one of the axes, unless four of them lie around the origin
        z.real[np.abs(z.real) <= CORRECTION**2 * np.abs(z.imag)] = 0.0
    poles = np.unique(modal.pairs)
    with np.errstate(all="ignore"):
        value = smallest_singular_value(total.at(z), rank)[0]
        for _ in range(NEWTON_STEPS):
            distance = np.abs(z[:, None] - poles).min(axis=1)
            offset = SECANT * distance * np.where(z != 0.0, z / np.abs(z), 1.0)
            matrix, shifted = total.at(z), total.at(z + offset)
            size, left, right = smallest_singular_value(matrix, rank)
            change = np.einsum("no,oin,ni->n", left.conj(), shifted - matrix, right)
            new = z - offset * (size / change)
            if undamped:
                new.real[z.real == 0.0] = 0.0
            new.imag[z.imag == 0.0] = 0.0
            better = np.abs(new - z) <= CORRECTION * np.abs(z)
            then = smallest_singular_value(total.at(new), rank)[0]
            better &= then < FALLEN * value
            if not better.any():
                break
            z, value = np.where(better, new, z), np.where(better, then, value)
    return z


def _at_rest(
    system: Equations, modal: Damped | General, total: ModalSum | Resolvent, z: Complex,
    ports: tuple[list[int], list[int]], at_zero: int, rank: int,
) -> Complex:  # fmt: skip
    """Set zeros next to 0 to 0 if the static response is zero to rounding, or if poles at 0 do not appear in it:
    uncontrollable or unobservable rigid-body modes. ``at_zero`` of the zeros at 0 are left out.
    """
    poles = modal.pairs.reshape(-1) if isinstance(modal, Damped) else modal.values
    size, square = np.abs(poles), len(ports[0]) == len(ports[1])
    if not size.all():
        lowest = float(size[size > 0.0].min(initial=np.inf))
        if not np.isfinite(lowest):
            return z
        if square:
            known = determined_zeros(modal, total, z, transfer_rounding(system, modal, total, ports, z), rank)
            return _of_determinant(total, poles, (z, known), lowest, at_zero)
        near = np.abs(z) <= AT_REST * lowest
        if near.any():
            with np.errstate(all="ignore"):
                farther, nearer = np.abs(total.at(1j * lowest * CLOSER)).max(axis=(0, 1))
            return np.where(near, 0.0, z) if nearer < GROWS * farther else z
        return z
    lowest = float(size.min())
    if np.any(np.abs(z) <= (MULTIPLE if square else AT_REST) * lowest):
        origin = np.zeros(1, dtype=complex)
        value, left, right = smallest_singular_value(total.at(origin), rank)
        rounding = transfer_rounding(system, modal, total, ports, origin)
        noise = np.einsum("no,oin,ni->n", np.abs(left), rounding, np.abs(right))
        if value[0] <= STATIC_ROUNDINGS * noise[0]:
            z = np.where(np.abs(z) <= AT_REST * lowest, 0.0, z)
            return _of_determinant(total, poles, (z, z == 0.0), lowest, at_zero) if square else z
    return z


def _of_determinant(
    total: ModalSum | Resolvent, poles: Complex, zeros: tuple[Complex, Bools], lowest: float, at_zero: int
) -> Complex:
    """Set as many zeros of a square system to 0 as follow from its determinant, c s^(zeros - poles) near 0.

    Poles and zeros elsewhere, and those near 0 that are known, are divided out, so that the power is a whole number at
    any points near 0.
    """
    z, known = zeros
    with np.errstate(all="ignore"):
        s = 1j * lowest * CLOSER
        size = np.log(np.abs(np.linalg.det(total.at(s).transpose(2, 0, 1))))
        size = size + np.log(np.abs(s[:, None] - poles[poles != 0.0])).sum(axis=1)
        for share in NEAR_ORIGIN:
            far = z[(np.abs(z) > share * lowest) | known & (z != 0.0)]
            logarithms = size - np.log(np.abs(s[:, None] - far)).sum(axis=1)
            power = (logarithms[0] - logarithms[1]) / np.log(CLOSER[0] / CLOSER[1])
            count = np.round(power) + np.count_nonzero(poles == 0.0) - at_zero
            if np.abs(power - np.round(power)) < INTEGER_POWER and count == len(z) - len(far):
                return np.concatenate((np.zeros(int(count)), far))
    return z


def _transfer(
    system: Equations, modal: Damped | General, ports: tuple[list[int], list[int]], z: Complex
) -> ModalSum | Resolvent:
    """The transfer matrix as a sum over modes, or by solving where eigenvalues meet so that there is no such sum."""
    from mbsvib.responses import frequency_response, general_responses

    sources, results = ports
    if isinstance(modal, Damped):
        forces = modal.shapes.T @ system.B[:, sources]
        by_modes = modal.vectors is None or frequency_response.trusted(modal, forces, np.abs(z))
    else:
        by_modes = general_responses.trusted(modal, modal.state.basis.T @ system.B[:, sources], np.abs(z))
    if by_modes:
        return modal_sum(system, modal, sources, results)
    matrices = {name: getattr(system, name)[results] for name in ("Cq", "Cv", "Ca")}
    return Resolvent.of(*_in_energy(system, modal, ports, matrices | {"D": system.D[np.ix_(results, sources)]}))


# The power of s far above all poles is determined at these multiples of |A|; it must be an integer within OFF, from
# singular values that exceed rounding by CLEAR.
FAR = np.array([1e3, 1e4])
OFF, CLEAR = 0.1, 1e3


@dataclass(frozen=True, slots=True)
class Resolvent:
    """G(s) = C (s - T)^-1 B + D with T upper triangular, A = Q T Q^H."""

    t: Complex
    b: Complex
    c: Complex
    d: Array

    @classmethod
    def of(cls, a: Array, b: Array, c: Array, d: Array) -> Resolvent:
        """Return that of x' = A x + B u, y = C x + D u."""
        t, q = schur(a, output="complex")
        return cls(t, q.conj().T @ b, c @ q, d)

    def at(self, s: Complex) -> Complex:
        """Return G at the points ``s`` (n,), shape (outputs, inputs, n)."""
        result = np.empty((*self.d.shape, len(s)), dtype=complex)
        for i, point in enumerate(s.tolist()):
            value = self.c @ self._states(complex(point.real, abs(point.imag))) + self.d
            result[..., i] = value.conj() if point.imag < 0.0 else value  # exactly so, as zeros are conjugate
        return result

    def noise(self, s: Complex) -> Array:
        """Return a bound of the rounding of G, shape (outputs, inputs, n).

        |dG| <= eps (|s| + |A|) |C R| |R B|, R = (s - A)^-1: solutions are exact for a change of A by rounding
        """
        size = float(np.linalg.norm(self.t))
        result = np.empty((*self.d.shape, len(s)))
        for i, point in enumerate(s.tolist()):
            output_gain = np.linalg.norm(np.abs(self._solved(point, self.c.T, 1)), axis=0)
            input_gain = np.linalg.norm(np.abs(self._states(point)), axis=0)
            result[..., i] = EPS * ((abs(point) + size) * np.outer(output_gain, input_gain) + np.abs(self.d))
        return result

    def _states(self, point: complex) -> Complex:
        return self._solved(point, self.b, 0)

    def _solved(self, point: complex, right: Complex, trans: int) -> Complex:
        """(s - T)^-1 or, with ``trans`` = 1, (s - T)^-T times a right side; infinite at an eigenvalue."""
        matrix = point * np.eye(len(self.t)) - self.t
        if not np.isfinite(point) or not matrix.diagonal().all():
            return np.full(right.shape, np.inf, dtype=complex)
        return np.asarray(solve_triangular(matrix, right, trans=trans))

    def finite_zeros(self) -> int | None:
        """Return the number of finite zeros of a square system: that of its states, minus the power of s by which its
        determinant decreases far above all poles and zeros; None if it is not square or the determinant is rounding.
        """
        if len(self.d) != self.d.shape[1]:
            return None
        s = 1j * float(np.linalg.norm(self.t)) * FAR
        stack = self.at(s).transpose(2, 0, 1)
        least = np.linalg.svd(stack, compute_uv=False)[:, -1]
        if (least <= CLEAR * np.linalg.norm(self.noise(s), axis=(0, 1))).any():
            return None
        size = np.log(np.abs(np.linalg.det(stack)))
        power = float((size[0] - size[1]) / np.log(FAR[1] / FAR[0]))
        return len(self.t) - round(power) if abs(power - round(power)) < OFF else None
