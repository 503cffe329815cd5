"""Uncertain parameters of a system as further inputs and outputs, w = d z, each as often as its rank.

(M + d dM) q'' + (C + d dC) q' + (K + d dK) q = (B + d dB) u,  y likewise: the change of a parameter by d adds
d D (q'', q', q, u), with D = [dM dC dK -dB; dCa dCv dCq dD] = L R^T of least rank. So z = R^T (q'', q', q, u), and w
acts through -L on the equations and L on the outputs: a spring enters once, also where its force is an output, a mass
by the rank of its motion.

Changes that are no straight lines, such as those by places, are polynomials of a stated order, the sum over k of D_k
d^k = L d (1 - N d)^-1 R^T with L N^(k-1) R^T = D_k, from the factors of the block Hankel matrix of D_1, D_2, ...;
products of two parameters, L d d' R^T, pass through a channel of one behind that of the other.

Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 10.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Index
from mbsvib.equations.entry_scales import EntryScales
from mbsvib.equations.matrices import MATRICES
from mbsvib.errors import ModelError
from mbsvib.linalg.rank import EPS, NOT_AFFINE, ZERO_BLOCK
from mbsvib.uncertain.scalings import balancing

# Roundings of the largest entry of a matrix that one linearized anew may be off
ROUNDINGS = 1e3
# Frequencies, in parts of a typical pole, at which the sizes of signals are compared
OFF_POLES = np.array([0.013, 0.71, 1.37, 29.0])
# Values at random at which polynomials are compared, and the largest share of the change that they may miss
CHECKED, COARSE = 12, 0.1
# Ends of the names of inputs w and outputs z
CHANGE, SEEN = ".w", ".z"


@dataclass(frozen=True, eq=False)
class Block:
    """An uncertain parameter: its ``nominal`` value, limits ``low`` and ``high``, number of ``repetitions``, and
    whether it is ``inertial``: accelerations drive it, and it acts on the equations of motion only.
    """

    name: str
    unit: str
    nominal: float
    low: float
    high: float
    repetitions: int
    inertial: bool

    @property
    def half(self) -> float:
        """Half the width, the unit of changes."""
        return 0.5 * (self.high - self.low)

    @property
    def changes(self) -> tuple[float, float]:
        """Changes to the lower and the upper limit, in units of half the width."""
        return (self.low - self.nominal) / self.half, (self.high - self.nominal) / self.half


def ranges(system: Any, limits: Mapping[str, Any]) -> dict[str, tuple[float, float, float]]:
    """Return nominal value, lower and upper limit of each parameter that is uncertain, by name.

    ``limits``: by name or pattern, half the width relative to the nominal value, or a pair (lower, upper).
    """
    check.mapping("uncertain", "limits", limits, "parameters with limits, {'leg*.k.stiffness': 0.1, "
                  "'payload.mass': (9.0, 12.0)}")  # fmt: skip
    known = system.parameters
    result: dict[str, tuple[float, float, float]] = {}
    for pattern, value in limits.items():
        for name in known.matching(pattern):
            if name != pattern and (name in limits or name in result):
                if name in limits:
                    continue
                raise ModelError(f"uncertain: two patterns match '{name}', the second is '{pattern}'; name it by "
                                 f"itself too, which goes before patterns.", element=name)  # fmt: skip
            result[name] = _limits(name, float(known[name]), value)
    return result


def _limits(name: str, nominal: float, value: Any) -> tuple[float, float, float]:
    expected = "half its width relative to the nominal value, 0.1, or (lower, upper)"
    if isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
        half = float(value)
        if not 0.0 < half < np.inf:
            raise check.refuse("uncertain", name, value, expected)
        if half > 1.0:
            raise check.refuse("uncertain", name, value, expected, "0.1 is 10 %; more than 1 changes its sign.")
        if nominal == 0.0:
            raise ModelError(f"uncertain: '{name}' is 0, so that a relative width means nothing; give "
                             f"(lower, upper).", element=name)  # fmt: skip
        return nominal, nominal - half * abs(nominal), nominal + half * abs(nominal)
    low, high = check.numbers(value, (2,), "uncertain", name, expected)
    if not low < nominal < high:
        raise ModelError(f"uncertain: '{name}' = {nominal:g} is not within its limits ({low:g}, {high:g}); expected "
                         f"limits on both sides of the value that the model has.", element=name)  # fmt: skip
    return nominal, low, high


class Channels(NamedTuple):
    """``left`` (m + outputs, r) of w, ``right`` (3 m + inputs, r) of z, and ``inner`` (r, r) from w to z."""

    left: Array
    right: Array
    inner: Array


def with_blocks(
    system: Any, found: Mapping[str, tuple[float, float, float]], vary: Callable[[Mapping[str, float]], Any], order: int
) -> tuple[Any, tuple[Block, ...], float]:  # fmt: skip
    """Return a system with inputs w and outputs z of its uncertain parameters first, these parameters, and the error.

    ``vary`` returns the system with other values of parameters. Of order 1 what is not affine in them is refused.
    """
    if order > 1:
        parts, error = _polynomials(system, found, vary, order)
    else:
        slopes, error = system.matrix_derivatives(list(found)), 0.0
        parts = {(k,): _factors(system, [0.5 * (found[name][2] - found[name][1]) * _joined(slopes, k)], name)
                 for k, name in enumerate(found)}  # fmt: skip
        _check_affine(system, slopes, found, vary)
    known, blocks = system.parameters, []
    owner = np.array([k for key, part in parts.items() for k in np.repeat(key, len(part.inner) // len(key))])
    chosen = np.argsort(owner, kind="stable")
    left, right = (np.concatenate([getattr(part, key) for part in parts.values()], axis=1)[:, chosen] for key in
                   ("left", "right"))  # fmt: skip
    inner = block_diag(*[part.inner for part in parts.values()])[np.ix_(chosen, chosen)]
    for k, (name, (nominal, low, high)) in enumerate(found.items()):
        own = owner[chosen] == k
        inertial = not (left[system.dof :, own].any() or right[system.dof :, own].any() or inner[own].any())
        blocks.append(Block(name, known.units[name], nominal, low, high, int(own.sum()), inertial))
    units = _units(_augmented(system, tuple(blocks), Channels(left, right, inner)), blocks)
    scaled = Channels(left / units, right * units, inner * units[:, None] / units)
    return _augmented(system, tuple(blocks), scaled), tuple(blocks), error


def _joined(source: Any, k: int | None = None) -> Array:
    """The matrices [M C K -B; Ca Cv Cq D], or their derivatives to a parameter."""
    return _in_blocks({key: np.asarray(getattr(source, key) if k is None else getattr(source, key)[k])
                       for key in MATRICES}, -1.0)  # fmt: skip


def _in_blocks(part: Mapping[str, Array], sign: float = 1.0) -> Array:
    return np.block([[part["M"], part["C"], part["K"], sign * part["B"]],
                     [part["Ca"], part["Cv"], part["Cq"], part["D"]]])  # fmt: skip


def _polynomials(
    system: Any, found: Mapping[str, tuple[float, float, float]], vary: Callable[[Mapping[str, float]], Any], order: int
) -> tuple[dict[tuple[int, ...], Channels], float]:  # fmt: skip
    """Channels of each parameter and of pairs, and the largest error at sampled values as a share of the change.

    Errors and changes are those of all equations, and of outputs with one unit, in scales in which units do not matter.
    """
    names, nominal = list(found), _joined(system)
    scale, groups = _compared(system)

    def sizes(change: Array) -> Array:
        """The largest scaled entries of changes (..., rows, columns) by groups."""
        return np.array([np.abs(change[..., rows, :] * scale[rows]).max(initial=0.0) for rows in groups])

    def change(x: Mapping[int, float]) -> Array:
        """The change by parameters in units of half their width."""
        return _joined(vary({names[k]: found[names[k]][0] + 0.5 * (found[names[k]][2] - found[names[k]][1]) * value
                             for k, value in x.items()})) - nominal  # fmt: skip

    ends = [((low - middle) / (0.5 * (high - low)), (high - middle) / (0.5 * (high - low)))
            for middle, low, high in found.values()]  # fmt: skip
    terms: dict[tuple[int, ...], Array] = {}
    for k, (low, high) in enumerate(ends):
        nodes = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(np.pi * (np.arange(order + 2) + 0.5) / (order + 2))
        inverse = np.linalg.pinv(nodes[:, None] ** np.arange(1, order + 1))
        terms[(k,)] = np.tensordot(inverse, np.array([change({k: x}) for x in nodes.tolist()]), 1)
    least = NOT_AFFINE * sizes(nominal)  # less is rounding
    largest = np.maximum(np.max([sizes(part) for part in terms.values()], axis=0), least)
    for i, j in combinations(range(len(names)), 2):
        corners = [s * t * change({i: ends[i][s > 0], j: ends[j][t > 0]}) for s in (-1, 1) for t in (-1, 1)]
        product = np.sum(corners, axis=0) / ((ends[i][1] - ends[i][0]) * (ends[j][1] - ends[j][0]))
        if (sizes(product) > NOT_AFFINE * largest).any():
            terms[(i, j)] = product[None]
    rng, error = np.random.default_rng(0), 0.0
    sampled = [*np.array(ends).T, *[rng.uniform(*np.array(ends).T) for _ in range(CHECKED)]]
    for x in sampled:
        modelled = np.sum([np.tensordot(x[key[0]] ** np.arange(1, order + 1), part, 1) if len(key) == 1 else
                           x[key[0]] * x[key[1]] * part[0] for key, part in terms.items()], axis=0)  # fmt: skip
        there = change(dict(enumerate(x.tolist())))
        size = np.maximum(sizes(there), least)
        error = max(error, *(sizes(there - modelled) / np.where(size > 0.0, size, 1.0)))
    if error > COARSE:
        raise ModelError(f"uncertain: polynomials of order {order} miss the changes of '{system.name}' by {error:.2g} "
                         f"of these; expected at most {COARSE}. Give a higher order, or narrower limits.")  # fmt: skip
    return {key: _factors(system, list(part), names[key[0]], len(key)) for key, part in terms.items()}, float(error)


def _units(linear: Any, blocks: list[Block]) -> Array:
    """Units of the signals w and z (r,), one for each parameter, in which these do as much to others as others to them.
    """
    sizes = [block.repetitions for block in blocks]
    owner, r = np.repeat(np.arange(len(blocks)), sizes), sum(sizes)
    response = np.abs(linear.frequency_response(OFF_POLES * _typical_speed(linear))[:r, :r]).max(axis=2)
    together = np.zeros((len(blocks), len(blocks)))
    np.maximum.at(together, (owner[:, None], owner), response)
    return balancing(together.astype(complex), len(blocks))[owner]


def _scales(system: Any) -> tuple[EntryScales, float]:
    """Scales of the entries of the matrices, and the typical speed [rad/s] that scales time."""
    speed = _typical_speed(system)
    # springs and dampers are the inertia of motions without mass, which else would hide all others
    inertia = [np.abs(np.diagonal(matrix)) for matrix in (system.M, system.C / speed, system.K / speed**2)]
    return EntryScales.of(system, np.maximum(inertia, np.finfo(float).tiny), system.B), speed


def _compared(system: Any) -> tuple[Array, list[Index]]:
    """Factors of the entries of ``_joined``, and which of its rows are compared with each other."""
    entries, speed = _scales(system)
    scale, outputs = _in_blocks(entries.factors), [system.dof + rows for rows in entries.rows["Cq"]]
    m = system.dof
    scale[:, m : 2 * m] /= speed
    scale[:, 2 * m : 3 * m] /= speed**2
    return scale, [np.arange(m), *outputs]


def _typical_speed(system: Any) -> float:
    """The median of the absolute values of poles that are not zero [rad/s]; 1 if there is none."""
    speed = np.abs(system.poles())
    return float(np.median(speed[speed > 0.0])) if (speed > 0.0).any() else 1.0


def _factors(system: Any, terms: Sequence[Array], name: str, factors: int = 1) -> Channels:
    """Channels of the powers of a parameter, or of a product of two ``factors``, of least number."""
    whole = np.sum(np.abs(terms), axis=0)
    if not np.isfinite(whole).all():
        raise ModelError(f"uncertain: the equations of '{system.name}' do not change smoothly with '{name}', or it "
                         f"takes degrees of freedom away; leave it out.", element=name)  # fmt: skip
    m = system.dof
    entries, speed = _scales(system)
    mass = entries.root
    rows = np.concatenate((mass, np.ones(len(whole) - m)))
    columns = np.concatenate((mass, speed * mass, speed**2 * mass, np.ones(whole.shape[1] - 3 * m)))
    scaled = whole / rows[:, None] / columns
    # ports have units of their own
    of_rows, of_columns = (np.abs(scaled).max(axis=axis, initial=np.finfo(float).tiny) for axis in (1, 0))
    of_rows[:m], of_columns[: 3 * m] = 1.0, 1.0
    rows, columns, count = rows * of_rows, columns * of_columns, len(terms)
    none = np.zeros_like(whole)
    hankel = np.block([[terms[i + j] / rows[:, None] / columns if i + j < count else none for j in range(count)]
                       for i in range(count)])  # fmt: skip
    u, sizes, v = np.linalg.svd(hankel)
    least = ZERO_BLOCK if count == 1 and factors == 1 else NOT_AFFINE
    rank = int((sizes > least * sizes[0]).sum()) if sizes.any() else 0
    if not rank:
        raise ModelError(f"uncertain: '{name}' changes nothing in '{system.name}'; leave it out.", element=name)
    root, n = np.sqrt(sizes[:rank]), len(whole)
    u = u[:, :rank]
    inner = (u / root).T @ np.concatenate((u[n:] * root, np.zeros((n, rank))))
    left = u[:n] * root * (rows * whole.any(axis=1))[:, None]
    right = v[:rank, : whole.shape[1]].T * root * (columns * whole.any(axis=0))[:, None]
    if factors == 1:
        return Channels(left, right, inner)
    return Channels(np.concatenate((left, 0.0 * left), axis=1), np.concatenate((0.0 * right, right), axis=1),
                    np.block([[0.0 * inner, np.eye(rank)], [0.0 * inner, 0.0 * inner]]))  # fmt: skip


def _check_affine(system: Any, slopes: Any, found: Mapping[str, tuple[float, float, float]],
                  vary: Callable[[Mapping[str, float]], Any]) -> None:  # fmt: skip
    """Refuse parameters in which the equations are not affine, by name: each at its limits, then all together."""
    cases = [{name: limit} for name, (_, *both) in found.items() for limit in both]
    cases += [{name: limits[k] for name, limits in found.items()} for k in (1, 2)]
    names, entries = list(found), _scales(system)[0]
    for case in cases:
        try:
            there = vary(case)
        except Exception as error:
            error.add_note(f"uncertain: at the limits {', '.join(f'{n} = {v:g}' for n, v in case.items())}")
            raise
        for key, scale in entries.factors.items():
            nominal = getattr(system, key) * scale
            change: Any = scale * sum(np.multiply(getattr(slopes, key)[names.index(name)], value - found[name][0])
                                      for name, value in case.items())  # fmt: skip
            apart, changed, size = ([np.abs(part[rows]).max(initial=0.0) for rows in entries.rows[key]] for part in (
                getattr(there, key) * scale - nominal - change, change, nominal))  # fmt: skip
            if (np.array(apart) > NOT_AFFINE * np.array(changed) + ROUNDINGS * EPS * np.array(size)).any():
                who = "', '".join(case)
                raise ModelError(f"uncertain: the matrix {key} of '{system.name}' is no straight line in '{who}' "
                                 f"between its limits, as it is in masses, inertias, stiffness and damping of "
                                 f"mechanisms without loads. Give order=2 or more for polynomials with a stated error.",
                                 element=next(iter(case)))  # fmt: skip


def _augmented(system: Any, blocks: tuple[Block, ...], channels: Channels) -> Any:
    """The system with the inputs w and the outputs z before its own."""
    (left, right, inner), m = channels, system.dof
    r = len(inner)
    names = [f"{block.name}{{}}{k + 1 if block.repetitions > 1 else ''}" for block in blocks
             for k in range(block.repetitions)]  # fmt: skip
    d = np.block([[inner, right[3 * m :].T], [left[m:], system.D]])
    rows = {"Ca": right[:m].T, "Cv": right[m : 2 * m].T, "Cq": right[2 * m : 3 * m].T}
    return replace(
        system, B=np.concatenate((-left[:m], system.B), axis=1), D=d,
        **{key: np.concatenate((extra, getattr(system, key))) for key, extra in rows.items()},
        inputs=(*[name.format(CHANGE) for name in names], *system.inputs), input_units=("", ) * r + system.input_units,
        outputs=(*[name.format(SEEN) for name in names], *system.outputs),
        output_units=("", ) * r + system.output_units,
    )  # fmt: skip
