"""Which output goes to which input; what cannot work is refused here, by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ExportError, nearest

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib_export.cosimulation.unit_file import Signal, UnitFile


PLANT, CONTROLLER = "plant", "controller"
_TINY = 1e-12  # of the largest entry of D: rounding is not feedthrough


@dataclass(frozen=True, slots=True)
class Connections:
    """Connected and free inputs by their numbers: input ``into[i]`` of an FMU takes output ``out[i]`` of the other."""

    plant_into: tuple[int, ...]
    controller_out: tuple[int, ...]
    controller_into: tuple[int, ...]
    plant_out: tuple[int, ...]
    plant_free: tuple[int, ...]
    controller_free: tuple[int, ...]
    notes: tuple[str, ...]

    def selection(self, plant: UnitFile, controller: UnitFile) -> tuple[Array, Array]:
        """Return the matrices from outputs of the controller to inputs of the plant, and back."""
        actuate = np.zeros((len(plant.inputs), len(controller.outputs)))
        measure = np.zeros((len(controller.inputs), len(plant.outputs)))
        actuate[list(self.plant_into), list(self.controller_out)] = 1.0
        measure[list(self.controller_into), list(self.plant_out)] = 1.0
        return actuate, measure


def connect(plant: UnitFile, controller: UnitFile, pairs: Mapping[str, str | None] | None) -> Connections:
    """Return the connections of a plant and a controller: signals of one name, and those that are given.

    ``pairs``: output by input; ``"plant:NAME"`` or ``"controller:NAME"`` where both FMUs have an input of this name.
    """
    wishes: dict[str, dict[int, str | None]] = {PLANT: {}, CONTROLLER: {}}
    for name, wish in (pairs or {}).items():
        side, index = _input_of(plant, controller, name)
        wishes[side][index] = wish
    into_plant = _signals_into(plant, controller, PLANT, wishes[PLANT])
    into_controller = _signals_into(controller, plant, CONTROLLER, wishes[CONTROLLER])
    for into, source, goal, words in (
        (into_plant, controller, plant, "outputs of the controller to inputs of the plant"),
        (into_controller, plant, controller, "outputs of the plant to inputs of the controller"),
    ):
        if not into:
            raise ExportError(
                f"check_cosimulation: no connection from {words}: there is "
                f"{', '.join(port.name for port in source.outputs) or 'no output'} on one side, "
                f"{', '.join(port.name for port in goal.inputs) or 'no input'} on the other. Signals of one name are "
                f"connected; say others by connections={{input: output}}, on the command line by --connect "
                f"INPUT=OUTPUT."
            )
    notes = [*_notes(into_plant, controller, plant, PLANT), *_notes(into_controller, plant, controller, CONTROLLER)]
    return Connections(
        tuple(into_plant), tuple(into_plant.values()), tuple(into_controller), tuple(into_controller.values()),
        tuple(i for i in range(len(plant.inputs)) if i not in into_plant),
        tuple(i for i in range(len(controller.inputs)) if i not in into_controller), tuple(notes),
    )  # fmt: skip


def _notes(into: Mapping[int, int], source: UnitFile, goal: UnitFile, side: str) -> list[str]:
    pairs = [(source.outputs[o].name, goal.inputs[i].name) for i, o in into.items()]
    return [f"{side} <- {', '.join(a if a == b else f'{a} as {b}' for a, b in pairs)}"]


def _input_of(plant: UnitFile, controller: UnitFile, name: str) -> tuple[str, int]:
    side, _, rest = name.partition(":")
    units = {PLANT: plant, CONTROLLER: controller}
    if side in units and rest:
        units, name = {side: units[side]}, rest
    matches = [(key, [signal.name for signal in unit.inputs].index(name)) for key, unit in units.items()
               if name in [signal.name for signal in unit.inputs]]  # fmt: skip
    if len(matches) == 1:
        return matches[0]
    known = [signal.name for unit in units.values() for signal in unit.inputs]
    if matches:
        raise ExportError(f"check_cosimulation: connections: both FMUs have an input '{name}'; say 'plant:{name}' or "
                          f"'controller:{name}'.")  # fmt: skip
    raise ExportError(f"check_cosimulation: connections: there is no input '{name}'; inputs are {', '.join(known)}."
                      f"{nearest(name, known)}")  # fmt: skip


def _signals_into(goal: UnitFile, source: UnitFile, side: str, wishes: Mapping[int, str | None]) -> dict[int, int]:
    names = [port.name for port in source.outputs]
    result = {}
    for i, signal in enumerate(goal.inputs):
        wish = wishes.get(i, signal.name)
        if wish is None:
            continue
        if wish not in names:
            if i in wishes:
                raise ExportError(f"check_cosimulation: connections: '{wish}' for the {side}'s input '{signal.name}' "
                                  f"is not an output of '{source.name}'; outputs are {', '.join(names)}."
                                  f"{nearest(wish, names)}")  # fmt: skip
            continue
        result[i] = names.index(wish)
        _same_unit(source.outputs[result[i]], signal, side)
    return result


def _same_unit(out: Signal, into: Signal, side: str) -> None:
    if out.base is not None and into.base is not None and out.base != into.base:
        raise ExportError(f"check_cosimulation: output '{out.name}' [{out.unit}] does not go with the {side}'s input "
                          f"'{into.name}' [{into.unit}]: the units differ.")  # fmt: skip


def refuse_algebraic_loop(
    plant: UnitFile, controller: UnitFile, links: Connections, through_plant: Array, through_controller: Array
) -> None:
    """Refuse a loop in which signals depend on each other at once, which no master without iteration can solve.

    ``through_plant``, ``through_controller`` (outputs, inputs): their matrices D.
    """
    actuate, measure = links.selection(plant, controller)
    p = len(plant.outputs)
    total = p + len(controller.outputs)
    direct = np.zeros((total, total), dtype=bool)  # row depends on column
    direct[:p, p:] = _filled(through_plant) @ (actuate != 0)
    direct[p:, :p] = _filled(through_controller) @ (measure != 0)
    names = [*(f"{signal.name} (plant)" for signal in plant.outputs),
             *(f"{signal.name} (controller)" for signal in controller.outputs)]  # fmt: skip
    remaining = set(range(total))
    while remaining:  # what depends on nothing that is left cannot be in a loop
        free = {i for i in remaining if not direct[i, sorted(remaining)].any()}
        if not free:
            raise ExportError(
                f"check_cosimulation: algebraic loop: {' <- '.join(names[i] for i in _cycle(direct, remaining))} "
                f"depend on each other at once, as plant and controller both have feedthrough there. Roll one off (a "
                f"low-pass filter in the controller), or measure what does not answer at once."
            )
        remaining -= free


def _filled(through: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(through) > _TINY * np.abs(through).max(initial=0.0))


def _cycle(direct: NDArray[np.bool_], remaining: set[int]) -> list[int]:
    path = [min(remaining)]
    while True:
        following = next(j for j in sorted(remaining) if direct[path[-1], j])
        if following in path:
            return [*path[path.index(following):], following]  # fmt: skip
        path.append(following)
