"""First-order equations split into what decays and what does not, and whether outputs see inputs through the latter.

The states of a group of poles are decoupled from all others: x_g' = A_g x_g + B_g u, y = C_g x_g + .... The group is in
the response from input i to output o unless all Markov parameters C_g A_g^k B_g are zero there but for rounding. So it
is judged as a whole, in any states: a mode has two, and poles that coincide may cancel.

Rounding of A turns the subspaces of a group by up to eps ||A|| ||(lambda - A_r)^-1||, A_r the matrix of all others.
Source: Stewart & Sun, Matrix Perturbation Theory (1990), section V.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, schur, solve_sylvester

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.groups import by_label, part_numbers
from mbsvib.linalg.rank import EPS, POLE_ROUNDINGS
from mbsvib.linalg.spectrum import Spectrum, spectrum

# Rounding of a group's inputs and outputs above this share of them leaves open what is zero: nothing is, then.
UNCERTAIN = 1e-6


@dataclass(frozen=True, slots=True)
class Part:
    """States z = ``left`` x that are decoupled from all others, x = ``right`` z + ..., with their ``poles``.

    z' = ``a`` z + ``b`` u,  y = ``c`` z + ...; each with its bound of rounding, ``errors`` of the poles and of a, b, c.
    """

    left: Array
    right: Array
    poles: Complex
    a: Array
    b: Array
    c: Array
    errors: tuple[Array, Array, Array, Array]


@dataclass(frozen=True, slots=True)
class Lasting:
    """A group of poles that do not decay: ``part``, and in which responses they are, ``shown`` (outputs, inputs)."""

    part: Part
    shown: Bools

    @property
    def pole(self) -> complex:
        """One of the poles, 0 where it is 0 but for rounding."""
        k = int(np.argmax(self.part.poles.imag))
        value = complex(self.part.poles[k])
        return 0j if abs(value) <= self.part.errors[0][k] else value


@dataclass(frozen=True, slots=True)
class Separation:
    """First-order equations as the sum of what decays and of groups of poles that do not."""

    decaying: Part
    lasting: tuple[Lasting, ...]

    @property
    def shown(self) -> tuple[Lasting, ...]:
        """The groups that some response contains."""
        return tuple([group for group in self.lasting if group.shown.any()])

    @property
    def minimal(self) -> Part:
        """All states but those of groups that no response contains."""
        return _joined([self.decaying, *[group.part for group in self.shown]])


def separated(
    a: Array, b: Array, c: Array, lasts: Callable[[Spectrum], Bools] = lambda of_a: ~of_a.decaying
) -> Separation:  # fmt: skip
    """Return first-order equations, ``a`` (n, n), ``b`` (n, inputs), ``c`` (outputs, n), in parts.

    ``lasts``: tells which eigenvalues are those of groups that are judged, with their conjugates; default: those that
    do not decay in continuous time.
    """
    none = np.zeros((0, 0))
    decays = [Part(np.zeros((0, len(a))), np.zeros((len(a), 0)), np.zeros(0, dtype=complex), none, b[:0], c[:, :0],
                   (np.zeros(0), none, b[:0], c[:, :0]))]  # fmt: skip
    lasting: list[Part] = []
    for states in by_label(part_numbers(a != 0.0)):
        first, groups = _split(a[np.ix_(states, states)], b[states], c[:, states], (states, len(a)), lasts)
        decays.append(first)
        lasting += groups
    return Separation(_joined(decays), tuple([_judged(_joined(group)) for group in _same_poles(lasting)]))


def _split(
    a: Array, b: Array, c: Array, own: tuple[Index, int], lasts: Callable[[Spectrum], Bools]
) -> tuple[Part, list[Part]]:  # fmt: skip
    """The decaying part and each group of lasting poles of a matrix whose states are some of n, ``own``."""
    states, n = own
    power = exponents(a, b, c)
    ports = scaled_by(power, a, b, c)
    of_a = spectrum(a)
    size = float(np.linalg.norm(ports[0]))
    columns, rows = np.zeros((n, len(a))), np.zeros((len(a), n))
    columns[states], rows[:, states] = np.diag(np.ldexp(1.0, power)), np.diag(np.ldexp(1.0, -power))
    groups = of_a.clusters(lasts(of_a))
    label = np.full(len(a), -1)
    for k, group in enumerate(groups):
        label[group] = k
    parts = []
    for k in range(-1, len(groups)):
        at = label == k
        (left, right, inside), other, projection = _decoupled(ports[0], of_a, at)
        near = _resolvent(of_a.values[at], other) if k >= 0 else 0.0
        share = POLE_ROUNDINGS * EPS * (1.0 + size * projection * near)
        share = share if share < UNCERTAIN else 0.0
        errors = (of_a.errors[at], np.full(inside.shape, POLE_ROUNDINGS * EPS * size * projection),
                  share * np.outer(np.linalg.norm(left, axis=1), np.linalg.norm(ports[1], axis=0)),
                  share * np.outer(np.linalg.norm(ports[2], axis=1), np.linalg.norm(right, axis=0)))  # fmt: skip
        parts.append(Part(left @ rows, columns @ right, of_a.values[at], inside, left @ ports[1], ports[2] @ right,
                          errors))  # fmt: skip
    return parts[0], parts[1:]


def _decoupled(a: Array, of_a: Spectrum, own: Bools) -> tuple[tuple[Array, Array, Array], Array, float]:
    """Rows and columns that decouple the states of some eigenvalues, and A in them; A of all others; and the size of
    the projection on these states.
    """
    if own.all() or not own.any():
        rows = np.eye(len(a))[own]
        return (rows, rows.T, a[np.ix_(own, own)]), a[np.ix_(~own, ~own)], 1.0

    def chosen(re: float, im: float = 0.0) -> bool:
        return bool(own[np.abs(of_a.values - complex(re, im)).argmin()])

    form, basis, count = schur(a, sort=chosen)
    first, second = basis[:, :count], basis[:, count:]
    x = solve_sylvester(form[:count, :count], -form[count:, count:], -form[:count, count:])
    left = first.T - x @ second.T
    return (left, first, form[:count, :count]), form[count:, count:], float(np.linalg.norm(left, 2))


def _resolvent(values: Complex, a: Array) -> float:
    """The largest norm of (lambda - A)^-1 at some eigenvalues lambda of another matrix."""
    if not len(a):
        return 0.0
    stack = values[:, None, None] * np.eye(len(a)) - a
    least = float(np.linalg.svd(stack, compute_uv=False)[:, -1].min())
    return 1.0 / least if least else np.inf


def _same_poles(parts: list[Part]) -> list[list[Part]]:
    """Parts in groups whose poles rounding cannot tell apart."""
    near = np.zeros((len(parts), len(parts)), dtype=bool)
    for i, p in enumerate(parts):
        for j, q in enumerate(parts[:i]):
            near[i, j] = (np.abs(p.poles[:, None] - q.poles) <= p.errors[0][:, None] + q.errors[0]).any()
    return [[parts[k] for k in group] for group in by_label(part_numbers(near))] if parts else []


def _joined(parts: list[Part]) -> Part:
    """Several parts as one."""
    if len(parts) == 1:
        return parts[0]
    poles, errors = (np.concatenate(values) for values in zip(*[(p.poles, p.errors[0]) for p in parts], strict=True))
    a, a_error = (block_diag(*matrices) for matrices in zip(*[(p.a, p.errors[1]) for p in parts], strict=True))
    left, b, b_error = (np.concatenate(rows) for rows in zip(*[(p.left, p.b, p.errors[2]) for p in parts], strict=True))
    right, c, c_error = (np.concatenate(columns, axis=1) for columns in
                         zip(*[(p.right, p.c, p.errors[3]) for p in parts], strict=True))  # fmt: skip
    return Part(left, right, poles, a, b, c, (errors, a_error, b_error, c_error))


def _judged(part: Part) -> Lasting:
    """Tell in which responses a group of poles is, by its Markov parameters of unit speed."""
    _, a_error, b_error, c_error = part.errors
    speed = float(np.abs(part.a).max())
    unit = 1.0 / speed if (np.abs(part.a) > a_error).any() else 0.0
    reached, size, error = part.b, np.abs(part.b), b_error
    shown = np.zeros((len(part.c), part.b.shape[1]), dtype=bool)
    for _ in range(len(part.a)):
        shown |= np.abs(part.c @ reached) > c_error @ size + np.abs(part.c) @ error
        error = unit * (np.abs(part.a) @ error + a_error @ size)
        reached, size = unit * (part.a @ reached), unit * (np.abs(part.a) @ size)
    return Lasting(part, shown)
