"""Files of other programs where commands take model files."""

import json
import math
from pathlib import Path

import pytest

import mbsvib as mv

ROBOTS = Path(__file__).parents[2] / "examples" / "robots"
PENDULUM = """<mujoco><worldbody><body name="rod"><joint name="hinge" axis="0 1 0" frictionloss="1"/>
<inertial pos="0 0 -.4" mass="2" diaginertia=".03 .03 .001"/></body></worldbody></mujoco>"""


def test_urdf_by_its_ending_or_its_element(run, tmp_path):
    message = run(f"modes {ROBOTS / 'arm.urdf'}").stdout
    assert "Modes of arm: 6 DOF" in message
    (tmp_path / "arm.xml").write_bytes((ROBOTS / "arm.urdf").read_bytes())
    assert run("modes arm.xml").stdout == message


@pytest.mark.slow
def test_mjcf(run, tmp_path):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'mbsvib[mjcf]'")
    (tmp_path / "pendulum.xml").write_text(PENDULUM, encoding="utf-8")
    result = run("modes pendulum.xml")
    assert "Modes of pendulum: 1 DOF" in result.stdout
    assert result.stderr == "warning: pendulum.xml: left out: dry friction in 'hinge'.\n"
    assert run("export pendulum.xml -o pendulum.yaml").exit_code == 0
    assert list(mv.load("pendulum.yaml").joints) == ["hinge"]
    assert "no file 'pendulun.xml'. Did you mean 'pendulum.xml'?" in run("modes pendulun.xml").stderr
    (tmp_path / "pendulum.xml").write_text("<sdf/>", encoding="utf-8")
    result = run("modes pendulum.xml")
    assert (result.exit_code, "expected <mujoco>" in result.stderr) == (1, True)


TWO_RODS = """<robot name="rods"><link name="base"/>
<link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="2"/></inertial></link>
<link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="2"/></inertial></link>
<joint name="i" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="j" type="prismatic"><parent link="base"/><child link="b"/><axis xyz="1 0 0"/></joint></robot>"""


@pytest.fixture
def rods(tmp_path):
    """A wheel of 2 kg m^2 on joint i, a mass of 1 kg on the slide j."""
    (tmp_path / "rods.urdf").write_text(TWO_RODS, encoding="utf-8")
    return "rods.urdf"


@pytest.mark.parametrize(("words", "expected"), [
    ("--stiffness 8", (8 / 2, 8 / 1)),
    ("--stiffness 8 --stiffness j=18", (8 / 2, 18 / 1)),
    ("--stiffness i=8 --stiffness j=18", (8 / 2, 18 / 1)),
    ("--stiffness=8 --pose j=-0.5 --damping 0 --damping i=0.1 --gravity=0,0,0", (8 / 2, 8 / 1)),
    ("--stiffness i=8 --stiffness j=1e3,2e3,18,50,50,50", (8 / 2, 18 / 1, 50 / 2, 50 / 1, 50 / 1, 1e3 / 1, 2e3 / 1)),
])  # fmt: skip
def test_stiffness_of_joints(run, rods, words, expected):
    result = run(f"modes {rods} {words} --json")
    assert (result.exit_code, result.stderr) == (0, "")
    squares = [(2 * math.pi * mode["natural_hz"]) ** 2 for mode in json.loads(result.stdout)["modes"]]
    assert squares == pytest.approx(sorted(expected), rel=1e-12)


def test_joints_without_stiffness_are_remarked(run, rods):
    assert "remark: no joint of rods.urdf has stiffness; --stiffness gives it" in run(f"modes {rods}").stderr


def test_options_reach_every_command(run, rods):
    assert run(f"export {rods} --stiffness 8 --pose j=0.25 --floating -o rods.yaml").exit_code == 0
    model = mv.load("rods.yaml")
    assert model.springs["j.k"].stiffness[2] == 8.0
    assert model.bodies["b"].position[0] == 0.25
    assert "base" in model.bodies
    held = run(f"equilibrium {rods} --stiffness 8 --gravity 2,0,0 --json")
    assert json.loads(held.stdout)["displacements"]["b"][0] == pytest.approx(2.0 / 8.0)


@pytest.mark.parametrize(("line", "told"), [
    ("modes rods.urdf --keyframe home", "--keyframe: 'rods.urdf' is URDF, which .* for files of MJCF (.xml)."),
    ("modes slider.yaml --stiffness 1", "--stiffness: 'slider.yaml' is a model file, .* URDF (.urdf) and MJCF (.xml)."),
    ("modes stewart --floating", "--floating: 'stewart' is a built-in model, .* URDF (.urdf)."),
    ("report rods.urdf --compare slider.yaml --stiffness 1", "--stiffness: 'slider.yaml' is a model file"),
    ("modes rods.urdf --stiffness k=1", "stiffness: 'k' is not a joint that moves."),
    ("modes rods.urdf --pose k=1", "pose: 'k' is not a joint that moves."),
    ("modes rods.urdf --tip k", "tip = 'k' is not a link."),
    ("modes rods.urdf --stiffness j", "expected a number, or six with commas between, of all joints or as JOINT="),
    ("modes rods.urdf --pose 1", "expected NAME=VALUE, such as elbow=0.5, and not '1'."),
    ("modes rods.urdf --gravity 9.81", "expected X,Y,Z without blanks, such as 0,0,-9.81, and not '9.81'."),
])  # fmt: skip
def test_options_that_do_not_fit_are_refused(run, rods, line, told):
    result = run(line)
    assert result.exit_code == 2
    first, _, last = told.partition(" .* ")
    assert first in result.stderr
    assert last in result.stderr


def test_options_of_mjcf(run, tmp_path):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'mbsvib[mjcf]'")
    (tmp_path / "pendulum.xml").write_text(PENDULUM.replace(' frictionloss="1"', ""), encoding="utf-8")
    line = "modes pendulum.xml --gravity 0,0,0 --stiffness hinge=7 --pose hinge=0.3 --json"
    (mode,) = json.loads(run(line).stdout)["modes"]
    assert mode["natural_hz"] == pytest.approx(math.sqrt(7 / (0.03 + 2 * 0.4**2)) / (2 * math.pi), rel=1e-12)
    assert "for files of URDF (.urdf)" in run("modes pendulum.xml --floating").stderr


@pytest.mark.parametrize(("name", "told"), [("m.sdf", "SDF is not read; write the robot as a URDF or MJCF file"),
                                            ("m.urdf.xacro", "xacro file.urdf.xacro > file.urdf")])  # fmt: skip
def test_files_that_are_not_read_are_told_what_to_do(run, tmp_path, name, told):
    (tmp_path / name).write_text("<sdf/>")
    result = run(f"modes {name}")
    assert (result.exit_code, told in result.stderr) == (1, True)


def test_options_are_completed(run, rods):
    def candidates(*words):
        return run(f"--complete {' '.join(words)}").stdout.split()

    assert "--stiffness" in candidates("modes", rods, "--s")
    assert candidates("modes", rods, "--stiffness", "i") == ["i="]
    assert "--stiffness" not in candidates("modes", "stewart", "--s")


LEG = ROBOTS / "leg.urdf"


@pytest.mark.slow
def test_robots_with_loops_in_any_pose(run, tmp_path):
    """Under gravity, with stiffness and tips; loops of a YAML; a pose in degrees is a misuse."""
    pose = "--pose front_hip=-0.7 --pose rear_hip=0.5"
    result = run(f"modes {LEG} {pose} --stiffness 200 --tip body --tip rear_shin --json")
    assert (result.exit_code, len(json.loads(result.stdout)["modes"])) == (0, 2)
    held = run(f"equilibrium {LEG} {pose} --stiffness 200 --gravity 0,0,-9.81 --preload *_hip.k --file held.yaml")
    assert held.exit_code == 0
    assert mv.load("held.yaml").linearize().dof == 2
    assert "the limits of the file [rad, not degrees]" in run(f"modes {LEG} --pose rear_hip=30").stderr
    words = TWO_RODS.replace("</robot>", '<link name="p"/><joint name="f" type="fixed"><parent link="b"/><child '
                             'link="p"/></joint></robot>')  # fmt: skip
    (tmp_path / "looped.urdf").write_text(words, encoding="utf-8")
    (tmp_path / "loops.yml").write_text("closed_loop: [[base, p]]\ntype: [3d]\n", encoding="utf-8")
    assert "Modes of rods: 1 DOF" in run("modes looped.urdf --loops loops.yml --stiffness 8").stdout
    assert "for files of URDF (.urdf)" in run("modes stewart --loops loops.yml").stderr
