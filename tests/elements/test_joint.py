"""Joints: free and locked directions of every kind, and the ways of giving axes."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.elements.joint_kinds import KINDS
from tests.support.random_models import rotation

FREEDOM = {
    "revolute": ["rz"], "prismatic": ["z"], "cylindrical": ["z", "rz"], "screw": ["rz"], "universal": ["rx", "ry"],
    "homokinetic": ["rx", "ry"],
    "spherical": ["rx", "ry", "rz"], "planar": ["x", "y", "rz"], "fixed": [],
    "free": ["x", "y", "z", "rx", "ry", "rz"], "point_on_line": ["z", "rx", "ry", "rz"],
    "point_on_plane": ["x", "y", "rx", "ry", "rz"], "distance": ["x", "y", "rx", "ry", "rz"],
}  # fmt: skip
TURNED = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
ALL = ("x", "y", "z", "rx", "ry", "rz")


def make(kind="revolute", **words):
    model = mv.Model()
    model.add_body("a", 1.0, (1, 1, 1))
    model.add_body("b", 1.0, (1, 1, 1))
    arguments = {"name": "j", "first": "a", "second": "b", "position": (0, 0, 0)} | words
    if kind == "screw":
        arguments.setdefault("pitch", 0.01)
    if kind == "distance":
        arguments.setdefault("end", (0.3, 0.2, 0.6))
    return model.add_joint(kind=kind, **arguments)


def vectors(named):
    return np.array([six for _, six in named]).reshape(-1, 6)


@pytest.mark.parametrize("kind", FREEDOM)
def test_every_kind_frees_what_its_name_says(kind):
    joint = make(kind)
    assert [name for name, _ in joint.freedom] == FREEDOM[kind]
    assert len(joint.freedom) + len(joint.locked) == 6


def test_no_kind_is_left_out():
    assert set(KINDS) == set(FREEDOM)


@given(st.sampled_from(sorted(FREEDOM)), st.integers(0, 2**31))
def test_locked_rows_do_no_work_on_free_motion(kind, seed):
    turn = rotation(np.random.default_rng(seed))
    joint = make(kind, **({"end": turn[:, 0]} if kind == "distance" else {"orientation": turn}))
    free, locked = vectors(joint.freedom), vectors(joint.locked)
    assert_allclose(locked @ free.T, 0, atol=1e-15)
    assert np.linalg.matrix_rank(np.vstack([free, locked])) == 6


@given(st.integers(0, 2**31), st.floats(-3, 3))
def test_the_axis_is_local_z(seed, size):
    axis = 10.0**size * np.random.default_rng(seed).normal(size=3)
    unit = axis / np.linalg.norm(axis)
    for kind in ("revolute", "prismatic", "cylindrical", "planar"):
        joint = make(kind, axis=axis)
        axes = np.array(joint.axes)
        assert_allclose(axes[:, 2], unit, atol=3e-16)
        assert_allclose(axes.T @ axes, np.eye(3), atol=2e-15)
        assert np.linalg.det(axes) > 0
    assert_allclose(vectors(make("revolute", axis=axis).freedom), [[0, 0, 0, *unit]], atol=3e-16)
    assert_allclose(vectors(make("prismatic", axis=axis).freedom), [[*unit, 0, 0, 0]], atol=3e-16)


@given(st.integers(0, 2**31), st.floats(-3, 3))
def test_a_distance_joint_has_its_rod_along_z(seed, size):
    start, line = np.random.default_rng(seed).normal(size=(2, 3))
    joint = make("distance", position=start, end=start + 10.0**size * line)
    gap = np.subtract(joint.end, joint.position)
    assert_allclose(np.array(joint.axes)[:, 2], gap / np.linalg.norm(gap), atol=3e-16)
    assert_allclose(vectors(joint.locked), [[*np.array(joint.axes)[:, 2], 0, 0, 0]], atol=0)
    assert joint.point == joint.end


@pytest.mark.parametrize(("words", "message"), [
    ({"end": None}, r"joint 'j': end = None; expected the rod's point \(x, y, z\) on the second body"),
    ({"end": (0, 0, 0)}, r"end = \(0\.0, 0\.0, 0\.0\); expected a point other than position .*spherical"),
    ({"end": (0, 0)}, r"end = \(0, 0\); expected the rod's point"),
    ({"end": (1, 0, np.nan)}, "NaN"),
    ({"end": (1.7e308, 1.7e308, 1.7e308)}, "a point other than position"),
    ({"axis": (0, 0, 1)}, r"axis is given, but the axis of a distance joint is the line .* leave it out"),
    ({"orientation": np.eye(3)}, "orientation is given, but the axis of a distance joint"),
    ({"axis2": (0, 0, 1)}, "axis2 is for universal joints; a distance joint has none"),
    ({"pitch": 0.1}, "pitch is for screw joints"),
    ({"kind": "point_on_line", "end": (1, 0, 0)}, r"end is for distance joints; a point_on_line joint has none"),
    ({"kind": "point_on_plain"}, "Did you mean 'point_on_plane'"),
    ({"kind": "point_on_line", "axis": (0, 0, 0)}, r"axis = \(0\.0, 0\.0, 0\.0\); expected a direction"),
    ({"kind": "point_on_plane", "position": None}, "position = None; expected the joint's point"),
])  # fmt: skip
def test_wrong_points_and_rods_are_named(words, message):
    with pytest.raises(mv.ModelError, match=message):
        make(**({"kind": "distance"} | words))


@pytest.mark.parametrize("pitch", [0.01, -0.3, 0.0, 25.0])
def test_a_screw_advances_by_its_pitch(pitch):
    joint = make("screw", axis=(0, 2, 0), pitch=pitch)
    assert_allclose(vectors(joint.freedom), [[0, pitch, 0, 0, 1, 0]], atol=1e-16)
    moved = vectors(joint.locked) @ [0, pitch, 0, 0, 1, 0]
    assert_allclose(moved, 0, atol=1e-15)
    assert np.linalg.matrix_rank(vectors(joint.locked)) == 5


@given(st.integers(0, 2**31), st.floats(0.02, np.pi - 0.02))
def test_universal_axes_need_not_be_perpendicular(seed, angle):
    turn = rotation(np.random.default_rng(seed))
    axis, axis2 = turn[:, 0], turn @ [np.cos(angle), np.sin(angle), 0]
    joint = make("universal", axis=3 * axis, axis2=axis2)
    assert_allclose(vectors(joint.freedom), [[0, 0, 0, *axis], [0, 0, 0, *axis2]], atol=1e-15)
    normal = dict(joint.locked)["rz"]
    assert_allclose(normal, [0, 0, 0, *turn[:, 2]], atol=1e-15 / np.sin(angle))


def test_universal_without_axes_turns_about_x_and_y():
    turn = rotation(np.random.default_rng(3))
    joint = make("universal", orientation=turn)
    assert_allclose(vectors(joint.freedom), [[0, 0, 0, *turn[:, 0]], [0, 0, 0, *turn[:, 1]]], atol=1e-16)


@given(st.permutations(ALL), st.integers(0, 6))
def test_any_other_joint_by_its_free_directions(order, count):
    named = order[:count]
    turns = [d for d in named if d in ALL[3:]]
    expected = [d for d in ALL[:3] if d in named] + (turns if len(turns) == 2 else sorted(turns))
    for free in (list(named), tuple(named), set(named)):
        joint = make(None, free=free)
        freed = sorted(named, key=ALL.index) if isinstance(free, set) else expected
        assert [name for name, _ in joint.freedom] == freed
        assert [name for name, _ in joint.locked] == [d for d in ALL if d not in named]
        assert joint.kind == "custom"


def test_one_free_direction_may_be_a_word():
    assert make(None, free="rz").free == ("rz",)
    assert make("free", free=["x"]).kind == "custom"


@pytest.mark.parametrize("kind", ["prismatic", "fixed"])
def test_no_point_is_needed_where_nothing_turns(kind):
    assert make(kind, position=None).position is None


@pytest.mark.parametrize("kind", sorted(set(FREEDOM) - {"prismatic", "fixed"}))
def test_a_point_is_needed_where_something_turns(kind):
    with pytest.raises(mv.ModelError, match="position = None"):
        make(kind, position=None)


def test_bodies_by_name_or_by_object():
    model = mv.Model()
    a = model.add_body("a", 1.0, (1, 1, 1))
    joint = model.add_joint("j", "fixed", "ground", a)
    assert (joint.first, joint.second) == ("ground", "a")


@pytest.mark.parametrize("words", [
    {"kind": "revolute", "position": (1.0, 2.0, 3.0), "axis": (0.0, 3.0, 4.0)},
    {"kind": "screw", "position": (1.0, 2.0, 3.0), "pitch": 0.01},
    {"kind": "universal", "position": (0.0, 0.0, 0.0), "axis": (1.0, 0.0, 0.0), "axis2": (1.0, 2.0, 0.0)},
    {"kind": "fixed"},
    {"kind": "planar", "position": (0.0, 0.0, 0.0), "orientation": TURNED},
    {"kind": "custom", "position": (0.0, 0.0, 0.0), "free": ("x", "rz")},
    {"kind": "custom", "position": (0.0, 0.0, 0.0), "free": ("z", "ry", "rx")},
    {"kind": "homokinetic", "position": (0.0, 0.0, 0.0), "axis": (1.0, 1.0, 0.0)},
    {"kind": "distance", "position": (0.0, 0.0, 0.0), "end": (1.0, 0.0, 2.0)},
    {"kind": "point_on_line", "position": (0.0, 1.0, 0.0), "axis": (1.0, 1.0, 0.0)},
])  # fmt: skip
def test_words_give_the_call_back(words):
    words = {"name": "j", "first": "a", "second": "b"} | words
    model = mv.Model()
    model.add_body("a", 1.0, (1, 1, 1))
    model.add_body("b", 1.0, (1, 1, 1))
    joint = model.add_joint(**words)
    assert joint.constructor_kwargs() == words


@pytest.mark.parametrize("form", [tuple, list, np.array])
def test_lists_tuples_and_arrays(form):
    joint = make("screw", position=form([1, 2, 3]), axis=form([0, 0, 2]), pitch=np.float64(0.5))
    assert joint.position == (1.0, 2.0, 3.0)
    assert joint.pitch == 0.5
    assert joint == make("screw", position=[1, 2, 3], axis=[0, 0, 2], pitch=0.5)


def test_joints_are_immutable():
    with pytest.raises(FrozenInstanceError):
        make().kind = "fixed"


@pytest.mark.parametrize(("word", "kind"), [("hinge", "revolute"), ("Slider", "prismatic"), ("ball", "spherical"),
                                            ("weld", "fixed"), ("revolut", "revolute")])  # fmt: skip
def test_names_of_other_programs_lead_to_the_kind(word, kind):
    model = mv.Model("m")
    model.add_body("b", 1.0, (1.0, 1.0, 1.0))
    with pytest.raises(mv.ModelError, match=f"joint 'j': kind = '{word}'.*Did you mean '{kind}'"):
        model.add_joint("j", word, "ground", "b")
