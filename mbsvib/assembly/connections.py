"""Which ports of which parts are joined: names, patterns by position, stiffness, and distances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, shown
from mbsvib.common.arrays import Array
from mbsvib.common.expected import kind_of, reals
from mbsvib.common.patterns import matching
from mbsvib.elements.dynamic import Dynamic
from mbsvib.equations.equations import Connection
from mbsvib.errors import ModelError, nearest
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.points import Place, model_places

WHO = "assemble"
# Directions of a port are those of its partner up to this cosine (3 degrees).
SAME_DIRECTION = 0.9986
# Stiffness matrices are symmetric up to rounding, and have no eigenvalue below this share of the largest.
ROUNDED = 1e-12
# Ports that are joined are no farther apart [m], nor than this share of the size of the larger part.
FARTHEST, SHARE = 1e-3, 0.05
EXPECTED = '("base.tip", "payload.root", "rigid")'


@dataclass(frozen=True)
class Part:
    """A part by its ``name``: a ``linear`` system or a measurement, with the ``ports`` {port: directions} and places
    of its channels; ``positions`` [m] of ports are those that were given.
    """

    name: str
    linear: Any
    ports: Mapping[str, tuple[str, ...]]
    places: Mapping[tuple[str, str], Place]
    positions: Mapping[str, Array] = field(default_factory=dict)

    @property
    def is_measured(self) -> bool:
        """Whether it is measured."""
        return isinstance(self.linear, Measurement)

    def channels(self, port: str, directions: Iterable[str]) -> tuple[list[int], list[int]]:
        """Return the numbers of the outputs and of the inputs of a port."""
        names = [f"{port}.{direction}" for direction in directions]
        outputs, inputs = self._numbers
        return [outputs[name] for name in names], [inputs[name] for name in names]

    @cached_property
    def _numbers(self) -> tuple[dict[str, int], dict[str, int]]:
        outputs, inputs = ({name: k for k, name in enumerate(names)}
                           for names in (self.linear.outputs, self.linear.inputs))  # fmt: skip
        return outputs, inputs

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around all known places [m], 0 of one place alone but for rounding."""
        known = np.array([*self.positions.values(), *(place.position for place in self.places.values())]).reshape(-1, 3)
        size = float(np.linalg.norm(np.ptp(known, axis=0))) if len(known) else 0.0
        return size if size > ROUNDED * np.abs(known).max(initial=0.0) else 0.0

    def position(self, port: str) -> Array | None:
        """Return where a port is (3,) [m]; None where that is not known."""
        if port in self.positions:
            return self.positions[port]
        found = [place for direction in self.ports[port]
                 if (place := self.places.get(("output", f"{port}.{direction}"))) is not None]  # fmt: skip
        return found[0].position if found else None


def part_of(name: Any, given: Any, positions: Mapping[str, Any] | None = None) -> Part:
    """Return a part that is a model, a system, a sparse one or a measurement; ``positions`` of its ports [m]."""
    if not isinstance(name, str) or not name:
        raise ModelError(f"{WHO}: a part has the name {shown(name)}; expected a text that is not empty.")
    linear = given.linearize() if kind_of(given) == "model" else given
    matrices = getattr(linear, "matrices", None)
    if not isinstance(linear, Measurement) and kind_of(linear) != "system" and matrices is None:
        hint = ("It is a mechanism that is held sparse: give some of its modes, reduced(40) without correction."
                if kind_of(linear) == "sparse system" else "Of a state space, give the responses.")  # fmt: skip
        raise ModelError(f"{WHO}: part '{name}' is a {kind_of(linear) or type(linear).__name__}; expected a Model, a "
                         f"System or a Measurement. {hint}", element=name)  # fmt: skip
    known, ports = set(linear.inputs), dict[str, tuple[str, ...]]()
    for output in linear.outputs:
        port, _, direction = output.rpartition(".")
        if port and direction in DIRECTIONS and output in known:
            ports[port] = (*ports.get(port, ()), direction)
    ordered = {port: tuple(d for d in DIRECTIONS if d in directions) for port, directions in ports.items()}
    given_places = {port: np.array(check.vector(place, WHO, f"positions['{name}.{port}']"))
                    for port, place in (positions or {}).items()}  # fmt: skip
    for port in given_places:
        check.known(port, ordered, f"{WHO}: positions has '{name}.{port}', which is not a port of '{name}'",
                    element=f"{name}.{port}")  # fmt: skip
    return Part(name, linear, ordered, model_places(linear), given_places)


def connections_of(parts: Mapping[str, Part], connect: Iterable[Any], distance: float | None) -> list[Connection]:
    """Return all pairs of ports that are joined; ``distance`` [m]: what places that are the same may be apart, None for
    that which suits both parts.
    """
    result = []
    for given in connect:
        if not isinstance(given, (tuple, list)) or len(given) not in (3, 4) or not all(
            isinstance(name, str) for name in given[:2]
        ):
            raise ModelError(f"{WHO}: connect has {shown(given)}; expected two ports and how they are joined, "
                             f"{EXPECTED}, and directions where these are not all.")  # fmt: skip
        first, second = (_ports(parts, name) for name in given[:2])
        pairs = [(first[0], second[0])] if len(first) == len(second) == 1 else _by_position(first, second, given)
        for one, other in pairs:
            result.append(_connection(one, other, given[2], given[3] if len(given) == 4 else None, distance))
    if not result:
        raise ModelError(f"{WHO}: connect is empty; expected pairs of ports, such as [{EXPECTED}].")
    return result


def _ports(parts: Mapping[str, Part], name: str) -> list[tuple[Part, str]]:
    """The ports that a name or a pattern means."""
    ports = [(part, port) for part in parts.values() for port in part.ports]
    known = [f"{part.name}.{port}" for part, port in ports]
    fitting = set(matching(name, known))
    if fitting:
        return [port for port, full_name in zip(ports, known, strict=True) if full_name in fitting]
    part = next((part for part in parts.values() if name.startswith(f"{part.name}.")), None)
    why = f"expected one of {', '.join(known)}" if known else "no part has one"
    about = "" if part is None else (
        f" Inputs and outputs of a port have the same names, '{name.removeprefix(part.name + '.')}.x' and so on: "
        f"model.add_port adds them.")  # fmt: skip
    raise ModelError(f"{WHO}: port {name!r} is unknown; {why}.{nearest(name, known)}{about}", element=name)


def _by_position(
    first: list[tuple[Part, str]], second: list[tuple[Part, str]], given: Any
) -> list[tuple[tuple[Part, str], tuple[Part, str]]]:
    """Each port of the shorter list with the nearest one of the other."""
    from scipy.spatial import KDTree

    swap = len(first) > len(second)
    few, many = (second, first) if swap else (first, second)
    places = [[part.position(port) for part, port in ports] for ports in (few, many)]
    for (part, port), place in zip((*few, *many), (*places[0], *places[1]), strict=True):
        if place is None:
            raise ModelError(f"{WHO}: {shown(given[0])} and {shown(given[1])} are matched by position, but that of "
                             f"'{part.name}.{port}' is not known; name the ports one by one.",
                             element=f"{part.name}.{port}")  # fmt: skip
    gaps, nearest_ones = (found.tolist() for found in KDTree(np.array(places[1])).query(np.array(places[0])))
    taken: dict[int, int] = {}
    for k, chosen in enumerate(nearest_ones):
        if chosen in taken:
            part, port = many[chosen]
            rivals = [f"'{few[i][0].name}.{few[i][1]}' ({1e3 * gaps[i]:.3g} mm)" for i in (taken[chosen], k)]
            raise ModelError(f"{WHO}: '{part.name}.{port}' is the nearest of two ports, {rivals[0]} and {rivals[1]}; "
                             f"expected one for each port of the fewer of {shown(given[0])} and {shown(given[1])}. "
                             f"Give patterns of those that are joined, or name them one by one.",
                             element=f"{part.name}.{port}")  # fmt: skip
        taken[chosen] = k
    pairs = [(few[k], many[chosen]) for k, chosen in enumerate(nearest_ones)]
    return [(b, a) for a, b in pairs] if swap else pairs


def _connection(
    one: tuple[Part, str], other: tuple[Part, str], how: Any, directions: Any, distance: float | None
) -> Connection:
    names = (f"{one[0].name}.{one[1]}", f"{other[0].name}.{other[1]}")
    if one[0] is other[0]:
        raise ModelError(f"{WHO}: '{names[0]}' and '{names[1]}' are ports of one part; expected ports of two.",
                         element=names[0])  # fmt: skip
    own = [part.ports[port] for part, port in (one, other)]
    chosen: tuple[str, ...]
    if directions is None:
        for name, missing in ((names[0], set(own[1]) - set(own[0])), (names[1], set(own[0]) - set(own[1]))):
            if missing:
                both = tuple(d for d in own[0] if d in own[1])
                listed = ", ".join(d for d in DIRECTIONS if d in missing)
                raise ModelError(f"{WHO}: port '{name}' has no {listed}; expected the directions of its partner. To "
                                 f"join those of both alone, write ({names[0]!r}, {names[1]!r}, {shown(how)}, "
                                 f"{both}).", element=name)  # fmt: skip
        chosen = own[0]
    else:
        chosen = (directions,) if isinstance(directions, str) else tuple(dict.fromkeys(directions))
        for one_of in chosen:
            if one_of not in own[0] or one_of not in own[1]:
                common = ", ".join(d for d in own[0] if d in own[1])
                raise ModelError(f"{WHO}: direction {shown(one_of)} of '{names[0]}' and '{names[1]}'; expected some "
                                 f"of {common}, which both have.", element=names[0])  # fmt: skip
    if not chosen:
        raise ModelError(f"{WHO}: '{names[0]}' and '{names[1]}' have no common direction.", element=names[0])
    stiffness, damping, dynamic = _coefficients(how, len(chosen), names)
    return Connection(*names, chosen, stiffness, damping, dynamic, _apart(one, other, chosen, names, distance))


def _coefficients(how: Any, count: int, names: tuple[str, str]) -> tuple[Any, Any, Dynamic | None]:
    """Stiffness and damping (count, count), None for rigid connections, and how the stiffness depends on frequency."""
    if isinstance(how, str):
        if how != "rigid":
            raise ModelError(f"{WHO}: '{names[0]}' and '{names[1]}' are joined {how!r}; expected 'rigid', a stiffness, "
                             f"or a stiffness with a damping or a Dynamic.", element=names[0])  # fmt: skip
        return None, None, None
    stiffness, damping = how if isinstance(how, tuple) and len(how) == 2 else (how, np.zeros(count))
    dynamic = damping if isinstance(damping, Dynamic) else None
    viscous = np.zeros(count) if dynamic is not None else damping
    return _matrix(stiffness, count, "stiffness", names), _matrix(viscous, count, "damping", names), dynamic


def _matrix(value: Any, count: int, label: str, names: tuple[str, str]) -> Array:
    expected = f"{count} numbers, or a matrix of {count} x {count}, in the order of the directions"
    array = reals(value, WHO, f"{label} of '{names[0]}' and '{names[1]}'", expected,
                  partial(ModelError, element=names[0], field=label))  # fmt: skip
    array = np.diag(array) if array.shape == (count,) else array
    size = np.sqrt(np.abs(np.diagonal(array))) if array.shape == (count, count) else array
    if array.shape != (count, count) or not np.isfinite(array).all():
        raise ModelError(f"{WHO}: {label} of '{names[0]}' and '{names[1]}' = {shown(value)}; expected {expected}.",
                         element=names[0], field=label)  # fmt: skip
    unit = np.where(size > 0.0, size, 1.0)
    scaled = array / unit[:, None] / unit
    if np.abs(scaled - scaled.T).max() > ROUNDED or np.linalg.eigvalsh(scaled)[0] < -ROUNDED:
        raise ModelError(f"{WHO}: {label} of '{names[0]}' and '{names[1]}' is not symmetric with eigenvalues of 0 or "
                         f"more; expected that of a passive connection.", element=names[0], field=label)  # fmt: skip
    return np.asarray(0.5 * (array + array.T))


def _apart(
    one: tuple[Part, str], other: tuple[Part, str], directions: tuple[str, ...], names: tuple[str, str],
    distance: float | None,
) -> float | None:  # fmt: skip
    """The distance of two ports [m], None where it is not known; refused if they are apart or point elsewhere."""
    ends = [part.position(port) for part, port in (one, other)]
    if ends[0] is None or ends[1] is None:
        return None
    apart = float(np.linalg.norm(ends[0] - ends[1]))
    if distance is None:
        size = max(one[0].size, other[0].size)
        distance = min(FARTHEST, SHARE * size) if size else FARTHEST
    if apart > distance:
        raise ModelError(f"{WHO}: '{names[0]}' is at {shown(ends[0])} and '{names[1]}' at {shown(ends[1])} m, "
                         f"{apart:.3g} m apart; expected at most distance={distance:g} m, in common world axes.",
                         element=names[0])  # fmt: skip
    for direction in directions:
        along = [part.places.get(("output", f"{port}.{direction}")) for part, port in (one, other)]
        if along[0] is not None and along[1] is not None and along[0].cosine(along[1]) < SAME_DIRECTION:
            raise ModelError(f"{WHO}: {direction} of '{names[0]}' and of '{names[1]}' are different directions; "
                             f"expected the same, in common world axes.", element=names[0])  # fmt: skip
    return apart
