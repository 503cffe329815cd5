"""Collocation: pairs of actuators and sensors for which any gain of one sign damps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import kind_of
from mbsvib.elements import Spring
from mbsvib.errors import ResponseError, counted
from mbsvib.feedback.loop_rounding import response
from mbsvib.isolation.actuated import Active, check_plant
from mbsvib.responses.extrema import Band, panels
from mbsvib.responses.transmission_zeros import numbers

PARALLEL = 1e-9  # difference of the directions of actuator and sensor below which they are dual
SAME = 1e-6  # a pole and a zero within this relative distance cancel: the mode is not visible to the pair
LIGHT = 1e-3  # damping ratio of the highest mode
ROUNDING = 1e-8  # share of the response by which a real part may be negative
LOWEST, HIGHEST = 1e-3, 1e3  # band, in parts of the lowest and highest pole


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Pair(Displayed):
    """An actuator and a sensor: ``dual`` if the sensor sees just the motion on which the actuator does work, or the
    force in that motion; ``poles`` and ``zeros`` [Hz] of the undamped mechanism that the pair sees, ``interlaced`` if
    one zero is between two poles everywhere (None where massless motions relax, which have no undamped mechanism),
    ``passive`` if feedback of one sign takes energy at every frequency.
    """

    actuator: str
    sensor: str
    dual: bool
    interlaced: bool | None
    passive: bool
    poles: Array
    zeros: Array


@dataclass(frozen=True, repr=False, eq=False)
class Collocation(Columnar, Displayed):
    """The report on pairs of actuators and sensors."""

    name: str
    """Name of the model."""
    pairs: tuple[Pair, ...]
    """One report for each pair."""

    def columns(self) -> dict[str, Any]:
        """Return the pairs as columns (pairs,) by name: ``actuator``, ``sensor``, ``collocated``, ``interlaced`` (None
        where it is not defined), ``passive``.
        """
        names = {name: name for name in ("actuator", "sensor", "collocated", "interlaced", "passive")}
        fields = (names | {"collocated": "dual"}).items()
        return {name: np.array([getattr(one, own) for one in self.pairs], dtype=object) for name, own in fields}

    def table(self) -> dict[str, Any]:
        """Return the report as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        words = {True: "yes", False: "no", None: "-"}
        rows = [(p.actuator, p.sensor, words[p.dual], words[p.interlaced], words[p.passive]) for p in self.pairs]
        columns: list[tuple[str, Any]] = [("actuator", "left"), ("sensor", "left"), ("collocated", "left"),
                                          ("poles and zeros interlaced", "left"), ("passive", "left")]  # fmt: skip
        notes = [] if all(pair.passive for pair in self.pairs) else [
            "Pairs that are not passive damp some modes and destabilize others: their gain is limited."]  # fmt: skip
        return {"title": f"Collocation: {self.name}", "columns": columns, "rows": rows, "notes": notes}


def collocation(plant: Active | System, pairs: Iterable[tuple[str, str]] | None = None) -> Collocation:
    """Return a report on pairs of actuators and sensors.

    Parameters
    ----------
    plant : Active or System
        The mechanism, from ``actuated``, or any other.
    pairs : iterable of (str, str), optional
        Names of an actuator and a sensor each; default: force, rate and acceleration of each leg with its actuator.

    Returns
    -------
    Collocation
        Collocated, interlaced, passive or not; prints as a table.

    Raises
    ------
    ResponseError
        If a name is unknown.
    """
    legs = None if kind_of(plant) == "system" else check_plant(plant, "collocation")
    system: System = plant if legs is None else legs.system  # type: ignore[assignment]
    if pairs is None:
        pairs = [(f"{leg}.actuator", f"{leg}.{sensor}") for leg in (legs.legs if legs else ())
                 for sensor in ("force", "rate", "acceleration")]  # fmt: skip
    port_pairs = [tuple(pair) if not isinstance(pair, str) else (pair,) for pair in pairs]
    if not port_pairs or any(len(pair) != 2 for pair in port_pairs):
        raise ResponseError(f"collocation: pairs = {shown(pairs)}; expected one or more pairs of names, "
                            f"[(actuator, sensor), ...].")  # fmt: skip
    none = np.zeros_like(system.row_damping)
    undamped = replace(system, C=np.zeros_like(system.C), row_damping=none, gyroscopic=None)
    still = undamped if not system.massless else None
    return Collocation(system.name, tuple([_pair(system, legs, still, pair) for pair in port_pairs]))


def _pair(system: System, plant: Active | None, undamped: System | None, pair: tuple[str, ...]) -> Pair:
    """The report on an actuator and a sensor; ``plant``: whose tensions are those of legs with their actuators."""
    found = numbers(system, "input", pair[0]), numbers(system, "output", pair[1])
    if max(map(len, found)) > 1:
        raise ResponseError(f"collocation: {pair} picks {counted(len(found[0]), 'actuator')} and "
                            f"{counted(len(found[1]), 'sensor')}; expected one each.")  # fmt: skip
    (i,), (j,) = found
    actuator, sensor = system.inputs[i], system.outputs[j]
    rows = [m[j] for m in (system.Cq, system.Cv, system.Ca)]
    force = system.output_units[j] in ("N", "N m")
    order = 0 if force or rows[0].any() else 1 if rows[1].any() else 2
    b, row = system.B[:, i], rows[order]
    size = np.linalg.norm(b) * np.linalg.norm(row)
    dual = bool(size > 0.0 and np.linalg.norm(np.outer(b, row) - np.outer(row, b)) <= PARALLEL * size)
    leg = sensor.removesuffix(".force") if plant is not None else sensor
    if leg != sensor and actuator == f"{leg}.actuator":
        dual = True  # in series
    free = without(undamped, [leg]) if undamped is not None and sensor != leg and actuator == f"{leg}.actuator" and \
        plant is not None and removable(plant, [leg]) else None  # fmt: skip
    poles, zeros, minimum = _visible_frequencies(system if undamped is None else undamped, actuator, sensor, free)
    both = np.concatenate((poles, zeros))
    kind = np.concatenate((np.zeros(len(poles)), np.ones(len(zeros))))[np.argsort(both, kind="stable")]
    interlaced = None if undamped is None else minimum and bool((np.diff(kind) != 0.0).all())
    if not system.C.any():  # without damping no mode exchanges energy: some in proportion to stiffness
        ratio = 2.0 * LIGHT / np.abs(system.poles()).max(initial=1.0)
        system = replace(system, C=ratio * system.K, row_damping=ratio * system.row_stiffness)
    passive = _passive(system, i, j, force, order)
    return Pair(actuator, sensor, dual, interlaced, passive, poles, zeros)


def removable(plant: Active, legs: Sequence[str]) -> bool:
    """Return whether legs are plain springs, which have no effect beside their preload without further tension."""
    return all(isinstance(plant.scene.model.springs.get(leg), Spring) for leg in legs)


def without(system: System, legs: Sequence[str]) -> System:
    """Return a system without the springs and dampers of some legs: its poles are the zeros of their tensions."""
    removed = np.isin(system.row_owner, [system.provenance.springs.index(leg) for leg in legs])
    k, c = np.where(removed, 0.0, system.row_stiffness), np.where(removed, 0.0, system.row_damping)
    rows = system.elastic_rows[~removed]
    # summed again: a difference would leave rounding errors
    stiffness, damping = (rows.T @ (values[~removed, None] * rows) for values in (k, c))
    if system.circulatory is not None:
        stiffness += system.circulatory
    if system.gyroscopic is not None:
        damping += system.gyroscopic
    return replace(system, row_stiffness=k, row_damping=c, K=stiffness, C=damping)


def _visible_frequencies(system: System, actuator: str, sensor: str, free: System | None) -> tuple[Array, Array, bool]:
    """Frequencies [Hz] of poles and zeros that do not cancel, and whether all zeros are on the imaginary axis."""
    poles = system.poles()
    zeros = system.transmission_zeros(sensor, actuator) if free is None else free.poles()
    unit = np.abs(poles).max(initial=0.0)
    up = np.sort(poles.imag[poles.imag > SAME * unit])
    nonzero = zeros[np.abs(zeros) > SAME * unit]
    minimum = bool((np.abs(nonzero.real) <= SAME * np.abs(nonzero)).all())
    dips = np.sort(nonzero.imag[(nonzero.imag > 0.0) & (np.abs(nonzero.real) <= SAME * np.abs(nonzero))])
    visible = []
    for pole in up.tolist():
        close_to_pole = np.flatnonzero(np.abs(dips - pole) <= SAME * pole)
        if len(close_to_pole):
            dips = np.delete(dips, close_to_pole[0])
        else:
            visible.append(pole)
    return np.array(visible) / (2.0 * np.pi), dips / (2.0 * np.pi), minimum


def _passive(system: System, i: int, j: int, force: bool, order: int) -> bool:
    """Whether the real part of the response from force to the sensor's rate never changes its sign."""
    poles = system.poles()
    size = np.abs(poles[poles != 0.0])
    ends = panels(poles, LOWEST * float(size.min(initial=1.0)), HIGHEST * float(size.max(initial=1.0)))

    def rate(omega: Array) -> Complex:
        g = response(system, omega, system.outputs[j : j + 1], system.inputs[i : i + 1])[0, 0]
        # displacement, velocity, acceleration: to a velocity; a force in the leg is integrated, as by force feedback
        return np.asarray(g * (1j * omega) ** (-1 if force else 1 - order))

    band = Band(rate, ends)
    tops = [rate(band.maxima(lambda g, sign=sign: sign * g.real)[0]) for sign in (1.0, -1.0)]  # type: ignore[misc]
    both = np.concatenate((*tops, rate(ends), band.nodes.reshape(-1)))
    floor = ROUNDING * np.abs(both)
    return bool((both.real >= -floor).all() or (both.real <= floor).all())
