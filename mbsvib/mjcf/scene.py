"""State of the conversion of a MuJoCo file: the model so far, and its names of the file's bodies and joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.mjcf.compiled import Compiled
from mbsvib.urdf.wheels import add_wheel, fresh


@dataclass(slots=True, eq=False)
class Link:
    """A joint in the model: its bodies, its point and axis z (world), and the place of z or rz among x ... rz; None
    where it has several freedoms.
    """

    name: str
    first: str
    second: str
    at: Array
    z: Array
    direction: int | None

    @property
    def axes(self) -> Array:
        """The joint's axes as columns, z along its axis."""
        return np.array(check.frame_along(check.axis(tuple(self.z), self.name, "axis")))

    @property
    def coordinate(self) -> str:
        """Name of its only coordinate."""
        return f"{self.name}.{'z' if self.direction == 2 else 'rz'}"


@dataclass(slots=True, eq=False)
class Scene:
    """The file, the model so far, and its names of the file's elements.

    ``bodies`` gives the body of the model by the number of MuJoCo's, ``links`` the joint. ``joint_forces`` sums up what
    springs and actuators do along MuJoCo's coordinates, to be compared with its own. ``remarks`` list omissions.
    """

    file: Compiled
    model: Model
    joint_forces: Array
    bodies: dict[int, str] = field(default_factory=dict)
    links: dict[int, Link] = field(default_factory=dict)
    wheels: dict[str, tuple[str, float]] = field(default_factory=dict)
    remarks: dict[str, list[str]] = field(default_factory=dict)

    def fresh(self, name: str, more: str) -> str:
        """Return an unused name: the name itself, or with a suffix."""
        return fresh(self.model, name, more)

    def add_wheel(self, name: str, terms: Mapping[str, float], inertia: float, link: Link) -> tuple[str, float]:
        """Add a wheel on the ground at a joint; see ``urdf.wheels``."""
        return add_wheel(self.model, name, terms, inertia, link.at, link.axes, float(self.file.m.stat.extent))

    def remark(self, text: str, name: str) -> None:
        """Record that a property of an element was left out."""
        self.remarks.setdefault(text, []).append(name)
