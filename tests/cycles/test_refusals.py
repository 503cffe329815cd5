"""Cycles that do not exist, and drives that are none: refused by name, with the angle."""

import re

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library

TURN = 2 * np.pi


def four_bar(crank, coupler, rocker, ground, angle):
    return library.hoeken(crank=crank, coupler=coupler, rocker=rocker, ground=ground, angle=angle)


def angle_in(error):
    return float(re.search(r"\.rz = (-?[\d.e-]+) rad", str(error.value)).group(1))


@pytest.mark.parametrize("samples", [13, 12, 50])
def test_a_parallelogram_is_singular_where_it_is_flat(samples):
    """Crank and rocker alike, coupler and ground alike: at 180 degrees all bars are on one line."""
    model = four_bar(0.1, 0.3, 0.1, 0.3, 1.0)
    with pytest.raises(mv.errors.SingularPoseError, match=r"cycle: at crank.rz = .* singular pose") as error:
        model.cycle("crank.rz", np.linspace(0.0, TURN, samples), speed=1.0)
    assert angle_in(error) == pytest.approx(np.pi - 1.0, abs=1e-5)


def test_a_described_pose_that_is_singular():
    with pytest.raises(mv.errors.SingularPoseError, match=r"at pin67.rz = 0 rad the mechanism is in a singular pose"):
        library.carpet_scraper().cycle("pin67.rz", [0.0, 0.1], speed=1.0)


def test_a_rocker_reaches_its_dead_centre():
    """The rocker of Hoeken's linkage turns until crank and coupler are in line: 0.35 m from pivot to pin."""
    model = four_bar(0.1, 0.25, 0.25, 0.2, 1.2)
    x, y, _ = model.joints["pin23"].position
    now = np.arctan2(y, x - 0.2)
    # cosine law in the triangle of ground 0.2, rocker 0.25 and crank + coupler 0.35
    inner = np.arccos((0.2**2 + 0.25**2 - 0.35**2) / (2 * 0.2 * 0.25))
    farthest = np.pi - inner
    with pytest.raises(mv.errors.SingularPoseError) as error:
        model.cycle("rocker.rz", [0.0, farthest - now - 0.5], speed=1.0)
    assert angle_in(error) == pytest.approx(farthest - now, abs=1e-5)
    before = model.cycle("rocker.rz", [0.0, 0.9 * (farthest - now)], speed=1.0)
    assert np.isfinite(before.torque).all()


@pytest.mark.slow
def test_near_a_singular_pose_it_warns_as_long_as_digits_are_left():
    """The torque grows as the square of the distance falls, as rates of the other bars do as its root."""
    model = four_bar(0.1, 0.25, 0.25, 0.2, 1.2)
    x, y, _ = model.joints["pin23"].position
    limit = np.pi - np.arccos((0.2**2 + 0.25**2 - 0.35**2) / (2 * 0.2 * 0.25)) - np.arctan2(y, x - 0.2)
    far = model.cycle("rocker.rz", [limit * (1 - 1e-6)], speed=1.0)
    with pytest.warns(mv.errors.NearSingularWarning, match=r"lose as many digits"):
        near = model.cycle("rocker.rz", [limit * (1 - 1e-8)], speed=1.0)
    assert near.torque == pytest.approx(1e4 * far.torque, rel=0.01)
    for distance in (1e-10, 1e-11, 1e-13, 0.0):
        with pytest.raises(mv.errors.SingularPoseError, match=r"cycle: at rocker.rz = .* singular pose"):
            model.cycle("rocker.rz", [limit * (1 - distance)], speed=1.0)


def test_a_drive_that_loops_hold():
    model = library.hoeken().with_parts(joints={})
    for joint in library.hoeken().joints.values():
        kind = "cylindrical" if joint.name == "crank" else joint.kind
        model.add_joint(joint.name, kind, joint.first, joint.second, joint.position, axis=joint.axis)
    with pytest.raises(mv.ModelError, match=r"the drive 'crank.z' does not move the mechanism.*crank.rz"):
        model.cycle(motion={"crank.rz": (0, 1, 0), "crank.z": (0, 0, 0)})
    with pytest.raises(mv.ModelError, match=r"the drive 'crank.z' does not determine the motion of"):
        model.cycle("crank.z", [0.0], speed=1.0)


def test_a_structure_has_no_drive():
    model = library.hoeken()
    model.add_joint("lock", "fixed", "ground", "link3")
    with pytest.raises(mv.ModelError, match=r"'crank.rz' does not move the mechanism.*it is fully locked"):
        model.cycle("crank.rz", [0.0, 0.1], speed=1.0)


def test_drives_that_loops_tie():
    with pytest.raises(mv.ModelError, match=r"tie the drives 'crank.rz', 'rocker.rz'.*leave out 1"):
        library.hoeken(angle=0.3).cycle(motion={"crank.rz": (0, 1, 0), "rocker.rz": (0, 1, 0)})
    every = {f"{name}.rz": (0, 0, 0) for name in ("crank", "pin12", "pin23", "rocker")}
    with pytest.raises(mv.ModelError, match=r"cycle: all joints of the loop that 'pin.*' closes are driven"):
        library.hoeken().cycle(motion=every)


def test_freedoms_that_no_drive_has():
    with pytest.raises(mv.ModelError, match=r"'crank.rz' does not determine the motion of 'ball12.r"):
        library.rssr().cycle("crank.rz", [0.0, 0.1], speed=1.0)
    with pytest.raises(mv.ModelError, match=r"'joint1.rz' does not determine the motion of 'joint2.rz'; drive that"):
        library.two_link().cycle("joint1.rz", [0.0], speed=1.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [({}, "give either a drive"), ({"drive": "crank.rz"}, "speed = None; expected the rate"),
     ({"drive": "crank.z", "angles": [0], "speed": 1}, "'crank.z' is not a joint coordinate.*Did you mean 'crank.rz'"),
     ({"drive": ["crank.rz"], "angles": [0], "speed": 1}, r"\['crank.rz'\] is not a joint coordinate"),
     ({"drive": "crank.rz", "angles": [0, np.nan], "speed": 1}, "angles = .*all finite"),
     ({"drive": "crank.rz", "angles": "fast", "speed": 1}, "angles = 'fast'"),
     ({"drive": "crank.rz", "angles": [0.0], "speed": "fast"}, "speed = 'fast'"),
     ({"motion": {}}, "motion = {}"), ({"motion": {"crank.rz": (0, 1)}}, "three arrays"),
     ({"motion": {"crank.rz": ([0, 1], [1, 1, 1], 0)}}, "3 samples, as the others have"),
     ({"motion": {"crank.rz": (0, [np.nan], 0)}}, r"motion\['crank.rz'\] = \[nan\]"),
     ({"motion": {"crank.rz": (0, 1, 0)}, "speed": 1.0}, "motion= says the rates itself"),
     ({"drive": "crank.rz", "angles": [0.0], "speed": 1, "about": (0, 0)}, "about")],
)  # fmt: skip
def test_mistakes_are_named(words, said):
    with pytest.raises(mv.ModelError, match=said):
        library.hoeken().cycle(**words)


def test_parts_without_finite_motion():
    with pytest.raises(mv.ModelError, match=r"ball12.*rotation vector"):
        library.rssr(rocker_ball="universal").cycle("ball12.rx", [0.0], speed=1.0)
    model = library.hoeken()
    model.add_maxwell("soft", "ground", "link1", (0, 0, 0.1), (0.05, 0, 0), stiffness=1.0, damping=1.0)
    with pytest.raises(mv.ModelError, match=r"Maxwell element 'soft': has a state of its own"):
        model.cycle("crank.rz", [0.0], speed=1.0)


def test_questions_that_have_no_answer():
    cycle = library.hoeken().cycle("crank.rz", [0.0, 1.0], speed=1.0)
    with pytest.raises(mv.ModelError, match=r"quantity = 'forse'.*Did you mean 'force'"):
        cycle.rms("forse")
    with pytest.raises(mv.ModelError, match=r"no parameter"):
        cycle.sensitivities("crank.mass")
    with pytest.raises(mv.ModelError, match=r"'link1.orientation.rx' cannot be a symbol"):
        cycle.sensitivities("link1.orientation.rx")
    arm = library.two_link().cycle(motion={"joint1.rz": (0, 1, 0), "joint2.rz": (0, 1, 0)})
    with pytest.raises(mv.ModelError, match=r"drive = None; expected one of the drives: joint1.rz, joint2.rz"):
        arm.rms("torque")
    assert arm.rms("torque", "joint2.rz") == abs(arm.torque["joint2.rz"][0])
    assert "torque at joint2.rz" in str(arm)
    with pytest.raises(ValueError, match=r"read-only"):
        cycle.torque[0] = 1.0


def test_without_casadi(monkeypatch):
    monkeypatch.setattr("mbsvib.api.running.find_spec", lambda name: None)
    with pytest.raises(mv.MbsvibError, match=r"needs CasADi, which is not installed; pip install"):
        library.hoeken().cycle("crank.rz", [0.0], speed=1.0)


def test_drives_that_push_have_forces():
    """2 kg that are lifted with 2 m/s^2 and turned."""
    model = mv.Model("lift", gravity=(0, 0, -10.0))
    model.add_body("b", 2.0, (0.1, 0.1, 0.1))
    model.add_joint("j", "cylindrical", "ground", "b", (0, 0, 0), axis=(0, 0, 1))
    motion = {"j.z": ([0.0, 1.0], 1.0, 2.0), "j.rz": ([0.0, 1.0], 1.0, 30.0)}
    assert model.cycle(motion=motion).table()["rows"] == [
        ("shaking force [N]", "4", "4"), ("shaking moment [N m]", "3", "3"), ("force at j.z [N]", "24", "24"),
        ("torque at j.rz [N m]", "3", "3")]  # fmt: skip


@pytest.mark.parametrize("samples", [7, 2])
def test_springs_that_are_turned_beyond_their_limit(samples):
    """Also between samples, and on the way from the described pose: a spring that is wound up does not come back."""
    model = disk()
    model.add_torsion_spring("coil", "ground", "disk", (0, 0, 1), 0.3)
    with pytest.raises(mv.ModelError, match="'coil' is turned so far") as error:
        model.cycle("hinge.rz", 4.5 * np.arange(1, samples + 1) / samples, speed=1.0)
    assert 3.0 < angle_in(error) < TURN - 3.0
    assert model.cycle("hinge.rz", [2.9, -2.9], speed=1.0).torque == pytest.approx([0.87, -0.87], rel=1e-12)


@pytest.mark.parametrize("values", [{"stiffness": 0.3}, {"damping": 0.1}])
def test_torsion_springs_that_swing_by_half_a_turn(values):
    """A body that has turned by half a turn across the axis of a spring has no angle about it, nor a rate."""
    model = disk()
    model.add_torsion_spring("coil", "ground", "disk", (1, 0, 0), **values)
    with pytest.raises(mv.ModelError, match="'coil' is turned so far") as error:
        model.cycle("hinge.rz", [1.5, 3.1, 4.5], speed=1.0)
    assert 3.0 < angle_in(error) < TURN - 3.0
    assert model.cycle("hinge.rz", [2.9, -2.9], speed=1.0).torque == pytest.approx([0.0, 0.0], abs=1e-12)


def test_dampers_and_bushings_of_forces_alone_turn_without_limit():
    model = disk()
    model.add_torsion_spring("bearing", "ground", "disk", (0, 0, 1), damping=0.1)
    model.add_bushing("mount", "ground", "disk", (0, 0, 0), (1e5, 1e5, 1e5, 0, 0, 0))
    torque = model.cycle("hinge.rz", TURN * np.arange(8) / 8, speed=5.0).torque
    assert torque == pytest.approx(np.full(8, 0.5), rel=1e-12)


@pytest.mark.slow
def test_dampers_and_bushings_of_forces_alone_turn_without_limit_in_runs():
    model = disk()
    model.add_torsion_spring("bearing", "ground", "disk", (0, 0, 1), damping=0.1)
    model.add_bushing("mount", "ground", "disk", (0, 0, 0), (1e5, 1e5, 1e5, 0, 0, 0))
    run = model.simulate([0.0, 1.0, 2.0], initial={"hinge.rz": (0.0, 9.0)})
    assert run.coordinates["hinge.rz"] == pytest.approx(9.0 * (1.0 - np.exp(-run.time)), rel=1e-7)


def disk():
    model = mv.Model("disk")
    model.add_body("disk", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("hinge", "revolute", "ground", "disk", (0, 0, 0), axis=(0, 0, 1))
    return model
