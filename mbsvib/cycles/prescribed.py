"""Prescribed motion: which joint coordinates are driven, and their values, rates and accelerations over the samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import reals
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.mechanism.mechanism import Mechanism

WHO = "cycle"
# Samples are evenly spread over a period to this share of it.
EVEN = 1e-9
# Highest harmonics above this share of the largest are not resolved by the samples; what differs by more after a period
# does not repeat.
RESOLVED = 1e-6


@dataclass(frozen=True)
class Prescribed:
    """Driven joint coordinates ``names`` (m) with their ``values``, ``rates`` and ``accelerations`` (n, m), the values
    as displacements from the pose as described [m, rad].
    """

    names: tuple[str, ...]
    values: Array
    rates: Array
    accelerations: Array

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints of the drives."""
        return tuple(name.rpartition(".")[0] for name in self.names)

    def ends(self, period: float) -> Prescribed | None:
        """Return the motion at its start and after a period [s] of drives at constant speed; None of any others, whose
        motion after the samples is not known.
        """
        rates = self.rates[0]
        if np.any(np.ptp(self.rates, axis=0) > EVEN * np.abs(rates)):
            return None
        both = (array[:1].repeat(2, axis=0) for array in (self.rates, self.accelerations))
        return Prescribed(self.names, self.values[0] + np.array([[0.0], [period]]) * rates, *both)

    def words(self, values: Array) -> str:
        """Return values of the drives in words."""
        return ", ".join(f"{name} = {value:.6g} {'rad' if turns(name) else 'm'}"
                         for name, value in zip(self.names, values, strict=True))  # fmt: skip


def turns(name: str) -> bool:
    """Return whether a joint coordinate is a rotation."""
    return name.rpartition(".")[2].startswith("r")


def prescribed(
    model: Mechanism, drive: Any, angles: Any, speed: Any, motion: Mapping[str, Any] | None
) -> Prescribed:
    """Return a prescribed motion, checked; the arguments are those of ``Model.cycle``."""
    if (drive is None) == (motion is None):
        raise ModelError("cycle: give either a drive with angles and speed, or motion={'joint.rz': (q, qd, qdd)}.",
                         field="drive")  # fmt: skip
    if motion is None:
        if speed is None:
            raise check.refuse(WHO, "speed", None, "the rate of the drive [rad/s, m/s], such as 2 * np.pi")
        rate = check.number(speed, WHO, "speed", "the rate of the drive [rad/s, m/s]")
        _check_drive(model, drive)
        motion = {drive: (angles, rate, 0.0)}
    elif angles is not None or speed is not None:
        raise ModelError("cycle: angles and speed go with a drive; motion= says the rates itself.", field="angles")
    check.mapping(WHO, "motion", motion, "{'joint.rz': (q, qd, qdd), ...} with an array over time each")
    columns: list[list[Array]] = [[], [], []]
    for name, three in motion.items():
        _check_drive(model, name)
        if not hasattr(three, "__len__") or len(three) != 3:
            raise check.refuse(WHO, f"motion[{name!r}]", three, "three arrays (n,): values, rates and accelerations")
        for column, values in zip(columns, three, strict=True):
            column.append(_samples(values, name, "angles" if drive is not None else f"motion[{name!r}]"))
    length = max(len(values) for column in columns for values in column)
    arrays = []
    for column in columns:
        for name, values in zip(motion, column, strict=True):
            if len(values) not in (1, length):
                raise check.refuse(WHO, f"motion[{name!r}]", values, f"{length} samples, as the others have")
        arrays.append(np.column_stack([np.broadcast_to(values, length) for values in column]))
    return Prescribed(tuple(motion), *arrays)


def _samples(values: Any, name: str, field: str) -> Array:
    expected = f"a number, or an array (n,) of samples of '{name}'"
    array = np.array(reals(values, WHO, field, expected, ModelError), ndmin=1)
    if array.ndim != 1 or not len(array) or not np.isfinite(array).all():
        raise check.refuse(WHO, field, values, f"{expected}, all finite")
    return array


def _check_drive(model: Mechanism, name: Any) -> None:
    known = [f"{joint.name}.{direction}" for joint in model.joints.values() for direction, _ in joint.freedom]
    check.known(name, known, f"cycle: {name!r} is not a joint coordinate of model '{model.name}'", "drive")
    joint = model.joints[name.rpartition(".")[0]]
    if turns(name) and joint.turns_by_vector:
        raise ModelError(f"cycle: '{name}' is a component of the rotation vector of joint '{joint.name}' "
                         f"({joint.kind}), which is no angle in finite motion; drive a joint with one free rotation, "
                         f"or two successive ones.", element=name, field="drive")  # fmt: skip


def period_of(motion: Prescribed, period: float | None) -> float:
    """Return the period [s]: of a drive at constant speed, that of its turn, over which samples must be evenly spread.
    """
    if period is not None:
        return check.positive(period, WHO, "period", "s")
    n, drive, rates, angles = len(motion.values), motion.names[0], motion.rates[:, 0], motion.values[:, 0]
    if len(motion.names) > 1 or not rates[0] or np.ptp(rates) > EVEN * abs(rates[0]):
        raise check.refuse(WHO, "period", None, "the period [s], over which the samples are evenly spread, where "
                           "not just one drive turns at constant speed")  # fmt: skip
    step = np.copysign(2.0 * np.pi / n, rates[0])
    if np.abs(angles - angles[0] - step * np.arange(n)).max() > EVEN * 2.0 * np.pi:
        raise ModelError(f"cycle: the samples of '{drive}' are not evenly spread over one turn, in the sense of its "
                         f"speed; give angles = 2 * np.pi * np.arange(n) / n, or the period.",
                         element=drive, field="angles")  # fmt: skip
    return float(2.0 * np.pi / abs(rates[0]))
