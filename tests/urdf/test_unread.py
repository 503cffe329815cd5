"""What URDF files have beside links and joints of a tree, and inertia that no body has: refused, named, repaired."""

import re
from contextlib import nullcontext

import numpy as np
import pytest

import mbsvib as mv
from tests.urdf.test_robot import joint, link

TREE = link("a") + link("b", 1.0) + joint("j", "revolute", "a", "b")
FIX = '<gazebo><joint name="f" type="fixed"><parent>world</parent><child>{}</child></joint></gazebo>'


@pytest.mark.parametrize(("element", "told", "call"), [
    ('<loop_joint name="close" type="revolute"/>', "<loop_joint> 'close'", "add_joint"),
    ('<drake:ball_constraint/>', "<drake:ball_constraint> ''", "add_joint"),
    ('<d:Ball_Constraint xmlns:d="http://drake.mit.edu"/>', "<d:Ball_Constraint> ''", "add_joint"),
    ('<drake:linear_bushing_rpy name="s"/>', "<drake:linear_bushing_rpy> 's'", "add_bushing"),
    ('<drake:linear_spring_damper/>', "<drake:linear_spring_damper> ''", "add_spring"),
    ('<force_element name="f"><linear_spring_damper name="s"/></force_element>', "<linear_spring_damper> 's'",
     "add_spring"),
    ('<drake:tendon_constraint/>', "<drake:tendon_constraint> ''", "add_coupler"),
    ('<mujoco><compiler/><equality><connect body1="a"/></equality></mujoco>', "<equality> ''", "add_joint"),
    (link("c") + '<drake:joint name="g" type="ball"><child link="c"/></drake:joint>', "<drake:joint> 'g'",
     "floating.*add_joint"),
    ('<gazebo><joint name="close" type="ball"><child>b</child></joint></gazebo>', "<joint> 'close'", "add_joint"),
    (FIX.format("b"), "<joint> 'f'", "add_joint"),
])  # fmt: skip
def test_connections_beside_the_tree_are_refused(robot, element, told, call):
    with pytest.raises(mv.ModelError, match=rf"robot\.urdf: {told} connects links beside the tree.*{call}"):
        mv.load_urdf(robot(TREE + element))


def test_links_of_simulators_are_refused(robot):
    with pytest.raises(mv.ModelError, match=r"robot\.urdf: <model> 'm' adds links .* Write them as <link>"):
        mv.load_urdf(robot(TREE + '<gazebo><model name="m"/></gazebo>'))


@pytest.mark.parametrize("element", [
    '<gazebo reference="b"><mu1>0.2</mu1><springStiffness>0</springStiffness><gravity>true</gravity></gazebo>',
    '<gazebo><plugin name="p" filename="l.so"><spring>1</spring><joint>j</joint></plugin></gazebo>',
    '<transmission name="t"><joint name="j"/><actuator name="m"><mechanicalReduction>9</mechanicalReduction></actuator>'
    "</transmission>",
    '<material name="m"/><mujoco><compiler fusestatic="false"/></mujoco><drake:collision_filter_group name="g"/>',
    FIX.format("a"),  # the reader does the same
])  # fmt: skip
def test_elements_without_mechanics_are_ignored(robot, element):
    assert mv.load_urdf(robot(TREE + element)).linearize().M.shape == (1, 1)


@pytest.mark.parametrize(("element", "told"), [
    ('<gazebo reference="j"><springStiffness>5</springStiffness></gazebo>', r"spring in 'j' \(<springStiffness> 5\)"),
    ('<gazebo reference="b"><turnGravityOff>true</turnGravityOff></gazebo>', "no gravity on 'b'"),
    ('<gazebo reference="b"><gravity>0</gravity></gazebo>', "no gravity on 'b'"),
    ('<transmission name="t"><actuator name="m"><drake:rotor_inertia value="1e-4"/></actuator></transmission>',
     "rotor inertia in 'm'"),
    ('<force_element name="f"><propellor lift_constant="1"/></force_element>', "<force_element> 'f'"),
    (link("c", 1.0).replace("</link>", "<inertial/></link>") + joint("k", "fixed", "b", "c"),
     "all but the first <inertial> of 'c'"),
    (link("c", 1.0) + joint("k", "revolute", "b", "c", more='<dynamics damping="1" stiffness="7"/>'),
     r"stiffness of 'k' \(7\)"),
    (link("c", 1.0) + joint("k", "revolute", "b", "c", more='<spring stiffness="7"/>'), "<spring> of 'k'"),
])  # fmt: skip
def test_mechanics_that_are_not_read_are_named(robot, element, told):
    with pytest.warns(mv.LeftOutWarning, match=rf"robot\.urdf: left out: {told}"):
        mv.load_urdf(robot(TREE + element))


@pytest.mark.parametrize("attribute", ["${mass}", "$(arg mass)"])
def test_values_that_are_not_expanded_are_refused(robot, attribute):
    path = robot(link("a") + link("b", attribute) + joint("j", "revolute", "a", "b"))
    told = rf"robot\.urdf: <mass value='{re.escape(attribute)}'> .*: xacro file\.urdf\.xacro > file\.urdf"
    with pytest.raises(mv.ModelError, match=told):
        mv.load_urdf(path)
    path.write_text(path.read_text().replace(attribute, "1").replace('name="j"', 'name="${side}j"'))
    with pytest.raises(mv.ModelError, match=r"<joint name='\${side}j'> has a macro"):
        mv.load_urdf(path)


def test_macros_in_what_is_not_read_are_left(robot):
    """A mesh and a material of a link; macros within a joint are refused at any depth."""
    seen = '<visual><geometry><mesh filename="$(find arm)/b.stl"/></geometry><material name="${color}"/></visual>'
    words = link("a") + link("b", 1.0).replace("</link>", seen + "</link>")
    assert mv.load_urdf(robot(words + joint("j", "revolute", "a", "b"))).bodies.keys() == {"b"}
    more = '<extra><spring stiffness="${k}"/></extra>'
    with pytest.raises(mv.ModelError, match=r"<spring stiffness='\${k}'> has a macro"):
        mv.load_urdf(robot(words + joint("j", "revolute", "a", "b", more=more)))


def test_macros_that_are_not_expanded_are_refused(robot):
    macro = '<xacro:arm xmlns:xacro="http://www.ros.org/wiki/xacro"/>'
    with pytest.raises(mv.ModelError, match="<xacro:arm> is not expanded"):
        mv.load_urdf(robot(link("a", 1.0) + macro), floating=True)


@pytest.mark.parametrize(("mass", "floating", "way"), [(1.0, False, "floating=True"), (None, True, "inertial")])
def test_robots_in_which_nothing_moves_are_reported(robot, mass, floating, way):
    with pytest.warns(mv.LeftOutWarning, match=f"nothing with a mass moves: 1 links.*{way}"):
        mv.load_urdf(robot(link("a", mass)), floating=floating)


def test_joints_that_move_no_mass_are_reported(robot):
    """Also behind other links; fixed links lend their mass, and so does what hangs on a link without one."""
    words = (link("a") + link("b") + link("c", 1.0) + link("d") + link("e") + link("f", 1.0)
             + joint("carries", "revolute", "a", "b") + joint("k", "revolute", "b", "c")
             + joint("idle", "revolute", "a", "d") + joint("tip", "prismatic", "d", "e"))  # fmt: skip
    with pytest.warns(mv.LeftOutWarning, match=r"robot\.urdf: no mass moves with 'idle', 'tip'\. .*fixed"):
        mv.load_urdf(robot(words + joint("weld", "fixed", "c", "f")))
    assert len(mv.load_urdf(robot(words + joint("weld", "fixed", "e", "f"))).joints) == 4


def test_a_fixed_joint_that_mimics_has_no_coordinate(robot):
    tree = link("a") + link("b", 1.0) + link("c", 2.0) + joint("j", "prismatic", "a", "b")
    follows = joint("f", "fixed", "b", "c", more='<mimic joint="j" multiplier="2" offset="0.1"/>')
    np.testing.assert_allclose(mv.load_urdf(robot(tree + follows)).linearize().M, [[3.0]], rtol=1e-15)


@pytest.mark.parametrize("inertia", [
    (0.0123452, 0.0345676, 0.0469130, 0, 0, 0),  # a plate: the last moment is the sum, but for six digits
    (-5e-20, 1e-3, 1e-3, 0, 0, 0),
])  # fmt: skip
def test_inertia_that_is_off_by_printed_digits_is_accepted(robot, inertia):
    body = mv.load_urdf(robot(link("a", 1.0, inertia=inertia)), floating=True).bodies["a"]
    np.testing.assert_allclose(body.inertia[:3], inertia[:3], rtol=2e-5, atol=1e-15)


def test_inertia_that_is_off_by_the_rounding_of_moved_axes_is_zero(robot):
    """A public file has a mass with such moments: parallel axes, subtracted."""
    path = robot(link("a", 0.526, "0 0 0.03045", inertia=("-5.42101e-20", "-5.42101e-20", 0, 0, 0, 0)))
    with pytest.warns(mv.AccuracyWarning, match="inertia is zero"):
        assert not any(mv.load_urdf(path, floating=True).bodies["a"].inertia)


@pytest.mark.parametrize("moments", [(3.4e-6, 1.4e-6, 4.6e-6), (40.4e-6, 20.4e-6, 60.7e-6)])
def test_inertia_that_is_off_by_printed_decimals_is_accepted(robot, moments):
    """Decimals as of "%f" leave 3, 1, 5 of a possible body."""
    inertia = [f"{moment:f}" for moment in (*moments, 0, 0, 0)]
    vague = moments[0] < 1e-5
    with pytest.warns(mv.AccuracyWarning, match="inertia is zero, or not larger .*: 'a'") if vague else nullcontext():
        body = mv.load_urdf(robot(link("a", 1.0, inertia=inertia)), floating=True).bodies["a"]
    np.testing.assert_allclose(body.inertia[:3], moments, atol=1.5e-6)
    exact = [f"{moment:.9f}" for moment in (3e-6, 1e-6, 5e-6, 0, 0, 0)]
    with pytest.raises(mv.ModelError, match="none can be negative"):
        mv.load_urdf(robot(link("a", 1.0, inertia=exact)), floating=True)


@pytest.mark.parametrize("zero", ["0", "0.000000", "0.0"])
def test_masses_without_inertia_are_named(robot, zero):
    with pytest.warns(mv.AccuracyWarning, match=r"robot\.urdf: inertia is zero.*: 'b'\. .* more digits"):
        mv.load_urdf(robot(link("a") + link("b", 1.0, inertia=[zero] * 6) + joint("j", "revolute", "a", "b")))


def test_inertia_that_no_body_has_is_refused_or_repaired(robot):
    path = robot(link("a", 1.0, inertia=(1.0, 1.0, 3.0, 0, 0, 0)))
    with pytest.raises(mv.ModelError, match=r"robot\.urdf: body 'a': inertia .* 1, 1, 3 .*inertia=\"repair\""):
        mv.load_urdf(path, floating=True)
    with pytest.warns(mv.AccuracyWarning, match=r"robot\.urdf: no body can have the inertia of 'a'"):
        body = mv.load_urdf(path, floating=True, inertia="repair").bodies["a"]
    # second moments (1.5, 1.5, -0.5) become (1.5, 1.5, 0)
    np.testing.assert_allclose(body.inertia[:3], (1.5, 1.5, 3.0), rtol=1e-14)
    with pytest.raises(mv.ModelError, match="expected 'as given' or 'repair'"):
        mv.load_urdf(path, inertia="guess")
