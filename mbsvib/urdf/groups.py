"""Links that move as one: their mass, centre and inertia as one body."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common.arrays import Array
from mbsvib.errors import ModelError
from mbsvib.urdf.reading import Link

# Entries of symmetric tensors below this share of the largest one are rounding of rotated frames, and moments below
# this share of the mass times the squared distance of its centre are rounding of moved ones.
ROUNDING = 1e-15
# Share of the largest moment by which six printed digits can falsify a second moment of mass: half a unit of the last
# digit is at most 5e-6 of an entry; a second moment sums three moments by halves, and products add as much again.
PRINTED = 2e-5


@dataclass(slots=True, eq=False)
class Group:
    """Links that move as one: mass, first moment about the world's origin, and the axes of the first link.

    ``rounding`` [kg m^2]: by how much printed decimals can falsify a second moment of mass.
    """

    name: str
    mass: float = 0.0
    rounding: float = 0.0
    first: Array = field(default_factory=lambda: np.zeros(3))
    links: list[tuple[Link, Array, Array]] = field(default_factory=list)
    axes: Array = field(default_factory=lambda: np.eye(3))

    @property
    def cancelled(self) -> float:
        """Rounding [kg m^2] of moments that were moved to the centres of the links by subtraction."""
        return ROUNDING * sum(link.mass * float(link.centre @ link.centre) for link, _, _ in self.links)

    def take(self, link: Link, origin: Array, axes: Array) -> None:
        """Add a link whose frame is at ``origin`` [m] with ``axes`` (columns), both in the world."""
        if not self.links:
            self.axes = axes
        self.links.append((link, origin + axes @ link.centre, axes @ link.inertia @ axes.T))
        self.mass += link.mass
        self.rounding += link.rounding
        self.first += link.mass * self.links[-1][1]

    def add(self, model: Model, path: str | PathLike[str], way: str, repair: bool = False) -> bool:
        """Add the body that the links are together; return whether its inertia was far from possible and is repaired.

        The second moments of mass E = tr(J) / 2 - J of a body are positive semidefinite. The nearest possible E has
        zero for negative eigenvalues, and J = tr(E) - E. A refusal ends with ``way``, what to do.
        """
        centre = self.first / self.mass if self.mass else self.links[0][1]
        tensor = np.zeros((3, 3))
        for link, at, inertia in self.links:
            arm = at - centre
            tensor += inertia + link.mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
        tensor = self.axes.T @ tensor @ self.axes
        tensor = 0.5 * (tensor + tensor.T)
        if not np.isfinite(tensor).all():
            raise ModelError(f"{path}: body '{self.name}': its mass, inertia or distances are too large for numbers "
                             f"of 64 bits: moment of inertia {np.abs(tensor).max():g} kg m^2. {way}", element=self.name,
                             field="inertia")  # fmt: skip
        values, vectors = np.linalg.eigh(0.5 * np.trace(tensor) * np.eye(3) - tensor)
        slack = PRINTED * np.abs(tensor).max() + self.rounding + self.cancelled
        impossible = bool(values[0] < -slack)
        if impossible and not repair:
            low, middle, high = np.linalg.eigvalsh(tensor)
            raise ModelError(f"{path}: body '{self.name}': inertia has principal moments {low:.6g}, {middle:.6g}, "
                             f"{high:.6g} kg m^2; none can be negative or exceed the sum of the other two. {way}",
                             element=self.name, field="inertia")  # fmt: skip
        if values[0] < 0.0:
            second = (vectors * np.maximum(values, 0.0)) @ vectors.T
            tensor = np.trace(second) * np.eye(3) - second
        tensor[np.abs(tensor) <= ROUNDING * np.abs(tensor).max()] = 0.0
        model.add_body(self.name, self.mass, tensor, centre, self.axes)
        return impossible
