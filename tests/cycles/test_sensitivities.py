"""Derivatives of cycles against differences of cycles of changed models."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import library
from tests.support.slow_cases import some

TURN = 2 * np.pi


def differences(model, name, make, h=2e-6):
    """Central differences."""
    value = model.parameters[name]
    up, down = (make(model.with_values({name: value + d})) for d in (h, -h))
    return [(a - b) / (2 * h) for a, b in zip(up, down, strict=True)]


def spring_driven():
    model = library.hoeken(angle=0.2, gravity=(0, -9.81, 0))
    model.add_spring("tie", "ground", "link3", (0.4, 0.1, 0), model.joints["pin23"].position, 50.0, 2.0)
    return model


PLANAR = ["link1.mass", "link2.mass", "link2.position.x", "link3.position.y", "link2.inertia.zz", "crank.position.y",
          "pin12.position.x", "pin23.position.y", "rocker.position.x"]  # fmt: skip
CASES = {
    "hoeken": (library.hoeken(), "crank.rz", np.linspace(0, 6, 7), PLANAR),
    "rocker": (library.hoeken(angle=0.4), "rocker.rz", np.linspace(0, 0.4, 4), PLANAR),
    "springs": (spring_driven(), "crank.rz", np.linspace(0, 6, 7), ["tie.stiffness", "tie.damping", "gravity.y",
                                                                    "tie.start.x", "link2.mass", "pin12.position.x"]),
    "scraper": (library.carpet_scraper(), "crank.rz", np.linspace(0, 6, 5),
                ["link6.mass", "link7.position.x", "pin25.position.y", "pin46.position.x", "link4.inertia.zz"]),
    "seven": (library.seven_r(), "crank.rz", np.linspace(-0.5, 0.2, 4),
              ["link2.mass", "link2.position.z", "link2.inertia.xy", "ball12.2.position.x", "rocker.position.z",
               "ball23.1.position.y", "drive.stiffness"]),
    "slide": (library.toggle(), "rail.z", np.linspace(-0.01, 0.004, 4), ["arm1.mass", "elbow.position.y",
                                                                         "spring.stiffness", "slider.mass"]),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", some(CASES, "hoeken", "slide"))
def test_against_differences(case):
    model, drive, angles, names = CASES[case]

    def make(changed):
        cycle = changed.cycle(drive, angles, speed=TURN, about=(0.1, 0.2, 0.0))
        return cycle.torque, cycle.shaking_force, cycle.shaking_moment

    cycle = model.cycle(drive, angles, speed=TURN, about=(0.1, 0.2, 0.0))
    found = cycle.sensitivities(names)
    assert found.parameters == tuple(names)
    for i, name in enumerate(names):
        expected = differences(model, name, make)
        for exact, slope in zip((found.torque, found.shaking_force, found.shaking_moment), expected, strict=True):
            assert_allclose(exact[i], slope, rtol=1e-6, atol=3e-7 * max(1.0, abs(slope).max()))


@pytest.mark.slow
def test_rms_and_peak():
    model, angles = library.hoeken(), TURN * np.arange(18) / 18
    asked = [(what, quantity) for what in ("rms", "peak") for quantity in ("force", "moment", "torque")]

    def make(changed):
        cycle = changed.cycle("crank.rz", angles, speed=TURN, about=(0, 0, 0))
        return [getattr(cycle, what)(quantity) for what, quantity in asked]

    names = ["link1.position.x", "link3.position.y", "pin12.position.y"]
    found = model.cycle("crank.rz", angles, speed=TURN).sensitivities(names)
    for i, name in enumerate(names):
        exact = [getattr(found, what)(quantity)[i] for what, quantity in asked]
        assert_allclose(exact, differences(model, name, make), rtol=1e-6, atol=1e-7)
    balanced = library.hoeken(balance_radius=0.08).cycle("crank.rz", [0.0], speed=0.0)
    assert np.isnan(balanced.sensitivities("link1.mass").rms("force")).all()
    assert np.isnan(balanced.sensitivities("link1.mass").peak("force")).all()


def test_robots_by_closed_form():
    """tau of a pendulum is linear in mass and quadratic in the centre; several drives at once."""
    arm = library.two_link(gravity=(0, -9.81, 0))
    motion = {"joint1.rz": ([0.1, 0.5], 1.0, 2.0), "joint2.rz": ([0.3, -0.2], -1.0, 0.5)}
    cycle = arm.cycle(motion=motion)
    found = cycle.sensitivities()
    assert set(found.parameters) == {f"link{i}.{field}" for i in (1, 2) for field in (
        "mass", *(f"position.{a}" for a in "xyz"), *(f"inertia.{a}" for a in ("xx", "yy", "zz", "xy", "xz", "yz")))}
    # Euler: the torques are homogeneous of degree one in masses and inertias
    values = np.array([arm.parameters[name] if "position" not in name else 0.0 for name in found.parameters])
    for name in cycle.drives:
        assert_allclose(values @ found.torques[name], cycle.torques[name], rtol=1e-12)
    assert_allclose(np.einsum("k,knc->nc", values, found.shaking_force), cycle.shaking_force, rtol=1e-12, atol=1e-12)
    for asked in (("force",), ("moment",), *(("torque", name) for name in cycle.drives)):
        for what in ("rms", "peak"):
            assert values @ getattr(found, what)(*asked) == pytest.approx(getattr(cycle, what)(*asked), rel=1e-12)


def test_a_pin_that_leaves_its_plane():
    """Moving one pin of a planar linkage out of its plane moves it on both bodies: the loop still closes."""
    cycle = library.hoeken().cycle("crank.rz", [0.3, 1.0], speed=TURN)
    assert_allclose(cycle.sensitivities("pin12.position.z").torque, 0, atol=1e-12)


@pytest.mark.parametrize("length", [1.0, 1e-9])
def test_a_door_on_two_hinges(length):
    """A door has no dependent coordinate: tau = m g (x cos q - y sin q). A hinge may move along its axis only."""
    model = mv.Model("door", gravity=(0, -9.81 * length, 0))
    inertia, centre = np.array((0.1, 0.2, 0.1)) * length**2, np.array((0.5, 0.1, 0.2)) * length
    model.add_body("leaf", 3.0, inertia, centre)
    for name, z in (("low", 0.0), ("high", length)):
        model.add_joint(name, "revolute", "ground", "leaf", (0, 0, z), axis=(0, 0, 1))
    cycle = model.cycle("low.rz", [0.0, 0.7], speed=2.0)
    assert cycle.undetermined == dict.fromkeys(("low", "high"), ("x", "y", "z", "rx", "ry"))
    found = cycle.sensitivities(["leaf.mass", "high.position.z"])
    cos, sin = np.cos([0.0, 0.7]), np.sin([0.0, 0.7])
    moment = 9.81 * length**2 * (0.5 * cos - 0.1 * sin)
    assert_allclose(found.torque, [moment, 0.0 * moment], rtol=1e-12, atol=1e-12 * length)
    for name in ("low.position.x", "high.position.x", "high.position.y"):
        with pytest.raises(mv.ModelError, match=f"a change of '{name}' takes the loops apart"):
            cycle.sensitivities(name)


def test_patterns():
    cycle = library.hoeken().cycle("crank.rz", [0.3], speed=TURN)
    assert cycle.sensitivities("link*.mass").parameters == ("link1.mass", "link2.mass", "link3.mass")
    with pytest.raises(mv.ModelError, match="parameters = 3"):
        cycle.sensitivities(3)


def all_kinds():
    model = mv.Model("kinds", gravity=(1.0, 2.0, -9.81))
    turn = np.array([0.3, -0.5, 0.8])
    for name, at in (("a", (0.3, 0, 0.1)), ("b", (0.5, 0.4, 0)), ("c", (0.1, 0.6, 0.5))):
        model.add_body(name, 1.2, (0.02, 0.03, 0.025, 0.001, 0.002, -0.003), at, turn)
    model.add_joint("screw", "screw", "ground", "a", (0, 0, 0), orientation=turn, pitch=0.05)
    model.add_joint("hook", "universal", "a", "b", (0.4, 0.2, 0), axis=(0, 1, 0), axis2=(0.6, 0, 0.8))
    model.add_joint("slide", "cylindrical", "b", "c", (0.3, 0.5, 0.2), axis=(0, 0.6, 0.8))
    model.add_spring("tie", "ground", "c", (1, 1, 1), (0.1, 0.6, 0.6), 80.0, 3.0)
    return model


REACTIONS = {
    "seven": (library.seven_r(), {"crank.rz": ([-0.4, 0.1], [3.0, 4.0], [1.0, 0.0])},
              ["link2.mass", "link2.position.z", "ball12.2.position.x"]),
    "rssr": (library.rssr(rocker_ball="universal"), {"crank.rz": ([-0.4, 0.1], [3.0, 4.0], [1.0, 0.0])},
             ["link3.inertia.xy", "ball23.position.z", "drive.stiffness"]),
    "hoeken": (spring_driven(), {"crank.rz": ([0.4, 2.0], [3.0, 4.0], [1.0, 0.0])},
               ["pin12.position.x", "tie.damping", "gravity.y"]),
    "kinds": (all_kinds(), {"screw.rz": (0.4, 1.0, 2.0), "hook.rx": (0.2, 1.0, -1.0), "hook.ry": (-0.5, 0.4, 1.0),
                            "slide.z": (0.02, 0.3, 1.0), "slide.rz": (0.5, -1.0, 0.5)},
              ["b.mass", "a.inertia.xz", "hook.position.y", "slide.position.x"]),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", some(REACTIONS, "kinds"))
def test_reactions_against_differences(case):
    model, motion, names = REACTIONS[case]
    cycle = model.cycle(motion=motion)
    found = cycle.sensitivities(names)
    for i, name in enumerate(names):
        slopes = differences(model, name, lambda changed: list(changed.cycle(motion=motion).reactions.values()), 1e-5)
        for joint, slope in zip(model.joints, slopes, strict=True):
            exact, loose = found.reactions[joint][i], cycle.undetermined.get(joint, ())
            known = [k for k, direction in enumerate(("x", "y", "z", "rx", "ry", "rz")) if direction not in loose]
            assert_allclose(exact[:, known], slope[:, known], rtol=1e-6, atol=2e-7 * max(1.0, np.abs(slope).max()))
            assert np.isnan(exact[:, [k for k in range(6) if k not in known]]).all()
