"""A path of equilibria: models, holding forces, natural frequencies and stability over a joint coordinate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.arrays import AnyArray, Array, Bools
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.elements import bushing
from mbsvib.elements.coupler import refuse_curved
from mbsvib.equilibrium.articulation import articulated
from mbsvib.equilibrium.continuation import Passed, led_to
from mbsvib.equilibrium.held_state import State, started
from mbsvib.equilibrium.motion import posed_model
from mbsvib.equilibrium.moved import asked_for, cut_elsewhere_of
from mbsvib.equilibrium.moved_parts import refuse_unstated, static_model
from mbsvib.equilibrium.report import modes_of
from mbsvib.equilibrium.search import balanced_model
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.unit_warnings import with_angles

if TYPE_CHECKING:
    from mbsvib.modes import Modes

M = TypeVar("M", bound=Mechanism)

# A holding force below this share of the forces that balance along the coordinate is 0.
NO_FORCE = 1e-12
NONE = (0.0,) * 6
# Frequencies that the table lists.
LISTED = 4


@dataclass(frozen=True, slots=True)
class PathPoint(Generic[M]):
    """A special point of a path.

    ``kind`` is "limit" where the holding force has an extreme, so that the mechanism loses or regains its stability if
    the force stays, "turning" where the coordinate has one, and "branch" where another path of equilibria crosses.
    ``value`` [m, rad] is the coordinate and ``force`` [N, N m] what holds it, ``model`` is the model there.
    ``direction`` are the motions of joint coordinates, the largest 1 [m, rad], along the path, or along the crossing
    one at a branch. ``before`` is the number of the value of the path before which the point is passed, from 0.
    """

    kind: str
    value: float
    force: float
    model: M
    direction: dict[str, float]
    before: int


@dataclass(frozen=True, repr=False)
class EquilibriumPath(Columnar, Displayed, Generic[M]):
    """Equilibria while a joint coordinate has given values.

    ``values`` (n,) [m, rad] are displacements of the ``coordinate`` from the reference pose, ``forces`` (n,) [N, N m]
    the generalized forces that hold it, on the second body of the joint. ``models`` are the models there; each has the
    holding force as a preload. ``stable_held`` (n,) states whether the other coordinates are stable while a drive holds
    this one; ``points`` are the special points passed. ``curve`` (k, 2) are coordinate and force of all steps in
    order, with the values and special points, and ``curve_stable`` (k,) states where the stiffness is positive.
    """

    coordinate: str
    unit: str
    """Unit of ``values``, m or rad."""
    values: Array
    forces: Array
    models: tuple[M, ...]
    stable_held: Bools
    points: tuple[PathPoint[M], ...]
    curve: Array
    curve_stable: Bools

    def __post_init__(self) -> None:
        for array in (self.values, self.forces, self.stable_held, self.curve, self.curve_stable):
            array.setflags(write=False)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.models[0].name if self.models else ""

    @cached_property
    def _modes(self) -> tuple[Modes | None, ...]:
        return tuple(map(modes_of, self.models))

    @cached_property
    def frequencies(self) -> Array:
        """Natural frequencies (n, modes) [Hz] under the holding force, with the coordinate free to move; ascending.

        Unstable modes have none: rows that are shorter end with nan. Of large mechanisms these are the lowest ten.
        """
        rows = [np.empty(0) if modes is None else np.sort(modes.frequencies[~modes.growing]) for modes in self._modes]
        result = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
        for k, row in enumerate(rows):
            result[k, : len(row)] = row
        result.setflags(write=False)
        return result

    @cached_property
    def stable(self) -> Bools:
        """Whether each equilibrium is stable (n,) under the holding force, with the coordinate free to move."""
        return np.array([modes is None or not modes.growing.any() for modes in self._modes])

    def columns(self) -> dict[str, AnyArray]:
        """Return values of the coordinate, forces, stability and frequencies [Hz] as columns by name.

        Returns
        -------
        dict of str to array, shape (n,)
            The coordinate's name, ``force``, ``stable``, ``stable_held``, ``frequency_hz(1)``, ...
        """
        result = {self.coordinate: self.values, "force": self.forces, "stable": self.stable,
                  "stable_held": self.stable_held}  # fmt: skip
        return result | {f"frequency_hz({i})": column for i, column in enumerate(self.frequencies.T, 1)}

    def table(self) -> dict[str, Any]:
        """Return title, columns and rows of the table that ``print`` shows."""
        force = "N m" if self.unit == "rad" else "N"
        count = min(LISTED, self.frequencies.shape[1])
        columns = [(f"{self.coordinate} [{self.unit}]", "right"), (f"force [{force}]", "right"), ("stable", "left"),
                   ("stable if held", "left"), *((f"f{i + 1} [Hz]", "right") for i in range(count))]  # fmt: skip
        rows: list[tuple[str, ...]] = []
        for k in range(len(self.values)):
            rows += [self._point_row(point, count) for point in self.points if point.before == k]
            rows.append((f"{self.values[k]:.6g}", f"{self.forces[k]:.6g}", _yes(self.stable[k]),
                         _yes(self.stable_held[k]), *map(_hertz, self.frequencies[k, :count])))  # fmt: skip
        return {"title": f"Path of equilibria of {self.name}", "columns": columns, "rows": rows,
                "notes": [f"Doubtful: {text}" for text in self.models[0].doubts]}  # fmt: skip

    def _point_row(self, point: PathPoint[M], count: int) -> tuple[str, ...]:
        return (f"{point.value:.6g}", f"{point.force:.6g}", f"{point.kind} point", "", *[""] * count)


def _hertz(frequency: float) -> str:
    return "" if np.isnan(frequency) else f"{frequency:.4g}"


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def equilibrium_path(model: M, coordinate: str, values: ArrayLike, switch: int = 0) -> EquilibriumPath[M]:
    """Return the equilibria of a model along values of a joint coordinate; see ``Model.path``."""
    coordinate = str(coordinate)
    requested = np.atleast_1d(reals(values, "path", "values", "values of the coordinate [m, rad]")) + 0.0  # no -0
    if requested.ndim != 1 or not len(requested) or not np.isfinite(requested).all():
        raise ModelError(f"path: values have shape {requested.shape}; expected one or more finite values.",
                         field="values")  # fmt: skip
    if switch not in (-1, 0, 1):
        raise ModelError(f"path: switch = {switch!r}; expected 1 or -1, or 0 to stay on the path.", field="switch")
    refuse_curved(model.couplers.values(), "which a path leaves; it holds for linear equations.")
    model = with_angles(model, {coordinate: requested})
    articulated_model = static_model(articulated(model))
    refuse_unstated(model.springs.values())
    first = posed_model(articulated_model, cut=cut_elsewhere_of(articulated_model, [coordinate]))
    _check(model, coordinate, first.coordinates.names)
    with asked_for([coordinate], "path", "coordinate"):
        state = started(first, coordinate)
    along, states, points, curve = state.direction, [], [], [state]
    for k, value in enumerate(requested.tolist()):
        state, along, passed_states, switch = led_to(state, along, value, switch)
        states.append(state)
        points += [_point(model, k, passed) for passed in passed_states if passed.kind]
        curve += [*(passed.state for passed in passed_states), state]
    turns = coordinate.rpartition(".")[2].startswith("r")
    return EquilibriumPath(
        coordinate, "rad" if turns else "m", requested, np.array([_force(state) for state in states]),
        tuple(_held_model(model, state) for state in states),
        np.array([bool((state.stiffness_held > 0.0).all()) for state in states]), tuple(points),
        np.array([(state.value, _force(state)) for state in curve]),
        np.array([bool((state.stiffness > 0.0).all()) for state in curve]),
    )  # fmt: skip


def _check(model: Mechanism, coordinate: str, names: tuple[str, ...]) -> None:
    name = coordinate.rpartition(".")[0]
    check.known(coordinate, [other for other in names if other.rpartition(".")[0] in model.joints],
                f"path: '{coordinate}' is not a joint coordinate of model '{model.name}'", "coordinate")  # fmt: skip
    rotations = [free for free, _ in model.joints[name].freedom if free.startswith("r")]
    if len(rotations) > 1:
        raise ModelError(f"path: joint '{name}' of '{coordinate}' has {len(rotations)} free rotations; expected a "
                         f"joint with one at most, such as a hinge or a slider.", element=name, field="coordinate"
                         )  # fmt: skip


def _force(state: State) -> float:
    size = float(state.forces.size[state.i])
    return state.force if abs(state.force) > NO_FORCE * size else 0.0


def _held_model(model: M, state: State) -> M:
    """The model in the pose of a state, with the holding force as a preload in the joint."""
    result, force = balanced_model(model, state.at.pose, state.forces), _force(state)
    if force == 0.0:
        return result
    name, _, direction = state.led.rpartition(".")
    joint = result.joints[name]
    twist = dict(joint.freedom)[direction]
    axes = np.array(joint.axes)
    wrench = np.zeros(6)  # of a screw the moment alone, which does all the work
    half = slice(3, 6) if direction.startswith("r") else slice(0, 3)
    wrench[half] = force * (axes.T @ twist[half])
    body = joint.first if joint.second == "ground" else joint.second
    point = joint.position or result.bodies[body].position  # a slider may have no point: any will do
    hold = bushing.make(f"{state.led}.hold", joint.first, joint.second, point, NONE, NONE, joint.axes, wrench)
    return result.with_parts(springs=dict(result.springs) | {hold.name: hold})


def _point(model: M, before: int, passed: Passed) -> PathPoint[M]:
    state = passed.state
    step = state.softest if passed.kind == "branch" else state.direction
    motion = state.forces.all_joints(state.forces.scale * step)
    largest = float(motion[np.abs(motion).argmax()])
    direction = {name: float(value / largest) for name, value in zip(state.at.coordinates.names, motion, strict=True)}
    return PathPoint(passed.kind, state.value, _force(state), _held_model(model, state), direction, before)
