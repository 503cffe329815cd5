"""Loops that an angle locks: the joint, the angle and the motion are named, and what would free them does."""

import re
import warnings

import numpy as np
import pytest

import mbsvib as mv

POINTS = {"A": (0.0, 0.0, 0.0), "B": (0.2, 0.3, 0.0), "C": (0.9, 0.6, 0.0), "D": (1.0, 0.0, 0.0)}
ENDS = {"A": ("ground", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("rocker", "ground")}


def four_bar(tilted, tilt, kinds=None, about=1, points=None):
    """A four-bar linkage in the x-y plane; one joint is tilted by an angle [rad] about x (0) or y (1)."""
    at = POINTS | (points or {})
    model = mv.Model("four-bar")
    for name, (p, q) in {"crank": "AB", "coupler": "BC", "rocker": "CD"}.items():
        model.add_body(name, 1.0, (1e-3, 1e-2, 1e-2), np.add(at[p], at[q]) / 2)
    for name, ends in ENDS.items():
        angle = tilt if name == tilted else 0.0
        axis = (np.sin(angle), 0.0, np.cos(angle)) if about else (0.0, -np.sin(angle), np.cos(angle))
        kind = (kinds or {}).get(name, "revolute")
        model.add_joint(name, kind, *ends, at[name], **{} if kind == "spherical" else {"axis": axis})
    model.add_bushing("spring", "ground", "crank", at["A"], (0, 0, 0, 0, 0, 10.0))
    model.add_input("F", "crank", (0, 1, 0), at["B"])
    model.add_output("y", "crank", (0, 1, 0), at["B"])
    return model


@pytest.mark.few(8)
@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("joint", "ABCD")
@pytest.mark.parametrize("tilt", [1e-10, 1e-6, 1e-3, 3e-2])
def test_a_tilted_joint_of_a_four_bar_is_named(method, joint, tilt):
    words = (rf"lock the motion of [A-D]\.rz.*: joint '{joint}' by {tilt:.3g} rad \({np.degrees(tilt):.3g} deg\)\. .*"
             rf" 1 more degree of freedom. Correct the axis, .*make joint '(\w)' (\w+)\.")  # fmt: skip
    with pytest.warns(mv.NearSingularWarning, match=words) as caught:
        assert four_bar(joint, tilt, about="ABCD".index(joint) % 2).linearize(method=method).dof == 0
    assert len(caught) == 1
    other, kind = re.search(words, str(caught[0].message)).groups()
    assert four_bar(joint, tilt, {other: kind}, "ABCD".index(joint) % 2).linearize().dof == 1


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_a_tilted_joint_of_a_four_bar_on_a_floating_frame_is_named(method):
    model = four_bar("C", 1e-3)
    floating = mv.Model("floating")
    floating.add_body("frame", 5.0, (1.0, 1.0, 1.0), (0.5, 0.0, 0.0))
    for body in model.bodies.values():
        floating.add_body(body.name, body.mass, body.inertia, body.position)
    for name, ends in ENDS.items():
        bodies = ("frame" if body == "ground" else body for body in ends)
        floating.add_joint(name, "revolute", *bodies, POINTS[name], axis=model.joints[name].axes[2])
    words = r"lock the motion of .*: joint 'C' by 0\.001 rad .* 1 more degree of freedom"
    with pytest.warns(mv.NearSingularWarning, match=words):
        assert floating.linearize(method=method).dof == 6


@pytest.mark.parametrize("tilt", [1e-6, 3e-2])
def test_a_tilted_slider_of_a_slider_crank_is_named(tilt):
    model = mv.Model("slider-crank")
    model.add_body("crank", 1.0, (0.1, 0.1, 0.1), (0.1, 0.1, 0.0))
    model.add_body("rod", 1.0, (0.1, 0.1, 0.1), (0.5, 0.1, 0.0))
    model.add_body("piston", 1.0, (0.1, 0.1, 0.1), (0.8, 0.0, 0.0))
    for name, ends, at in (("A", ("ground", "crank"), (0, 0, 0)), ("B", ("crank", "rod"), (0.2, 0.2, 0)),
                           ("C", ("rod", "piston"), (0.8, 0, 0))):  # fmt: skip
        model.add_joint(name, "revolute", *ends, at, axis=(0, 0, 1))
    model.add_joint("slide", "prismatic", "ground", "piston", axis=(np.cos(tilt), 0.0, np.sin(tilt)))
    with pytest.warns(mv.NearSingularWarning, match=rf"joint 'slide' by {tilt:.3g} rad"):
        assert model.linearize().dof == 0


@pytest.mark.parametrize("tilt", [1e-8, 1e-2])
def test_two_rails_that_are_not_parallel_are_named(tilt):
    model = mv.Model("rails")
    model.add_body("carriage", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("left", "prismatic", "ground", "carriage", axis=(1, 0, 0))
    model.add_joint("right", "prismatic", "ground", "carriage", (0, 1, 0), axis=(np.cos(tilt), np.sin(tilt), 0))
    with pytest.warns(mv.NearSingularWarning, match=rf"lock the motion of left\.z: joint 'right' by {tilt:.3g} rad"):
        assert model.linearize().dof == 0


def test_hinges_of_a_door_side_by_side_are_warned_of():
    model = mv.Model("door")
    model.add_body("door", 1.0, (0.1, 0.1, 0.1), (0.5, 0.0, 0.5))
    model.add_joint("low", "revolute", "ground", "door", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("high", "revolute", "ground", "door", (1e-3, 0, 1), axis=(0, 0, 1))
    words = r"closed by high lock 1 motion by .*'low' by 0\.0005 m.*\(align=0\.001\)"
    with pytest.warns(mv.NearSingularWarning, match=words):
        assert model.linearize().dof == 0


@pytest.mark.parametrize("lift", [1e-3, 3e-2])
def test_a_flat_four_bar_whose_axes_are_in_line_is_not_warned_of(lift):
    """Its pivots are small as it is nearly stretched; its axes have nothing to do with it."""
    model = four_bar("A", 0.0, points={"B": (0.3, lift, 0.0), "C": (0.7, -lift, 0.0)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert model.linearize().dof == 1


def test_a_body_held_by_a_fixed_joint_is_in_the_loop():
    """Without the fixed joint the loops had six more degrees of freedom, all of which an axis seemed to lock."""
    model = four_bar("C", 1e-3)
    split = mv.Model("split")
    for name, body in model.bodies.items():
        split.add_body(name, body.mass, body.inertia, body.position)
    split.add_body("end", 0.1, (1e-3, 1e-3, 1e-3), (0.85, 0.6, 0.0))
    split.add_joint("weld", "fixed", "coupler", "end", (0.85, 0.6, 0.0))
    for name, joint in model.joints.items():
        ends = ["end" if name == "C" and body == "coupler" else body for body in ENDS[name]]
        axis = (np.sin(1e-3), 0, np.cos(1e-3)) if name == "C" else (0, 0, 1)
        split.add_joint(name, "revolute", *ends, joint.position, axis=axis)
    with pytest.warns(mv.NearSingularWarning, match=r"joint 'C' by 0\.001 rad .* 1 more degree of freedom"):
        assert split.linearize(cut=["C"]).dof == 0
