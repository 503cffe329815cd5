"""What loads a mechanism, in numbers: gravity, loads on bodies, and the preloads of springs and bushings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import Bushing, Maxwell, Spring
from mbsvib.equations.wrench_pairs import Pairs

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.mechanism.mechanism import Mechanism

    Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Applied:
    """What acts on the bodies: ``weight`` (3, bodies + 1) [N] at the centres of mass, and ``pairs`` of forces.

    ``names`` tells whose pair each is: the loads first (on ``first`` = ground nothing comes of it), then the line
    springs, then the bushings; ``loads`` and ``lines`` count them, ``follower`` (loads,) tells what turns with a body.
    """

    weight: Array
    pairs: Pairs
    names: tuple[str, ...]
    loads: int
    lines: int
    follower: Mask

    @property
    def tension(self) -> Index:
        """Numbers of the pairs that are tensions of line springs."""
        return np.arange(self.loads, self.loads + self.lines)

    @property
    def bushings(self) -> Index:
        """Numbers of the pairs that are preloads of bushings."""
        return np.arange(self.loads + self.lines, len(self.names))


def is_loaded(model: Mechanism) -> bool:
    """Tell whether anything loads a model: gravity, a load, or a preload."""
    gravity = model.gravity is not None and any(model.gravity)
    return gravity or bool(model.loads) or any(spring.loaded for spring in model.springs.values())


def applied(model: Mechanism, number: Mapping[str, int]) -> Applied:
    """Return what loads a model.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    number : mapping
        Number of each body, ground included.

    Returns
    -------
    Applied
        Weights and pairs of forces, in the given pose.
    """
    weight = np.zeros((3, len(model.bodies) + 1))
    if model.gravity is not None:
        weight[:, :-1] = np.multiply.outer(model.gravity, [body.mass for body in model.bodies.values()])
    ground = number["ground"]
    tuples: list[tuple[float, ...]] = []
    names: list[str] = []
    for load in model.loads.values():
        at = load.position or model.bodies[load.body].position
        tuples.append((ground, number[load.body], *at, *at, *load.force, *load.torque))
        names.append(load.name)
    springs = [spring for spring in model.springs.values() if spring.loaded]
    lines = [spring for spring in springs if isinstance(spring, (Spring, Maxwell))]
    for line in lines:
        pull = [-line.tension * e for e in line.line]
        tuples.append((number[line.first], number[line.second], *line.start, *line.end, *pull, 0.0, 0.0, 0.0))
        names.append(line.name)
    for spring in springs:
        if isinstance(spring, Bushing) and spring.preload is not None:
            wrench = np.array(spring.orientation) @ np.array(spring.preload).reshape(2, 3).T
            tuples.append((number[spring.first], number[spring.second], *spring.position, *spring.position,
                           *wrench[:, 0].tolist(), *wrench[:, 1].tolist()))  # fmt: skip
            names.append(spring.name)
    follower = np.array([load.follower for load in model.loads.values()], dtype=bool)
    return Applied(weight, Pairs.stack(tuples), tuple(names), len(model.loads), len(lines), follower)
