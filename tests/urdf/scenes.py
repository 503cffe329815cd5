"""Robots with closed loops in each dialect, open in their zero poses."""


def link(name, mass=None, at="0 0 0", inertia=(0.002, 0.003, 0.004)):
    if mass is None:
        return f'<link name="{name}"/>'
    xx, yy, zz = inertia
    return (f'<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia ixx="{xx}" iyy="{yy}" '
            f'izz="{zz}" ixy="0.0003" ixz="-0.0002" iyz="0.0001"/></inertial></link>')  # fmt: skip


def joint(name, kind, parent, child, at="0 0 0", rpy="0 0 0", axis="0 1 0", more=""):
    limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>' if kind in ("revolute", "prismatic") else ""
    return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}" '
            f'rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{more}</joint>')  # fmt: skip


FOUR_BAR = (link("base") + link("crank", 1.2, "0 0 0.1") + link("coupler", 0.8, "0.2 0 0") + link("rocker", 1.0,
            "0 0 0.15") + joint("a", "continuous", "base", "crank") + joint("b", "revolute", "crank", "coupler",
            "0 0 0.2") + joint("d", "revolute", "base", "rocker", "0.3 0 0"))  # fmt: skip
CONSTRAINT = ('<constraint name="tip" type="{}"><parent link="coupler"/><parent_origin xyz="0.35 0 0"/><parent_axis '
              'xyz="0 1 0"/><child link="rocker"/><child_origin xyz="0 0 0.3"/></constraint>')  # fmt: skip
LOOP = ('<loop name="tip" type="revolute"><predecessor link="coupler"><origin xyz="0.35 0 0"/></predecessor><successor '
        'link="rocker"><origin xyz="0 0 0.3"/></successor><axis xyz="0 1 0"/></loop>')  # fmt: skip
FRAMES = (link("tip_A") + link("tip_B") + joint("to_A", "fixed", "coupler", "tip_A", "0.35 0 0")
          + joint("to_B", "fixed", "rocker", "tip_B", "0 0 0.3"))  # fmt: skip
FIVE_BAR = (link("base") + "".join(
    link(f"{side}1", 1.0, "0.1 0 0.02") + link(f"{side}2", 0.7, "0.12 0 0") + joint(
        f"{side}_hip", "revolute", "base", f"{side}1", f"{x} 0 0") + joint(
        f"{side}_knee", "revolute", f"{side}1", f"{side}2", "0.2 0 0") for side, x in (("left", 0.0), ("right", 0.1)))
    + '<constraint name="foot" type="revolute_joint"><parent link="left2"/><parent_origin xyz="0.26 0 0"/><parent_axis '
    'xyz="0 1 0"/><child link="right2"/><child_origin xyz="0.25 0 0"/></constraint>')  # fmt: skip
ANGLES = ("0", "2.0943951023931953", "-2.0943951023931953")
DELTA = (link("base") + link("plate", 0.5, "0 0 0.01") + joint("free", "floating", "base", "plate", "0 0 -0.35")
    + "".join(
    link(f"arm{i}", 0.4, "0.1 0 0") + link(f"cross{i}", 0.05) + link(f"rod{i}", 0.2, "0 0 -0.15") + joint(
        f"motor{i}", "revolute", "base", f"arm{i}", f"{x} {y} 0", f"0 0 {angle}") + joint(
        f"elbow{i}", "revolute", f"arm{i}", f"cross{i}", "0.2 0 0") + joint(
        f"swing{i}", "revolute", f"cross{i}", f"rod{i}", axis="1 0 0") + (
        f'<constraint name="ball{i}" type="universal_joint"><parent link="rod{i}"/><parent_origin xyz="0 0 -0.4"/>'
        f'<parent_axis xyz="1 0 0"/><child link="plate"/><child_origin xyz="{0.5 * float(x)} {0.5 * float(y)} 0" '
        f'rpy="0 0 {angle}"/><child_axis xyz="0 1 0"/></constraint>')
    for i, (angle, x, y) in enumerate(zip(ANGLES, ("0.1", "-0.05", "-0.05"),
                                          ("0", "0.08660254037844387", "-0.08660254037844387"), strict=True))))
# a leg with a knee driven by a motor on the thigh through a rod with ball joints
CASSIE = (link("pelvis") + link("thigh", 3.0, "0 0.02 -0.2", (0.04, 0.05, 0.02)) + link("shin", 1.5, "0.02 0 -0.2",
          (0.02, 0.025, 0.01)) + link("lever", 0.5, "0.04 0 0") + link("rod", 0.3, "0 0 -0.2") + link("rod_A")
          + link("rod_B") + link("toe", 0.4, "0.05 0 -0.02")
          + joint("hip", "revolute", "pelvis", "thigh", "0 0.1 0") + joint("motor", "revolute", "thigh", "lever",
          "0.03 0.05 -0.05", "0 0.2 0") + joint("ball", "revolute", "lever", "rod", "0.08 0 0")
          + joint("knee", "revolute", "thigh", "shin", "0 0 -0.4")
          + joint("ankle", "continuous", "shin", "toe", "0 0 -0.4")
          + joint("to_A", "fixed", "rod", "rod_A", "0 0 -0.36") + joint("to_B", "fixed", "shin", "rod_B",
          "0.07 0.04 -0.02"))  # fmt: skip
CASSIE_YAML = """closed_loop: [['rod_A', 'rod_B']]
type: ['3d']
name_mot: ['hip', 'motor']
joint_name: ['ball']
joint_type: ['UJOINT_YX']
"""


def write(folder, words, yaml=None, name="robot"):
    path = folder / f"{name}.urdf"
    path.write_text(f'<robot name="{name}">{words}</robot>', encoding="utf-8")
    if yaml is not None:
        (folder / "loops.yaml").write_text(yaml, encoding="utf-8")
    return path
