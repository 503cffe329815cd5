"""What a file has that no model has a place for, and faulty arguments: refused by name."""

import sys
import warnings

import pytest

import mbsvib as mv
from tests.mjcf.scenes import GANTRY, PENDULUM, ROD, body, world, write

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'mbsvib[mjcf]'")


def actuator(words):
    return f"{PENDULUM}<actuator>{words}</actuator>"


def sites(words):
    rod = PENDULUM.replace(ROD, ROD + '<site name="e" pos=".3 0 -.4"/><site name="f"/>').replace(
        "<worldbody>", '<worldbody><site name="o" pos="1 0 0"/>')
    return rod + words


@pytest.mark.parametrize(("words", "message"), [
    (actuator('<muscle name="m" joint="hinge" lengthrange="0 1"/>'), "actuator 'm': gain of kind muscle.*leave="),
    (actuator('<general name="m" joint="hinge" forcerange="-1 1" biastype="affine" biasprm="5 0 0"/>'),
     "actuator 'm': its force in this pose is 1 in MuJoCo and 5 by its gains"),
    (sites('<actuator><position name="m" site="e" refsite="o"/></actuator>'), "a site against another one"),
    (sites('<actuator><general name="m" site="e" biastype="affine" biasprm="1 0 0"/></actuator>'),
     "not by a motor alone"),
    (sites('<actuator><general name="m" cranksite="e" slidersite="o" cranklength="1"/></actuator>'), "slidercrank"),
    (sites('<tendon><spatial name="t" stiffness="1"><site site="e"/><site site="f"/><site site="o"/></spatial>'
           '</tendon>'),
     "tendon 't': goes by more than two sites"),
    (sites('<tendon><spatial name="t"><site site="e"/><site site="f"/><site site="o"/></spatial></tendon><actuator>'
           '<motor name="m" tendon="t"/></actuator>'), "actuator 'm': its tendon 't' goes by more"),
    (sites('<tendon><spatial name="t" armature="1"><site site="e"/><site site="o"/></spatial></tendon>'),
     "armature on a line"),
    (sites('<equality><connect name="c" site1="e" site2="o"/></equality>'), "equality 'c': gapes by 0.7"),
    (world(body('<joint name="a"/>' + ROD, "a"), body('<joint name="b"/>' + ROD),
           more='<equality><joint name="c" joint1="a" joint2="b" polycoef="0 0 2 0 0"/></equality>'),
     "equality 'c': its polynomial has the slope 0 in this pose, where it locks its first joint"),
    (world(body('<joint name="a"/>' + ROD, "a"), body('<joint name="b"/>' + ROD),
           more='<tendon><fixed name="s"><joint joint="a" coef="1"/></fixed><fixed name="t"><joint joint="b" '
                'coef="1"/></fixed></tendon><equality><tendon name="c" tendon1="s" tendon2="t" polycoef="0 0 2 0 0"/>'
                '</equality>'),
     "equality 'c': its polynomial has the slope 0 in this pose, where it locks its first tendon"),
    (PENDULUM.replace("axis", 'actuatorfrcrange="-1 1" axis') + '<actuator><general joint="hinge" biastype="affine" '
     'biasprm="5 0 0"/></actuator>', "joint 'hinge': MuJoCo has 1 N or N m .* makes 5"),
    (sites('<tendon><spatial name="t" stiffness="1" springlength="0 .4"><site site="f"/><site site="g"/></spatial>'
           '</tendon>').replace("<worldbody>", '<worldbody><site name="g" pos="0 .4 0"/>'),
     "tendon 't': its length 0.4 is where it goes slack"),
    (sites('<tendon><spatial name="t"><site site="e"/><site site="o"/></spatial></tendon><equality><tendon name="c" '
           'tendon1="t"/></equality>'), "equality 'c': its tendon 't' is not a fixed one"),
    ("<worldbody><body><joint/></body></worldbody>", "MuJoCo refuses it"),
    ("<worldbodi/>", "MuJoCo refuses it"),
])  # fmt: skip
def test_what_has_no_place_is_refused(tmp_path, words, message):
    with pytest.raises(mv.ModelError, match=message):
        mv.load_mjcf(write(tmp_path, words))


def test_plugins_are_refused(tmp_path):
    """One of those that come with MuJoCo."""
    head = '<extension><plugin plugin="mujoco.pid"><instance name="p"><config key="kp" value="1"/></instance></plugin>'
    plugin = '<plugin name="m" joint="hinge" plugin="mujoco.pid" instance="p" actdim="0"/>'
    with pytest.raises(mv.ModelError, match="actuator 'm': is computed by a plugin"):
        mv.load_mjcf(write(tmp_path, f"{head}</extension>{actuator(plugin)}"))


@pytest.mark.parametrize(("attribute", "message"), [
    ('stiffness="1 2 3"', "joint 'hinge': stiffness of more than one"), ('springyield="20"', "yields for good")])
def test_springs_that_are_not_linear_are_refused(tmp_path, attribute, message):
    import mujoco

    if not hasattr(mujoco.MjModel, "jnt_stiffnesspoly" if "2" in attribute[:14] else "jnt_springyield"):
        pytest.skip("this MuJoCo has no such springs")
    with pytest.raises(mv.ModelError, match=message):
        mv.load_mjcf(write(tmp_path, PENDULUM.replace("axis", f"{attribute} axis")))


def test_flexible_bodies_are_refused_and_warnings_of_mujoco_heard(tmp_path, monkeypatch):
    import mujoco

    monkeypatch.chdir(tmp_path)
    cloth = '<flexcomp name="x" type="grid" count="3 3 1" spacing=".1 .1 .1" dim="2" radius=".01"/>'
    path = write(tmp_path, world(cloth))
    with warnings.catch_warnings(record=True) as stated:
        warnings.simplefilter("always")
        with pytest.raises(mv.ModelError, match="<flex>: deformable bodies"):
            mv.load_mjcf(path)
    assert all("MuJoCo warns: flex 'x'" in str(item.message) for item in stated)
    assert stated or int(mujoco.__version__.partition(".")[0]) < 4  # older ones do not warn
    assert [item.name for item in tmp_path.iterdir()] == ["scene.xml"]


def test_locks_of_joints_with_soft_bearings_are_refused(tmp_path):
    path = write(tmp_path, PENDULUM + '<equality><joint name="lock" joint1="hinge"/></equality>')
    assert mv.load_mjcf(path, stiffness=5.0).linearize().dof == 0
    with pytest.raises(mv.ModelError, match="equality 'lock': locks 'hinge', whose bearings give way"):
        mv.load_mjcf(path, stiffness=(1.0,) * 6)


def test_faulty_arguments_are_told(tmp_path, monkeypatch):
    path = write(tmp_path, GANTRY)
    for words, message in (({"pose": {"swin": 1.0}}, "Did you mean 'swing'"), ({"pose": {"swing": (1, 2)}}, "a number"),
                        ({"stiffness": {"swin": 1.0}}, "no hinge"), ({"damping": (1, 2)}, "one number, or six"),
                        ({"sites": ["tip"]}, "'tip' is not a site"), ({"gravity": 3.0}, "gravity")):  # fmt: skip
        with pytest.raises(mv.ModelError, match=message):
            mv.load_mjcf(path, **words)
    ball = write(tmp_path, world(body('<joint name="ball" type="ball"/>' + ROD), '<site name="o"/>'))
    with pytest.raises(mv.ModelError, match=r"a quaternion \(w, x, y, z\)"):
        mv.load_mjcf(ball, pose={"ball": 1.0})
    with pytest.raises(mv.ModelError, match="This quaternion is zero"):
        mv.load_mjcf(ball, pose={"ball": (0, 0, 0, 0)})
    with pytest.raises(mv.ModelError, match="'ball' is a ball or free joint"):
        mv.load_mjcf(ball, stiffness={"ball": 1.0})
    with pytest.raises(mv.ModelError, match="fixed to the ground"):
        mv.load_mjcf(ball, sites=["o"])
    with pytest.raises(mv.ModelError, match="cannot be read"):
        mv.load_mjcf(tmp_path / "none.xml")
    (tmp_path / "robot.xml").write_text('<robot name="r"/>')
    with pytest.raises(mv.ModelError, match="a URDF; read it by load_urdf"):
        mv.load_mjcf(tmp_path / "robot.xml")
    (tmp_path / "other.xml").write_text("<sdf/>")
    with pytest.raises(mv.ModelError, match="expected <mujoco>"):
        mv.load_mjcf(tmp_path / "other.xml")
    (tmp_path / "torn.xml").write_text("<mujoco")
    with pytest.raises(mv.ModelError, match="no XML"):
        mv.load_mjcf(tmp_path / "torn.xml")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(mv.ModelError, match=r'pip install "mbsvib\[mjcf\]"'):
        mv.load_mjcf(path)
