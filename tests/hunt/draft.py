"""A scene in the making: its calls, and what later calls may refer to."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tests.hunt.joints import MORE_FREE
from tests.hunt.scene import Call
from tests.support.exact import FREE
from tests.support.random_models import coefficients, rotation

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
# kinds of joints in which only the direction of the axis matters
ROUND = ("revolute", "prismatic", "cylindrical", "screw")


@dataclass
class Draft:
    """Calls so far; points of the bodies, and which of them spin, are massless or belong to a flexible part."""

    rng: np.random.Generator
    features: frozenset[str]
    calls: list[Any] = field(default_factory=list)
    points: dict[str, Any] = field(default_factory=lambda: {"ground": np.zeros(3)})
    spinning: set[str] = field(default_factory=set)
    light: set[str] = field(default_factory=set)
    nodes: dict[str, Any] = field(default_factory=dict)
    joints: dict[str, Any] = field(default_factory=dict)
    loops: list[Any] = field(default_factory=list)
    gravity: tuple[Any, ...] | None = None

    def add(self, call, prefix, /, **arguments):
        """Add a call under the next name with this prefix."""
        name = f"{prefix}{sum(other.name.startswith(prefix) for other in self.calls)}"
        self.calls.append(Call(call, name, {k: v for k, v in arguments.items() if v is not None or k == "kind"}))
        return name

    def near(self, name, deviation=0.3):
        """A point near a body or node."""
        return (self.points | self.nodes)[name] + self.rng.uniform(-deviation, deviation, size=3)

    def chance(self, share):
        return self.rng.random() < share

    def pick(self, values):
        values = list(values)
        return values[self.rng.integers(len(values))]

    @property
    def bodies(self):
        """Bodies to which more may be attached: they do not spin."""
        return [name for name in self.points if name != "ground" and name not in self.spinning]

    @property
    def heavy(self):
        return [name for name in self.bodies if name not in self.light]

    @property
    def anchors(self):
        """What a joint or spring may go to besides bodies: ground, unless the mechanism floats."""
        return self.bodies + ([] if "floating" in self.features else ["ground"])

    def pair(self):
        """Two bodies, or a body and ground, in random order."""
        first = self.pick(self.bodies)
        others = [name for name in self.anchors if name != first]
        if not others:
            return ("ground", first)
        second = self.pick(others)
        return (first, second) if self.chance(0.5) else (second, first)

    def body(self, prefix="b", at=None, mass=None, symmetric=None):
        """A body with a random tensor, stated in one of three ways; ``symmetric`` about z of these axes."""
        rng = self.rng
        at = self.points["ground"] + rng.uniform(-1, 1, size=3) if at is None else at
        mass = 10 ** rng.uniform(-0.3, 0.8) if mass is None else mass
        a, b, c = rng.uniform(0.15, 0.5, size=3) ** 2 * mass / 3
        if symmetric is not None:
            b = a
        principal = np.array([b + c, a + c, a + b])
        orientation = rotation(rng) if symmetric is None and self.chance(0.7) else symmetric
        inertia = principal
        if symmetric is None and self.chance(0.6):
            turn = rotation(rng)
            inertia = turn @ np.diag(principal) @ turn.T
            inertia = (inertia + inertia.T) / 2
            if self.chance(0.5):
                inertia = np.array([*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]])
        name = self.add("body", prefix, mass=mass, inertia=inertia, position=at, orientation=orientation)
        self.points[name] = np.array(at)
        return name

    def joint(self, kind, first, second, at=None, axes=None, free=None, **arguments):
        """A joint; its axes are random unless they are given."""
        rng = self.rng
        at = 0.5 * (self.points[first] + self.points[second]) + rng.uniform(-0.3, 0.3, size=3) if at is None else at
        arguments["position"] = at
        if kind == "distance":
            arguments["end"] = arguments.get("end", at + rng.uniform(-0.5, 0.5, size=3))
        elif axes is not None:
            arguments["orientation"] = axes
        elif kind == "universal" and self.chance(0.6):
            arguments["axis"], arguments["axis2"] = rng.normal(size=(2, 3)) * rng.choice([1.0, 20.0])
        elif kind in ROUND and self.chance(0.3):
            arguments["axis"] = rng.normal(size=3)
        elif self.chance(0.9):
            arguments["orientation"] = rotation(rng)
        if kind == "screw":
            arguments["pitch"] = rng.choice([-1, 1]) * 10 ** rng.uniform(-2, -0.5)
        if kind == "custom":
            if free is None:
                free = tuple(np.array(DIRECTIONS)[rng.random(6) < 0.5].tolist())
            arguments["free"] = free
        if kind in ("prismatic", "fixed") and self.chance(0.4):
            del arguments["position"]
        name = self.add("joint", "j", kind=None if kind == "custom" else kind, first=first, second=second, **arguments)
        self.joints[name] = (kind, free if kind == "custom" else (FREE | MORE_FREE)[kind])
        return name

    def stiffness(self, full=False, negative=False):
        """Six coefficients or a full matrix of a bushing."""
        return coefficients(self.rng, 10 ** self.rng.uniform(3, 4.5), full, -1 if negative else 1)

    def damping(self, stiffness):
        """Damping of a bushing or spring as the scene's features say, or None."""
        if "no damping" in self.features:
            return None
        if "proportional damping" in self.features:
            return 1e-3 * np.array(stiffness) if np.ndim(stiffness) else 1e-3 * stiffness
        if self.chance(0.3):
            return None
        share = 10 ** (self.rng.uniform(-2, -0.5) if "strong damping" in self.features else self.rng.uniform(-5, -3))
        if not np.ndim(stiffness):
            return share * stiffness
        size = share * float(np.max(np.abs(stiffness)))
        return coefficients(self.rng, size, bool(self.rng.random() < 0.3))
