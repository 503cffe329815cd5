"""Batches in which loops have another mobility in some variant: refused by its number."""

import itertools

import numpy as np
import pytest

import mbsvib as mv
from tests.equations.test_batch import check


def ring(angles, axes):
    """Revolute joints on a unit circle, one body between each two."""
    model = mv.Model("ring")
    positions = [(np.cos(a), np.sin(a), 0.0) for a in angles]
    for i, (here, there) in enumerate(itertools.pairwise(positions)):
        model.add_body(f"b{i}", 1.0, (0.1, 0.1, 0.1), 0.5 * np.add(here, there))
    chain = ["ground", *model.bodies, "ground"]
    for i, (position, axis) in enumerate(zip(positions, axes, strict=True)):
        model.add_joint(f"j{i}", "revolute", chain[i], chain[i + 1], position, axis=axis)
    model.add_bushing("k", "ground", "b0", positions[0], (0, 0, 0, 5.0, 5.0, 5.0))
    return model


def test_a_variant_that_moves_in_this_pose_only():
    """Four lines of one regulus of a hyperboloid: dependent as four parallel ones are, but in no pose nearby."""
    angles = np.array([0.1, 1.3, 2.9, 4.6])
    model = ring(angles, [(0, 0, 1)] * 4)
    turns = {f"j{i}.orientation.{end}": [0.0, -np.pi / 4 * value] for i, a in enumerate(angles)
             for end, value in (("rx", np.cos(a)), ("ry", np.sin(a)))}  # fmt: skip
    message = r"variant 1: .*singular pose\. 2 of their 5 .* 3 in neighbouring poses"
    with pytest.raises(mv.SingularPoseError, match=message):
        model.linearize(values=turns)


def test_a_variant_with_more_freedom():
    """A ring of seven hinges about any axes moves in one way, about parallel ones in four."""
    rng = np.random.default_rng(5)
    axes = rng.normal(size=(7, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    model = ring(2 * np.pi * np.arange(7) / 7, axes)
    upright = np.cross(axes, (0, 0, 1))
    upright *= (np.arccos(axes[:, 2]) / np.linalg.norm(upright, axis=1))[:, None]
    turns = {f"j{i}.orientation.{end}": [0.0, 0.05, w] for i, row in enumerate(upright)
             for end, w in zip(("rx", "ry", "rz"), row, strict=True)}  # fmt: skip
    expected = r"variant 2: its loops leave 4 degrees of freedom, .* nominal pose 1\."
    with pytest.raises(mv.SingularPoseError, match=expected):
        model.linearize(values=turns)
    check(model, {name: np.array(value[:2]) for name, value in turns.items()}, 2)
