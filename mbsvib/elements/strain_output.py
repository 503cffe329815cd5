"""Strain outputs: the axial strain on the surface of a beam, as measured by a strain gauge.

eps = d_x / L - y v'' - z w'', with the deformations (d, theta) of a beam element of length L about its midpoint, in its
axes: v'' = theta_z / L +- 6 d_y / (L^2 (1 + phi_y)) and w'' = -theta_y / L +- 6 d_z / (L^2 (1 + phi_z)), with + at its
start and - at its end. So the output is one relative displacement of the two nodes of the element.

Source: Przemieniecki, Theory of Matrix Structural Analysis (1968), section 5.6 (displacements between the nodes).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mbsvib.common import arguments as check
from mbsvib.elements import ports
from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_element import Prismatic, shear_ratios
from mbsvib.elements.flexure import Leaf
from mbsvib.elements.part import Part
from mbsvib.elements.placement import Placement
from mbsvib.elements.sections import Rectangle, Section
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.errors import ModelError

# Positions along an element, from its midpoint in half lengths.
POSITIONS = {"start": -1.0, "middle": 0.0, "end": 1.0}
SIDES = ("y", "-y", "z", "-z")
UNIT = "m/m"


@dataclass(frozen=True, slots=True)
class StrainOutput(ports.Signal):
    """The axial strain of the beam element ``element`` ``at`` its start, middle or end, on the ``side`` of the section.

    ``distance`` [m] from the centre line; None: the surface of the section.
    """

    element: str = field()
    at: str = "start"
    side: str = "z"
    distance: float | None = None

    def placed(self, to: Placement) -> dict[str, Any]:
        opposite = {"z": "-z", "-z": "z"} if to.mirrored else {}
        return {"element": to.name(self.element), "side": opposite.get(self.side, self.side)}

    @property
    def unit(self) -> str:
        return UNIT


def make(name: str, element: str, at: Any = "start", side: Any = "z", distance: Any = None) -> StrainOutput:
    """Check the values of a strain output and build it."""
    who = f"strain output '{name}'"
    if not isinstance(at, str) or at not in POSITIONS:
        raise check.refuse(who, "at", at, "'start', 'middle' or 'end' of the element")
    if not isinstance(side, str) or side not in SIDES:
        raise check.refuse(who, "side", side, "'y', '-y', 'z' or '-z', the direction of the surface in the beam's axes")
    if distance is not None:
        distance = check.number(distance, who, "distance", "a distance from the centre line [m]")
        if distance < 0.0:
            raise check.refuse(who, "distance", distance, "a distance that is not negative [m]")
    return StrainOutput(name, element, at, side, distance)


def expand(part: StrainOutput, composed: Mapping[str, Part]) -> ExpandedPart:
    """Return the output as a relative displacement of the two nodes of its element."""
    beam = next(item for item in composed.values() if isinstance(item, Beam) and part.element in item.element_names)
    if not isinstance(beam.element(1.0), Prismatic):
        raise ModelError(f"strain output '{part.name}': the section of {beam.family} '{beam.name}' is not constant, so "
                         f"that its strain is not linear along it; ask for the moment in it by a force output on "
                         f"'{part.element}'.", element=part.name, field="element")  # fmt: skip
    i = beam.element_names.index(part.element)
    length, axes = beam.frames()[i]
    sign = -1.0 if part.side[0] == "-" else 1.0
    offset = sign * (_surface(part, beam) if part.distance is None else part.distance)
    end, shear = -POSITIONS[part.at], shear_ratios(length, beam.properties, beam.material, beam.shear)
    local = [1.0 / length, 0.0, 0.0, 0.0, 0.0, 0.0]
    if part.side[-1] == "y":
        local[5] = -offset / length
        local[1] = -6.0 * end * offset / (length * length * (1.0 + shear[0]))
    else:
        local[4] = offset / length
        local[2] = -6.0 * end * offset / (length * length * (1.0 + shear[1]))
    world = [sum(row[k] * local[start + k] for k in range(3)) for start in (0, 3) for row in axes]
    output = ports.make_output(part.name, beam.body_of(i + 1), world, beam.middle(i), beam.body_of(i),
                               "displacement", None, UNIT)  # fmt: skip
    return ExpandedPart(outputs={part.name: output})


def _surface(part: StrainOutput, beam: Beam) -> float:
    """Distance of the surface from the centre line [m]."""
    section = beam.section
    if isinstance(section, Rectangle):
        return 0.5 * (section.width if part.side[-1] == "y" else section.height)
    if isinstance(section, Leaf):
        return 0.5 * (section.width if part.side[-1] == "y" else section.thickness)
    if isinstance(section, Section):
        raise ModelError(f"strain output '{part.name}': the section of beam '{beam.name}' is given by its properties, "
                         f"which do not contain its surface; give distance= [m] from the centre line.",
                         element=part.name, field="distance")  # fmt: skip
    return section.radius
