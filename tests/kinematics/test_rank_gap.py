"""Ranks in doubt are refused or warned of: of constraints, masses, forces; as a model, sparse, and as a variant."""

import warnings

import numpy as np
import pytest

import mbsvib as mv

DOUBT = (r"loops closed by high: constraint pivots 4.0e-13 \(kept\) and 3.0e-14 \(dropped\) are too close to tell how "
         r"many constraints are independent. Move the pose away from the singular one, or give the geometry")
NEAR = {"batch": r"loops closed by high: nearly singular pose \(smallest pivot 1.0e-05\);.*[Mm]ove the pose, or give"}
ANGLE = r"axes out of line in .* closed by high lock .* low\.z: joint 'high' by 1e-05 rad \(0\.000573 deg\)\. With"


def guides(tilt, beside):
    """A slide on two guides in line; where they are tilted it cannot slide, where they are side by side not turn."""
    model = mv.Model("guides")
    model.add_body("slide", 1.0, (0.1, 0.1, 0.1), (0.3, 0, 0.5))
    model.add_joint("low", "cylindrical", "ground", "slide", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("high", "cylindrical", "ground", "slide", (beside, 0, 1), axis=(np.tan(tilt), 0, 1))
    model.add_bushing("k", "ground", "slide", (0, 0, 0), (10, 10, 10, 1, 1, 1))
    return model


def variants(tilt, beside):
    """Of a slide that is held: the second of two is another one."""
    values = {"high.position.x": [0.5, beside], "high.orientation.ry": [0.0, tilt - 0.3]}
    return guides(0.3, 0.5).linearize(values=values, cut=["high"])


WAYS = {
    "dense": lambda tilt, beside: guides(tilt, beside).linearize(cut=["high"]),
    "sparse": lambda tilt, beside: guides(tilt, beside).linearize(cut=["high"], method="sparse"),
    "batch": variants,
}
BEGINS = {"dense": "^", "sparse": "^", "batch": "^variant 1: "}


@pytest.mark.parametrize("way", WAYS)
def test_a_rank_that_is_in_doubt_is_refused(way):
    with pytest.raises(mv.SingularPoseError, match=BEGINS[way] + DOUBT):
        WAYS[way](3e-14, 4e-13)


@pytest.mark.parametrize("way", WAYS)
def test_a_nearly_singular_pose_is_warned_of(way):
    with pytest.warns(mv.NearSingularWarning, match=BEGINS[way] + NEAR.get(way, ANGLE)):
        result = WAYS[way](1e-5, 2e-5)
    assert result.dof == 0


@pytest.mark.parametrize("way", ["dense", "sparse"])
@pytest.mark.parametrize(("tilt", "beside", "dof"), [(0, 0, 2), (3e-14, 0, 2), (3e-14, 1e-2, 1), (0.3, 0.3, 0)])
def test_a_rank_beyond_doubt(way, tilt, beside, dof):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert WAYS[way](tilt, beside).dof == dof


def test_a_rank_that_is_in_doubt_in_a_large_group(monkeypatch):
    """Three rods that are all but parallel."""
    monkeypatch.setattr("mbsvib.sparse.constraints.MOST_DENSE_ENTRIES", 0)
    model = mv.Model("rods")
    model.add_body("ball", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("air", "free", "ground", "ball", (0, 0, 0))
    for name, end in (("r1", (1, 0, 0)), ("r2", (1, 1e-9, 0)), ("r3", (1, 0, 5e-11))):
        model.add_joint(name, "distance", "ground", "ball", (0, 0, 0), end=end)
    with pytest.raises(mv.SingularPoseError, match=r"loops closed by r1, r2.* r3: constraint pivots .* too close to"):
        model.linearize(cut=["r1", "r2", "r3"], method="sparse")


@pytest.mark.parametrize(("tilts", "message"), [
    ((1e-12, 1e-14), r"coordinate 'p1\.z': it is in doubt whether this motion moves mass .* Make tiny masses zero, or"),
    ((1e-11, 1e-11), r"coordinate 'q0\.z': the mass matrix is singular, .* make what is tiny exactly zero")])
def test_masses_that_may_be_rounding(tilts, message):
    """Two slides in line on each other move one mass along one line only, but for their tilts."""
    model = mv.Model("slides")
    for k, tilt in enumerate(tilts):
        for name in "mb":
            model.add_body(f"{name}{k}", float(name == "b"), (0, 0, 0), (k, 0, 0))
        model.add_joint(f"p{k}", "prismatic", "ground", f"m{k}", axis=(0, 0, 1))
        model.add_joint(f"q{k}", "prismatic", f"m{k}", f"b{k}", axis=(tilt, 0, 1))
        model.add_bushing(f"k{k}", "ground", f"m{k}", (k, 0, 0), (0, 0, 5, 0, 0, 0))
        model.add_bushing(f"l{k}", f"m{k}", f"b{k}", (k, 0, 0), (5, 5, 5, 0, 0, 0))
    with pytest.raises(mv.MbsvibError, match=message):
        model.linearize()


@pytest.mark.parametrize("load", [None, (1.0, 2.0, 3.0)])
def test_forces_in_guides_that_nearly_depend_on_each_other(load, monkeypatch):
    """In a large group of loops; the dense path tells them."""
    monkeypatch.setattr("mbsvib.sparse.self_stress.MOST_DENSE_ENTRIES", 0)
    model = guides(1e-9, 0.5)
    model.add_input("F", "slide", "x")
    model.add_force_output("low.x", "low", "x")
    model.add_force_output("high.x", "high", "x")
    if load:
        model.add_load("weight", "slide", force=load)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(mv.ModelError, match=r"forces in the joints low, high are not determined .*method='dense'"):
            model.linearize(cut=["high"], method="sparse").frequency_response([2.0])
        assert np.isfinite(model.linearize(cut=["high"], method="dense").frequency_response([2.0])).all()
