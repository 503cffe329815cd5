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
``MAXWELL.static_stiffness``            N/m                         of the spring parallel to both
``SPRING.preload``                      N                           where given; likewise ``SPRING.free_length``, m
``BUSHING.stiffness.x`` ... ``.rz``     N/m, N m/rad                likewise ``damping``
``BUSHING.stiffness.x.rz``              N/m, N/rad, N m/rad         off the diagonal of a 6x6 matrix, see below
``BUSHING.preload.x`` ... ``.rz``       N, N m                      where given
``BUSHING.g1``, ``.tau1`` (2 ...)       -, s                        of its relaxations
``BUSHING.dynamic_stiffness.x`` ...     N/m, N m/rad                where given
``GEAR.ratio``, ``RACK.radius``         -, m                        of gears and worms; of racks
``COUPLER.coefficient.1`` (2 ...)       -                           in the order of the sum
``ROTOR.speed``, ``ROTOR.inertia``      rad/s, kg m^2               inertia where given
``LOAD.force.x``, ``LOAD.torque.x``     N, N m                      world axes; ``LOAD.position.x``, m, where given
``gravity.x`` (y z)                     m/s^2                       of the model, where given; world axes
``travel.x`` (y z)                      m/s                         of the model, where given; world axes
``ROLLING.radius``                      m                           of a rolling wheel
``BEAM.E``, ``.rho``, ``.nu`` or ``.G``  N/m^2, kg/m^3, -           of its material
``BEAM.radius`` (wall, width, height)   m                           of its section, or ``.A``, ``.Iy``, ``.Iz``, ``.J``
``BEAM.alpha``, ``.beta``               1/s, s                      Rayleigh damping; likewise ``.damping_ratio``
======================================  ==========================  ============================================

A symmetric 6x6 matrix has each pair of entries off the diagonal once; one with cross-coupling has all entries.

An orientation parameter is a component of the rotation vector w, in world axes, of the part from its present
orientation: its axes Q become exp([w]x) Q, so that these parameters are zero, also in a model that ``with_values`` has
turned: further values and sensitivities are rotations from there. ``studies.rates_at`` has the linear maps by which
sensitivities at w are slopes of the components of w. A joint that is defined by its axis, or
by two, turns with all of its axes. The position of a body is that of its centre of mass: joints and springs stay.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.fast_init import fast_init
from mbsvib.common.patterns import matching
from mbsvib.elements.part import Part
from mbsvib.errors import ModelError, nearest


class UnknownParameterError(ModelError, KeyError):
    """A name that no parameter has."""

    def __str__(self) -> str:
        return str(self.args[0])


@fast_init
@dataclass(frozen=True, slots=True, repr=False)
class Parameter(Displayed):
    """A number of a model: entry ``index`` of the field ``field`` of the part named ``part``; ``unit`` is SI.

    Both of a pair of entries of a symmetric matrix are one number: ``is_pair``.
    """

    name: str
    """Name, such as leg1.k.stiffness."""
    part: str
    field: str
    index: tuple[int, ...]
    value: float
    """Value [unit]."""
    unit: str
    is_pair: bool = False


class Parameters(Columnar, Mapping[str, float], Displayed):
    """The parameters of some parts: a read-only mapping from name to value, computed on first access."""

    def __init__(self, parts: Iterable[Part]) -> None:
        self._parts = {part.name: part for part in parts}
        self._of_part: dict[str, dict[str, Parameter]] = {}

    @cached_property
    def _entries(self) -> dict[str, Parameter]:
        return {entry.name: entry for part in self._parts.values() for entry in _listed(part)}

    def _find(self, name: str) -> Parameter | None:
        """The parameter of a name, or None; only the parameters of its part are computed."""
        if not isinstance(name, str):
            return None
        if "_entries" in vars(self):
            return self._entries.get(name)
        ends = [i for i, sign in enumerate(name) if sign == "."]
        for part in (self._parts[name[:i]] for i in ends if name[:i] in self._parts):
            if part.name not in self._of_part:
                self._of_part[part.name] = {entry.name: entry for entry in _listed(part)}
            if name in self._of_part[part.name]:
                return self._of_part[part.name][name]
        return None

    _index = "parameter"

    def columns(self) -> dict[str, Any]:
        """Return all parameters as columns by name.

        Returns
        -------
        dict of str to array, shape (parameters,)
            ``parameter``, ``value``, ``unit``.
        """
        return {"parameter": np.array(list(self)), "value": np.array(list(self.values())),
                "unit": np.array([entry.unit for entry in self.entries])}  # fmt: skip

    @property
    def entries(self) -> tuple[Parameter, ...]:
        """All parameters with part, field, index, value and unit."""
        return tuple(self._entries.values())

    @property
    def parts(self) -> Mapping[str, Part]:
        """The parts themselves, by name."""
        return self._parts

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Unit of each parameter, by its name."""
        return {name: entry.unit for name, entry in self._entries.items()}

    def entry(self, name: str) -> Parameter:
        """Return a parameter by its name.

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
        parameter = self._find(name)
        if parameter is None:
            raise UnknownParameterError(
                f"there is no parameter '{name}'.{nearest(str(name), self._entries)} {_hint(str(name), self._parts)}"
                .rstrip(), element=str(name),
            )  # fmt: skip
        return parameter

    def matching(self, pattern: str) -> list[str]:
        """Return the names that match a pattern.

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
        matches = matching(pattern, self._entries)
        if not matches:
            raise UnknownParameterError(
                f"there is no parameter '{pattern}': the pattern matches none of {len(self)}."
                f"{nearest(pattern, self._entries)} {_hint(pattern, self._parts)}", element=pattern,
            )  # fmt: skip
        return matches

    def __getitem__(self, name: str) -> float:
        return self.entry(name).value

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __repr__(self) -> str:
        return f"Parameters({len(self)} of {len(self._parts)} parts)"


def _listed(part: Part) -> Iterator[Parameter]:
    """All parameters of one part."""
    for field in part.parameter_fields():
        owner = f"{part.name}.{field.name}" if field.name else part.name
        symmetric = field.is_symmetric
        for end, index, value, unit in field.entries():
            yield Parameter(owner + end, part.name, field.name, index, value, unit,
                            symmetric and index[0] != index[1])  # fmt: skip


def _hint(name: str, parts: Iterable[str]) -> str:
    owner = max((part for part in parts if f"{name}.".startswith(f"{part}.")), key=len, default=None)
    if owner is None:
        return ("Parameters are named PART.mass, .inertia.xx, .position.x, .orientation.rx, .stiffness, .stiffness.x, "
                ".damping, .start.x, .end.x, .pitch, .preload, .free_length, .force.x or .torque.x.")  # fmt: skip
    return f"model.parameters.matching('{owner}.*') lists those of '{owner}'."
