"""Roles of fields: they name what is there, and batches find every value that a part refuses."""

from dataclasses import dataclass, fields

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements.connection import ENDS, LINE, Connection
from mbsvib.elements.families import FAMILIES
from mbsvib.elements.placement import Placement
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import stated
from mbsvib.equations.batch_values import Values
from mbsvib.equilibrium.moved_parts import model_in_pose
from mbsvib.errors import ModelError
from mbsvib.kinematics.pose import start
from mbsvib.mechanism.changes import Slots
from mbsvib.mechanism.parameters import Parameters


def model():
    result = mv.Model("all")
    for name, x in (("a", 0.0), ("b", 1.0)):
        result.add_body(name, 2.0, (0.2, 0.3, 0.4), position=(x, 0, 0))
    result.add_joint("screw", "screw", "ground", "a", (0, 0, 0), axis=(0, 0, 1), pitch=0.1)
    result.add_joint("rod", "distance", "a", "b", (1, 1, 1), end=(2, 1, 1))
    ends = ("a", "b", (1, 1, 1), (2, 1, 1))  # the same point where x is 1
    result.add_spring("spring", *ends, stiffness=3.0, damping=1.0, preload=2.0)
    result.add_spring("free", *ends, stiffness=3.0, free_length=0.5)
    result.add_spring("damper", *ends, damping=1.0)
    result.add_spring("slow", *ends, stiffness=3.0, dynamic=mv.Dynamic.zener(2.0, 0.1))
    result.add_maxwell("maxwell", *ends, stiffness=3.0, damping=1.0, static_stiffness=2.0, preload=1.0)
    result.add_maxwell("bare", *ends, stiffness=3.0, damping=1.0, preload=0.0)
    result.add_inerter("inerter", *ends, 1.0)
    result.add_torsion_spring("torsion", "a", "b", (0, 0, 1), stiffness=1.0, preload=0.5)
    result.add_bushing("bushing", "a", "b", (0, 0, 0), (1, 0, 0, 0, 0, 1), preload=(0, 1, 0, 0, 0, 0))
    result.add_bushing("pad", "a", "b", (0, 0, 0), damping=(1, 0, 0, 0, 0, 0))
    result.add_rotor("rotor", "a", 10.0, (0, 0, 1), inertia=0.1)
    result.add_load("load", "a", force=(1, 0, 0), torque=(0, 0, 0), position=(0, 0, 0))
    return result


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.part.__name__)
def test_roles_name_what_is_there(family):
    names = {item.name for item in fields(family.part)}
    for name, role in family.part.roles.items():
        assert {name, *{role.on, role.follows} - {""}} <= names
        assert not role.moved or hasattr(Pose, role.moved)
        assert not role.placed or hasattr(Placement, role.placed)


def tried(part, rng):
    """Parameters of a part with entries that are zero, equal, of either sign, or as they are, in 60 variants."""
    entries = {entry.name: entry for entry in Parameters([part]).entries}
    names = [name for name, entry in entries.items() if rng.random() < 0.5] or list(entries)[:1]
    values = np.array([np.choose(rng.integers(0, 5, 60), [np.full(60, entries[name].value), np.zeros(60),
                       rng.normal(size=60), -np.full(60, entries[name].value), np.ones(60)]) for name in names])
    return names, values


@pytest.mark.slow
def test_batches_find_every_value_that_a_part_refuses():
    refused = set()
    for seed in range(12):
        rng = np.random.default_rng(seed)
        for part in [part for group in model().groups().values() for part in group.values() if part.name != "ground"]:
            if not any(True for _ in part.parameter_fields()):
                continue
            names, array = tried(part, rng)
            slots = Slots.of(Parameters([part]), names)
            values = Values.of(slots, array)
            found = set(slots.suspects(values.numbers).get(part.name, ()))
            for i in range(values.count):
                try:
                    values.of_variant(part, i)
                except ModelError:
                    refused.add(part.name)
                    assert i in found, (part.name, names, array[:, i])
    assert refused >= {"a", "rod", "spring", "free", "damper", "slow", "maxwell", "bare", "inerter", "torsion", "rotor",
                       "load", "pad"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Band(Connection):
    """A line of a family that is in no table."""

    roles = stated(**ENDS, **LINE)

    start: tuple[float, ...]
    end: tuple[float, ...]


def test_ends_of_a_family_without_checks_go_with_their_bodies():
    described = mv.Model("m")
    described.add_body("b", 1.0, (0.1, 0.1, 0.1), position=(0, 0, -0.5))
    pose = start(described).moved_by(np.array([np.c_[np.zeros((3, 3)), (0, 0, 0.05)], np.zeros((3, 4))]))
    band = Band("band", "ground", "b", (0.0, 0.0, 0.0), (0.0, 0.0, -0.5))
    moved = model_in_pose(described.with_parts(springs={"band": band}), pose, relaxed=True).springs["band"]
    assert moved == Band("band", "ground", "b", (0.0, 0.0, 0.0), (0.0, 0.0, -0.45))
