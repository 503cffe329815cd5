"""Uncertain parameters of a system as further inputs and outputs, w = d z, each as often as its rank.

(M + d dM) q'' + (C + d dC) q' + (K + d dK) q = (B + d dB) u,  y likewise: the change of a parameter by d adds
d D (q'', q', q, u), with D = [dM dC dK -dB; dCa dCv dCq dD] = L R^T of least rank. So z = R^T (q'', q', q, u), and w
acts through -L on the equations and L on the outputs: a spring enters once, also where its force is an output, a mass
by the rank of its motion.

Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 10.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError
from mbsvib.linalg.rank import EPS, NOT_AFFINE, ZERO_BLOCK
from mbsvib.uncertain.scalings import balancing

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

_MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
# Roundings of the largest entry of a matrix that one linearized anew may be off
ROUNDINGS = 1e3
# Frequencies, in parts of a typical pole, at which the sizes of signals are compared
OFF_POLES = np.array([0.013, 0.71, 1.37, 29.0])
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
    if not isinstance(limits, Mapping) or not limits:
        raise check.refuse("uncertain", "limits", limits, "parameters with limits, {'leg*.k.stiffness': 0.1, "
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
        if nominal == 0.0:
            raise ModelError(f"uncertain: '{name}' is 0, so that a relative width means nothing; give "
                             f"(lower, upper).", element=name)  # fmt: skip
        return nominal, nominal - half * abs(nominal), nominal + half * abs(nominal)
    low, high = check.numbers(value, (2,), "uncertain", name, expected)
    if not low < nominal < high:
        raise ModelError(f"uncertain: '{name}' = {nominal:g} is not within its limits ({low:g}, {high:g}); expected "
                         f"limits on both sides of the value that the model has.", element=name)  # fmt: skip
    return nominal, low, high


def with_blocks(
    system: Any, found: Mapping[str, tuple[float, float, float]], vary: Callable[[Mapping[str, float]], Any]
) -> tuple[Any, tuple[Block, ...]]:
    """Return a system with inputs w and outputs z of its uncertain parameters first, and these parameters.

    ``vary`` returns the system with other values of parameters; what is not affine in them is refused.
    """
    slopes = system.matrix_derivatives(list(found))
    known, blocks, into, out = system.parameters, [], [], []
    for k, (name, (nominal, low, high)) in enumerate(found.items()):
        left, right = _factors(system, {key: getattr(slopes, key)[k] for key in _MATRICES}, name)
        inertial = not left[system.dof :].any() and not right[system.dof :].any()
        blocks.append(Block(name, known.units[name], nominal, low, high, left.shape[1], inertial))
        root = np.sqrt(blocks[-1].half)
        into.append(root * left)
        out.append(root * right)
    _check_affine(system, slopes, found, vary)
    left, right = np.concatenate(into, axis=1), np.concatenate(out, axis=1)
    units = _units(_augmented(system, tuple(blocks), left, right), blocks)
    return _augmented(system, tuple(blocks), left / units, right * units), tuple(blocks)


def _units(linear: Any, blocks: list[Block]) -> Array:
    """Units of the signals w and z (r,), one for each parameter, in which these do as much to others as others to them.
    """
    sizes = [block.repetitions for block in blocks]
    owner, r = np.repeat(np.arange(len(blocks)), sizes), sum(sizes)
    response = np.abs(linear.frequency_response(OFF_POLES * _typical_speed(linear))[:r, :r]).max(axis=2)
    together = np.zeros((len(blocks), len(blocks)))
    np.maximum.at(together, (owner[:, None], owner), response)
    return balancing(together.astype(complex), len(blocks))[owner]


def _typical_speed(system: Any) -> float:
    """The median of the absolute values of poles that are not zero [rad/s]; 1 if there is none."""
    speed = np.abs(system.poles())
    return float(np.median(speed[speed > 0.0])) if (speed > 0.0).any() else 1.0


def _factors(system: Any, slope: Mapping[str, Array], name: str) -> tuple[Array, Array]:
    """L (m + outputs, r) and R (3 m + inputs, r) of the change by one parameter."""
    if not all(np.isfinite(part).all() for part in slope.values()):
        raise ModelError(f"uncertain: the equations of '{system.name}' do not change smoothly with '{name}', or it "
                         f"takes degrees of freedom away; leave it out.", element=name)  # fmt: skip
    whole = np.block([[slope["M"], slope["C"], slope["K"], -slope["B"]],
                      [slope["Ca"], slope["Cv"], slope["Cq"], slope["D"]]])  # fmt: skip
    m = system.dof
    mass = np.sqrt(np.maximum(np.diagonal(system.M), np.finfo(float).tiny))
    speed = _typical_speed(system)
    rows = np.concatenate((mass, np.ones(len(whole) - m)))
    columns = np.concatenate((mass, speed * mass, speed**2 * mass, np.ones(whole.shape[1] - 3 * m)))
    scaled = whole / rows[:, None] / columns
    # ports have units of their own
    of_rows, of_columns = (np.abs(scaled).max(axis=axis, initial=np.finfo(float).tiny) for axis in (1, 0))
    of_rows[:m], of_columns[: 3 * m] = 1.0, 1.0
    u, sizes, v = np.linalg.svd(scaled / of_rows[:, None] / of_columns)
    rank = int((sizes > ZERO_BLOCK * sizes[0]).sum()) if sizes.any() else 0
    if not rank:
        raise ModelError(f"uncertain: '{name}' changes nothing in '{system.name}'; leave it out.", element=name)
    root = np.sqrt(sizes[:rank])
    left = u[:, :rank] * root * (rows * of_rows * whole.any(axis=1))[:, None]
    return left, v[:rank].T * root * (columns * of_columns * whole.any(axis=0))[:, None]


def _check_affine(system: Any, slopes: Any, found: Mapping[str, tuple[float, float, float]],
                  vary: Callable[[Mapping[str, float]], Any]) -> None:  # fmt: skip
    """Refuse parameters in which the equations are not affine, by name: each at its limits, then all together."""
    cases = [{name: limit} for name, (_, *both) in found.items() for limit in both]
    cases += [{name: limits[k] for name, limits in found.items()} for k in (1, 2)]
    names = list(found)
    for case in cases:
        try:
            there = vary(case)
        except Exception as error:
            error.add_note(f"uncertain: at the limits {', '.join(f'{n} = {v:g}' for n, v in case.items())}")
            raise
        for key in _MATRICES:
            nominal = getattr(system, key)
            change = sum(np.multiply(getattr(slopes, key)[names.index(name)], value - found[name][0])
                         for name, value in case.items())  # fmt: skip
            apart = np.abs(getattr(there, key) - nominal - change)
            rounding = ROUNDINGS * EPS * np.abs(nominal).max(initial=0.0)
            if (apart > NOT_AFFINE * np.abs(change).max(initial=0.0) + rounding).any():
                who = "', '".join(case)
                raise ModelError(f"uncertain: the matrix {key} of '{system.name}' is no straight line in '{who}' "
                                 f"between its limits, as it is in masses, inertias, stiffness and damping of "
                                 f"mechanisms without loads. Take it to the limits by sweeps or tolerances.",
                                 element=next(iter(case)))  # fmt: skip


def _augmented(system: Any, blocks: tuple[Block, ...], left: Array, right: Array) -> Any:
    """The system with the inputs w and the outputs z before its own."""
    m, r = system.dof, left.shape[1]
    names = [f"{block.name}{{}}{k + 1 if block.repetitions > 1 else ''}" for block in blocks
             for k in range(block.repetitions)]  # fmt: skip
    d = np.block([[np.zeros((r, r)), right[3 * m :].T], [left[m:], system.D]])
    rows = {"Ca": right[:m].T, "Cv": right[m : 2 * m].T, "Cq": right[2 * m : 3 * m].T}
    return replace(
        system, B=np.concatenate((-left[:m], system.B), axis=1), D=d,
        **{key: np.concatenate((extra, getattr(system, key))) for key, extra in rows.items()},
        inputs=(*[name.format(CHANGE) for name in names], *system.inputs), input_units=("", ) * r + system.input_units,
        outputs=(*[name.format(SEEN) for name in names], *system.outputs),
        output_units=("", ) * r + system.output_units,
    )  # fmt: skip
