"""Files of other programs where commands take model files."""

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
