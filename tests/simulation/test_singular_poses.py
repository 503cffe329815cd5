"""Runs that start at a dead centre, or at a pose from which loops can go on in several ways, or come to one."""

import re

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.library import hoeken

LIMIT = 0.35  # length of crank and coupler in line


def rocker_to_its_limit():
    """A four-bar, and how far its rocker turns until crank and coupler are in line."""
    model = hoeken(crank=0.1, coupler=0.25, rocker=0.25, ground=0.2, angle=1.2)
    x, y, _ = model.joints["pin23"].position
    inner = np.arccos((0.2**2 + 0.25**2 - LIMIT**2) / (2 * 0.2 * 0.25))
    return model, np.pi - inner - np.arctan2(y, x - 0.2)


@pytest.mark.few(2)
@pytest.mark.parametrize("rate", [0.0, -1.0])
@pytest.mark.parametrize("distance", [1e-9, 1e-12, 0.0, -1e-13])
def test_a_start_at_the_dead_centre_of_what_is_displaced(distance, rate):
    model, limit = rocker_to_its_limit()
    words = r"simulate: .* with rocker.rz = .* dead centre .* displace '\w+.rz' instead"
    with pytest.raises(mv.SingularPoseError, match=words):
        model.simulate([0.0, 0.01], initial={"rocker.rz": (limit * (1.0 - distance), rate)})


@pytest.mark.slow
@pytest.mark.parametrize("distance", [1e-3, 1e-5])
def test_near_a_dead_centre_rates_grow_as_the_root_of_the_distance(distance):
    """The crank turns by c sqrt(d), so that its rate is c / (2 sqrt(d)) times that of d."""
    model, limit = rocker_to_its_limit()
    crank = [model.simulate([0.0, 1e-9], initial={"rocker.rz": (limit * (1.0 - d), -1.0)}).rates["crank.rz"][0]
             for d in (distance, 1e-2 * distance)]  # fmt: skip
    assert crank[1] == pytest.approx(10.0 * crank[0], rel=30.0 * np.sqrt(distance))


def test_a_start_beyond_the_dead_centre_tells_how_far_loops_close():
    model, limit = rocker_to_its_limit()
    with pytest.raises(mv.ModelError, match=r"cannot be closed with .*, on the way only up to rocker.rz = ") as error:
        model.simulate([0.0, 0.01], initial={"rocker.rz": 1.001 * limit})
    assert float(re.findall(r"rocker.rz = (-?[\d.]+)", str(error.value))[1]) == pytest.approx(limit, rel=1e-5)


def flat_parallelogram(angle):
    return hoeken(crank=0.1, coupler=0.3, rocker=0.1, ground=0.3, angle=angle), np.pi - angle


@pytest.mark.few(1)
@pytest.mark.parametrize("distance", [1e-6, 1e-9, 0.0, -1e-3])
def test_a_parallelogram_does_not_start_where_it_is_flat_or_beyond(distance):
    """There it may go on as an antiparallelogram: rates were anything between those of both."""
    model, flat = flat_parallelogram(1.0)
    with pytest.raises(mv.SingularPoseError, match=r"simulate: .* singular pose"):
        model.simulate([0.0, 0.01], initial={"crank.rz": (flat - distance, 1.0)})
    near = model.moved({"crank.rz": flat - 1e-4})
    with pytest.raises(mv.SingularPoseError, match=r"simulate: .* singular pose"):
        near.simulate([0.0, 0.01], initial={"crank.rz": (1e-4 - distance, 1.0)})


@pytest.mark.slow
def test_a_run_stops_where_a_sample_is_at_the_flat_pose():
    model, flat = flat_parallelogram(1.0)
    with pytest.raises(mv.SimulationError, match="singular pose, from which they could go on in several ways") as error:
        model.simulate([0.0, 0.005, 0.01, 0.02], initial={"crank.rz": (flat - 0.01, 1.0)})
    assert error.value.time == pytest.approx(0.01, abs=1e-4)
    assert error.value.run.rates["crank.rz"] == pytest.approx(1.0, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("distance", "rate", "samples"), [
    (1e-4, 1.0, 2), (0.02, 30.0, 2), (0.7, 1.0, 101),
    *[pytest.param(*case, marks=pytest.mark.slow) for case in ((1e-4, 1.0, 101), (1e-3, -0.5, 2), (1e-3, -0.5, 101),
                                                               (0.02, 30.0, 101), (0.7, 1.0, 2))],
])  # fmt: skip
def test_a_run_does_not_pass_the_flat_pose_between_samples(distance, rate, samples):
    """From 1e-4 rad before it the rocker went on at -0.89 of the rate, as that of an antiparallelogram."""
    model, flat = flat_parallelogram(1.0)
    start = flat - distance if rate > 0.0 else distance - 1.0
    t = np.linspace(0.0, 1.9 * distance / abs(rate), samples)
    with pytest.raises(mv.SimulationError, match=r"singular pose.*; change a length .* end the run before") as error:
        model.simulate(t, initial={"crank.rz": (start, rate)})
    assert 0.9 * distance < error.value.time * abs(rate) <= distance * (1.0 + 1e-6)
    assert error.value.coordinate in error.value.run.coordinates


def slider_crank(rod):
    """A crank of 0.1 m at 60 degrees from the line of a slider, and a rod of some length."""
    pin, end = (0.05, 0.05 * 3.0**0.5), 0.05 + (rod**2 - 0.0075) ** 0.5
    model = mv.Model("slider-crank")
    for name, x, y in (("crank", pin[0] / 2, pin[1] / 2), ("rod", (pin[0] + end) / 2, pin[1] / 2), ("slider", end, 0)):
        model.add_body(name, 1.0, (0.01, 0.01, 0.01), (x, y, 0))
    model.add_joint("a", "revolute", "ground", "crank", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("b", "revolute", "crank", "rod", (*pin, 0), axis=(0, 0, 1))
    model.add_joint("c", "revolute", "rod", "slider", (end, 0, 0), axis=(0, 0, 1))
    model.add_joint("d", "prismatic", "ground", "slider", (end, 0, 0), axis=(1, 0, 0))
    return model


@pytest.mark.slow
def test_a_slider_crank_of_equal_lengths_stops_where_its_slider_could_stay():
    """With the slider at the pin of the crank, crank and rod may turn together."""
    with pytest.raises(mv.SimulationError, match="singular pose") as error:
        slider_crank(0.1).simulate([0.0, 1.0], initial={"a.rz": (0.0, 1.0)})
    assert 0.4 < error.value.time < 1.0
    assert error.value.run.coordinates["a.rz"][-1] < np.pi / 6


@pytest.mark.few(1)
@pytest.mark.parametrize("samples", [2, 51])
def test_a_slider_crank_passes_its_dead_centres(samples):
    run = slider_crank(0.3).simulate(np.linspace(0.0, 3.0, samples), initial={"a.rz": (0.0, 3.0)})
    turned = run.coordinates["a.rz"]
    rod = [-np.arcsin(np.sin(angle) / 3.0) for angle in (np.pi / 3 + turned, np.pi / 3)]
    assert turned[-1] > 2.0 * np.pi
    assert run.coordinates["b.rz"] == pytest.approx(rod[0] - rod[1] - turned, abs=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("samples", [2, 51])
@pytest.mark.parametrize("shorter", [1e-3, 1e-5])
def test_nearly_a_parallelogram_passes_its_nearly_flat_pose(shorter, samples):
    """The rocker goes on as that of an antiparallelogram: coupler and rocker stay on their side of each other."""
    model = hoeken(crank=0.1 * (1.0 - shorter), coupler=0.3, rocker=0.1, ground=0.3, angle=1.0)
    run = model.simulate(np.linspace(0.0, 3.0, samples), initial={"crank.rz": (0.0, 1.0)})
    x, y, _ = model.joints["pin12"].position
    pin = (x + 1j * y) * np.exp(1j * run.coordinates["crank.rz"])
    x, y, _ = model.joints["pin23"].position
    rocker = (x - 0.3 + 1j * y) * np.exp(1j * run.coordinates["rocker.rz"])
    side = (rocker * np.conj(0.3 + rocker - pin)).imag
    assert abs(0.3 + rocker - pin) == pytest.approx(0.3, abs=1e-9)
    assert run.coordinates["crank.rz"][-1] > np.pi - 0.9
    assert (side > 0.0).all()


@pytest.mark.slow
def test_a_run_stops_where_a_spring_turns_too_far_also_if_steps_are_longer():
    """A weak spring behind a gear of 60: the disk turns by 300 rad in a sample, and by many turns in a step."""
    model = mv.Model("wound")
    for name, x in (("shaft", 1.0), ("hinge", 0.0)):
        model.add_body(f"{name}_disk", 1.0, (0.1, 0.1, 0.1), position=(x, 0, 0))
        model.add_joint(name, "revolute", "ground", f"{name}_disk", (x, 0, 0), axis=(0, 0, 1))
    model.add_torsion_spring("coil", "ground", "hinge_disk", (0, 0, 1), 1e-9)
    model.add_gear("mesh", "shaft", "hinge", 60.0)
    with pytest.raises(mv.errors.SimulationError, match="'coil' is turned so far") as error:
        model.simulate(np.linspace(0.0, 5.0, 6), initial={"shaft.rz": (0.0, 5.0)}, tolerance=1e-4)
    assert error.value.time == pytest.approx(3.0 / 300.0, rel=0.05)


@pytest.mark.slow
def test_a_run_stops_where_a_body_swings_by_half_a_turn_across_a_torsion_spring():
    """The angle about the axis then goes round within a few steps, from where there is no way to tell it."""
    model = mv.Model("tumbling")
    model.add_body("ball", 1.0, (0.2, 0.2, 0.2))
    model.add_joint("centre", "spherical", "ground", "ball", (0, 0, 0))
    model.add_torsion_spring("coil", "ground", "ball", (1, 0, 0), 0.1)
    with pytest.raises(mv.errors.SimulationError, match="'coil' is turned so far") as error:
        model.simulate(np.linspace(0.0, 2.0, 21), initial={"centre.ry": (0.0, 2.0), "centre.rx": (0.0, 0.003)})
    assert error.value.time == pytest.approx(1.5, rel=1e-3)
