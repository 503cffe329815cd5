"""Models written as URDF and read again: the same equations; what has no place is refused by name."""

from xml.etree import ElementTree

import numpy as np
import pytest

import mbsvib as mv
from tests.urdf.scenes import CASSIE, CASSIE_YAML, CONSTRAINT, DELTA, FIVE_BAR, FOUR_BAR, LOOP, write
from tests.urdf.test_robot import ARM


def same(first, second, independent=None):
    a, b = (model.linearize(independent=independent) for model in (first, second))
    assert (a.coordinates, a.inputs, a.outputs) == (b.coordinates, b.inputs, b.outputs)
    for name in ("M", "C", "K", "B", "Cq"):
        one, other = getattr(a, name), getattr(b, name)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-12 * max(np.abs(one).max(initial=0.0), 1e-3))


POSES = {"arm": {"pan": 0.4, "lift": 0.6, "elbow": 1.2, "wrist_2": -0.7}, "four": {"a": 0.2},
         "five": {"left_hip": -1.9, "right_hip": -1.2}}  # fmt: skip


@pytest.mark.parametrize(("name", "words"), [
    ("arm", None), ("four", FOUR_BAR + CONSTRAINT.format("revolute")), ("four", FOUR_BAR + LOOP),
    ("four", FOUR_BAR + CONSTRAINT.format("spherical")), ("five", FIVE_BAR),
])  # fmt: skip
@pytest.mark.filterwarnings("error")
def test_the_same_matrices_after_reading(tmp_path, name, words):
    path = ARM if words is None else write(tmp_path, words)
    model = mv.load_urdf(path, pose=POSES[name])
    again = mv.load_urdf(mv.save_urdf(model, tmp_path / "again.urdf"), name=model.name)
    same(model, again)
    for body, part in model.bodies.items():
        np.testing.assert_allclose(again.bodies[body].position, part.position, atol=1e-14)
        np.testing.assert_allclose(again.bodies[body].orientation, part.orientation, atol=1e-14)
        np.testing.assert_allclose(again.bodies[body].inertia, part.inertia, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("joint", ["universal", "floating"])
def test_loops_with_other_joints(tmp_path, joint):
    if joint == "floating":
        model = mv.load_urdf(write(tmp_path, DELTA), pose={"motor0": 0.3, "motor1": 0.25, "motor2": 0.2})
        independent = [f"motor{i}.rz" for i in range(3)]
    else:
        path = write(tmp_path, CASSIE, CASSIE_YAML)
        model = mv.load_urdf(path, pose={"hip": 0.3, "motor": -0.1}, loops=tmp_path / "loops.yaml")
        independent = ["hip.rz", "motor.rz", "ankle.rz"]
    again = mv.load_urdf(mv.save_urdf(model, tmp_path / "again.urdf"), name=model.name)
    same(model, again, independent)


def test_bodies_that_float_and_joints_from_outside(tmp_path):
    """A joint named from its outer body, a body that hangs on a ball joint alone, one on nothing, turned frames."""
    model = mv.Model("odd")
    turn = (0.3, -0.2, 0.5)
    model.add_body("a", 2.0, (0.1, 0.2, 0.25, 0.01, 0.02, 0.03), (0.2, 0.1, 0.3), turn)
    model.add_body("b", 1.0, (0.1, 0.1, 0.1), (0.5, 0.1, 0.3), (0.0, np.pi / 2, 0.2))
    model.add_body("world", 3.0, (0.3, 0.3, 0.4), (1.0, 1.0, 1.0))
    model.add_joint("hinge", "revolute", "a", "ground", (0, 0.1, 0.2), axis=(1, 2, 2))
    model.add_joint("ball", "spherical", "a", "b", (0.4, 0.1, 0.3))
    model.add_bushing("damper", "a", "ground", (0, 0, 0), damping=(0, 0, 0, 0, 0, 0.7),
                      orientation=model.joints["hinge"].axes)  # fmt: skip
    again = mv.load_urdf(mv.save_urdf(model, tmp_path / "odd.urdf"))
    a, b = model.linearize(), again.linearize()
    assert a.dof == b.dof == 1 + 3 + 6
    turned = [np.array(system.displacements(np.eye(system.dof)[list(system.coordinates).index("hinge.rz")])["a"])
              for system in (a, b)]  # fmt: skip
    np.testing.assert_allclose(turned[0], turned[1], atol=1e-13)
    assert again.springs["hinge.k"].damping[5] == 0.7
    rates = [np.sort(np.linalg.eigvals(np.linalg.solve(system.M, system.C)).real) for system in (a, b)]
    assert rates[0][-1] > 0.1
    np.testing.assert_allclose(rates[1], rates[0], atol=1e-13)  # whatever the coordinates are
    assert again.joints["ball"].kind == "spherical"


def test_couplers_become_mimics(tmp_path):
    model = mv.Model("gears")
    for name, mass in (("p", 1.0), ("q", 2.0), ("r", 4.0)):
        model.add_body(name, mass, (mass, mass, mass))
        model.add_joint(f"j{name}", "revolute", "ground", name, (0, 0, 0), axis=(0, 0, 1))
    model.add_coupler("one", {"jp": 1.0, "jq": -2.0})
    model.add_coupler("two", {"jq": 1.0, "jr": 3.0})
    again = mv.load_urdf(mv.save_urdf(model, tmp_path / "gears.urdf"))
    systems = [part.linearize(independent=["jr.rz"]) for part in (model, again)]
    np.testing.assert_allclose(systems[0].M, [[4.0 + 2.0 * 9 + 36.0]], rtol=1e-14)
    np.testing.assert_allclose(systems[1].M, systems[0].M, rtol=1e-14)
    turns = [[system.displacements([1.0])[name][5] for name in "pqr"] for system in systems]
    np.testing.assert_allclose(turns, [(-6.0, -3.0, 1.0)] * 2, rtol=1e-14)


def test_what_has_no_place_is_refused_by_name(tmp_path):
    model = mv.load_urdf(write(tmp_path, FIVE_BAR), pose=POSES["five"], stiffness=10.0, tip="left2",
                         gravity=(0, 0, -9.81))  # fmt: skip
    model.add_load("weight", "left2", (0, 0, -1.0))
    model.add_body("rail", 1.0, (1.0, 1.0, 1.0))
    model.add_joint("screw", "screw", "ground", "rail", (0, 0, 0), pitch=0.01)
    told = r"no place for joint 'screw' \(screw\), bushing 'left_hip\.k', .*load 'weight'"
    with pytest.raises(mv.ModelError, match=told):
        mv.save_urdf(model, tmp_path / "no.urdf")
    assert not (tmp_path / "no.urdf").exists()
    kept = model.with_parts(joints={name: part for name, part in model.joints.items() if name != "screw"})
    with pytest.warns(mv.LeftOutWarning, match=r"no place for gravity, 'left2\.Fx'"):
        path = mv.save_urdf(kept, tmp_path / "yes.urdf", leave=["*.k", "weight"])
    assert mv.load_urdf(path).linearize().dof == 2 + 6
    with pytest.raises(mv.ModelError, match="expected a Model"):
        mv.save_urdf("kept", tmp_path / "no.urdf")


def test_only_slides_have_limits(tmp_path):
    """Other readers require limits of prismatic joints; of hinges that turn for ever there are none."""
    model = mv.Model("two")
    for name, kind in (("slide", "prismatic"), ("hinge", "revolute")):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1))
        model.add_joint(f"{name}.j", kind, "ground", name, (0, 0, 0), axis=(0, 0, 1))
    top = ElementTree.parse(mv.save_urdf(model, tmp_path / "two.urdf")).getroot()
    limits = {joint.get("name"): joint.find("limit") for joint in top.findall("joint")}
    assert limits["hinge.j"] is None
    assert float(limits["slide.j"].get("lower")) < -1e3 < 1e3 < float(limits["slide.j"].get("upper"))
