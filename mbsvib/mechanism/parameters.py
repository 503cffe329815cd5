"""Parameters: every number of bodies, joints and spring-dampers by a name of its own.

======================================  ==========================  ============================================
name                                    unit                        what it is
======================================  ==========================  ============================================
``BODY.mass``                           kg
``BODY.inertia.xx`` (yy zz xy xz yz)    kg m^2                      tensor about the centre of mass, body axes
``PART.position.x`` (y z)               m                           of a body, joint or bushing, world axes
``PART.orientation.rx`` (ry rz)         rad                         see below
``JOINT.pitch``                         m/rad                       of a screw
``JOINT.end.x`` (y z)                   m                           of a distance joint, which has no orientation
``SPRING.start.x``, ``SPRING.end.x``    m                           the two points of a line spring
``SPRING.stiffness``, ``.damping``      N/m, N s/m                  of a line spring
``MAXWELL.stiffness``, ``.damping``     N/m, N s/m                  of a spring and a damper in series
``MAXWELL.static_stiffness``            N/m                         of the spring beside both
``SPRING.preload``                      N                           where given; likewise ``SPRING.free_length``, m
``BUSHING.stiffness.x`` ... ``.rz``     N/m, N m/rad                likewise ``damping``
``BUSHING.stiffness.x.rz``              N/m, N/rad, N m/rad         off the diagonal of a 6x6 matrix, each pair once
``BUSHING.preload.x`` ... ``.rz``       N, N m                      where given
``GEAR.ratio``, ``RACK.radius``         -, m                        of gears and worms; of racks
``COUPLER.coefficient.1`` (2 ...)       -                           in the order of the sum
``ROTOR.speed``, ``ROTOR.inertia``      rad/s, kg m^2               inertia where given
``LOAD.force.x``, ``LOAD.torque.x``     N, N m                      world axes; ``LOAD.position.x``, m, where given
``gravity.x`` (y z)                     m/s^2                       of the model, where given; world axes
``BEAM.E``, ``.rho``, ``.nu`` or ``.G``  N/m^2, kg/m^3, -           of its material
``BEAM.radius`` (wall, width, height)   m                           of its section, or ``.A``, ``.Iy``, ``.Iz``, ``.J``
``BEAM.alpha``, ``.beta``               1/s, s                      Rayleigh damping; likewise ``.damping_ratio``
======================================  ==========================  ============================================

An orientation parameter is a component of the rotation vector w, in world axes, that turns the part from where it is
given: its axes Q become exp([w]x) Q, so that these parameters are zero at the pose. A joint that is given by its
axis, or its two, turns as a whole. The position of a body is that of its centre of mass: joints and springs stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from typing import TYPE_CHECKING, Any

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.elements import Body, Bushing, Joint, Load, Maxwell, Spring
from mbsvib.elements.part import Numbered
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.elements.part import Part

_OF_BEAMS = {"E": "N/m^2", "G": "N/m^2", "rho": "kg/m^3", "nu": "-", "A": "m^2", "Iy": "m^4", "Iz": "m^4", "J": "m^4",
             "ky": "-", "kz": "-", "alpha": "1/s", "beta": "s", "damping_ratio": "-"}  # fmt: skip
_TENSOR = ("xx", "yy", "zz", "xy", "xz", "yz")
_END = re.compile(
    r"\.(?:(?P<field>mass|pitch|speed|inertia|position(?=\.)|start(?=\.)|end(?=\.)|orientation(?=\.)|stiffness|damping|static_stiffness|preload|"
    r"free_length|force(?=\.)|torque(?=\.)|E|G|rho|nu|A|Iy|Iz|J|ky|kz|ratio|coefficient(?=\.)|radius|wall|width|height|length|alpha|beta|damping_ratio)"
    r"(?:\.(?P<first>[a-z]{1,2}|[1-9][0-9]*)(?:\.(?P<second>[a-z]{1,2}))?)?)$"
)


_GRAVITY = re.compile(r"(?<=^gravity)\.[xyz]$")


class UnknownParameterError(ModelError, KeyError):
    """A name that no parameter has."""

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a model: entry ``index`` of the field ``field`` of the part named ``part``; ``unit`` is SI."""

    name: str
    part: str
    field: str
    index: tuple[int, ...]
    value: float

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return unit(self.name)


class Parameters(Mapping[str, float]):
    """The parameters of some parts: a read-only mapping from name to value, made when it is first looked into."""

    def __init__(self, parts: Iterable[Part]) -> None:
        self._parts = {part.name: part for part in parts}
        self._of_part: dict[str, dict[str, Parameter]] = {}

    @cached_property
    def _entries(self) -> dict[str, Parameter]:
        return {entry.name: entry for part in self._parts.values() for entry in _listed(part)}

    def _find(self, name: str) -> Parameter | None:
        """Look one name up; a part is listed alone, as most of a large model is never asked for."""
        end = _END.search(name) or _GRAVITY.search(name) if isinstance(name, str) else None
        part = self._parts.get(name[: end.start()]) if end else None
        if part is None:
            return None
        if part.name not in self._of_part:
            self._of_part[part.name] = {entry.name: entry for entry in _listed(part)}
        return self._of_part[part.name].get(name)

    @property
    def entries(self) -> tuple[Parameter, ...]:
        """All parameters with what is known of each."""
        return tuple(self._entries.values())

    @property
    def parts(self) -> Mapping[str, Part]:
        """The parts themselves, by name."""
        return self._parts

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Unit of each parameter, by its name."""
        return {name: unit(name) for name in self._entries}

    def entry(self, name: str) -> Parameter:
        """Return a parameter with all that is known of it.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        Parameter
            Part, field, index, value and unit.

        Raises
        ------
        UnknownParameterError
            If there is no such parameter; the message suggests the nearest.
        """
        found = self._find(name)
        if found is None:
            raise UnknownParameterError(
                f"there is no parameter '{name}'.{nearest(str(name), self._entries)} {_hint(str(name), self._parts)}"
                .rstrip(), element=str(name),
            )  # fmt: skip
        return found

    def matching(self, pattern: str) -> list[str]:
        """Return the names that a pattern picks.

        Parameters
        ----------
        pattern : str
            A name, or one with ``*``, ``?`` or ``[...]`` as in file names (``"leg*.k.stiffness"``).

        Returns
        -------
        list of str
            At least one name.

        Raises
        ------
        UnknownParameterError
            If no parameter has such a name.
        """
        if self._find(pattern) or not any(sign in str(pattern) for sign in "*?["):
            return [self.entry(pattern).name]
        found = [name for name in self._entries if fnmatchcase(name, pattern)]
        if not found:
            raise UnknownParameterError(
                f"there is no parameter '{pattern}': the pattern picks none of {len(self)}."
                f"{nearest(pattern, self._entries)} {_hint(pattern, self._parts)}", element=pattern,
            )  # fmt: skip
        return found

    def __getitem__(self, name: str) -> float:
        return self.entry(name).value

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __repr__(self) -> str:
        return f"Parameters({len(self)} of {len(self._parts)} parts)"


def unit(name: str) -> str:
    """Return the unit of a parameter, which its name tells.

    Parameters
    ----------
    name : str
        Name of the parameter, as ``model.parameters`` has it.

    Returns
    -------
    str
        Unit, SI.

    Raises
    ------
    UnknownParameterError
        If the name does not end as that of a parameter.
    """
    if _GRAVITY.search(name):
        return "m/s^2"
    end = _END.search(name)
    if end is None:
        raise UnknownParameterError(f"'{name}' does not end as the name of a parameter does. {_hint(name, ())}",
                                    element=name)  # fmt: skip
    field, first, second = end["field"], end["first"], end["second"]
    if field == "preload":
        return "N m" if first is not None and first[0] == "r" else "N"
    plain = {"mass": "kg", "inertia": "kg m^2", "orientation": "rad", "pitch": "m/rad", "force": "N", "torque": "N m",
             "ratio": "-", "coefficient": "-", "speed": "rad/s", **_OF_BEAMS}  # fmt: skip
    if field not in ("stiffness", "damping", "static_stiffness"):
        return plain.get(field, "m")
    per = " s" if field == "damping" else ""
    turns = sum(direction is not None and direction[0] == "r" for direction in (first, second or first))
    return (f"N{per}/m", f"N{per}/rad", f"N m{per}/rad")[turns]


def _listed(part: Part) -> Iterator[Parameter]:
    """All parameters of one part."""
    for field, ends, value in _families(part):
        owner = f"{part.name}.{field}" if field else part.name
        for end, index, entry in zip(*_indexed(ends, value), strict=True):
            yield Parameter(owner + end, part.name, field, index, entry)


def _families(part: Part) -> Iterator[tuple[str, tuple[str, ...] | None, Any]]:
    """(field, names of its entries, value) of a part; None: a number, which has none."""
    turn = ("orientation", DIRECTIONS[3:], (0.0, 0.0, 0.0))
    if isinstance(part, Body):
        yield "mass", None, part.mass
        yield "inertia", _TENSOR, part.inertia
        yield "position", DIRECTIONS[:3], part.position
        yield turn
    elif isinstance(part, Joint):
        if part.position is not None:
            yield "position", DIRECTIONS[:3], part.position
        if part.end is not None:  # a rod, which turns with its two points
            yield "end", DIRECTIONS[:3], part.end
        else:
            yield turn
        if part.pitch is not None:
            yield "pitch", None, part.pitch
    elif isinstance(part, Bushing):
        yield "stiffness", DIRECTIONS, part.stiffness
        yield "damping", DIRECTIONS, part.damping
        yield "position", DIRECTIONS[:3], part.position
        yield turn
        if part.preload is not None:
            yield "preload", DIRECTIONS, part.preload
    elif isinstance(part, Spring):
        yield "stiffness", None, part.stiffness
        yield "damping", None, part.damping
        yield "start", DIRECTIONS[:3], part.start
        yield "end", DIRECTIONS[:3], part.end
        if part.preload is not None:
            yield "preload", None, part.preload
        if part.free_length is not None:
            yield "free_length", None, part.free_length
    elif isinstance(part, Maxwell):
        yield "stiffness", None, part.stiffness
        yield "damping", None, part.damping
        yield "static_stiffness", None, part.static_stiffness
        yield "start", DIRECTIONS[:3], part.start
        yield "end", DIRECTIONS[:3], part.end
    elif isinstance(part, Numbered):
        yield from part.numbers()
    elif isinstance(part, Load):
        yield "force", DIRECTIONS[:3], part.force
        yield "torque", DIRECTIONS[:3], part.torque
        if part.position is not None:
            yield "position", DIRECTIONS[:3], part.position


def _indexed(ends: tuple[str, ...] | None, value: Any) -> tuple[list[str], list[tuple[int, ...]], list[float]]:
    if ends is None:
        return [""], [()], [value]
    if not isinstance(value[0], tuple):
        return [f".{end}" for end in ends], [(i,) for i in range(len(ends))], list(value)
    index = [(i, j) for i in range(6) for j in range(i, 6)]
    return [f".{ends[i]}" + (f".{ends[j]}" if i != j else "") for i, j in index], list(index), \
        [value[i][j] for i, j in index]  # fmt: skip


def _hint(name: str, parts: Iterable[str]) -> str:
    owner = max((part for part in parts if name.startswith(f"{part}.")), key=len, default=None)
    if owner is None:
        return ("Parameters are named PART.mass, .inertia.xx, .position.x, .orientation.rx, .stiffness, .stiffness.x, "
                ".damping, .start.x, .end.x, .pitch, .preload, .free_length, .force.x or .torque.x.")  # fmt: skip
    return f"See [name for name in model.parameters if name.startswith('{owner}.')]."
