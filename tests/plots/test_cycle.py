"""Figures of cycles."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library, plots

ANGLES = 2 * np.pi * np.arange(24) / 24


def test_several_cycles_in_the_same_panels():
    cycles = [model.cycle("crank.rz", ANGLES, speed=1.0) for model in (library.hoeken(), library.hoeken(angle=1.0))]
    torque, force, moment, hodograph = plots.cycle(cycles, labels=["a", "b"]).axes
    for k, cycle in enumerate(cycles):
        assert np.array_equal(torque.lines[k].get_ydata(), cycle.torque)
        assert np.allclose(torque.lines[k].get_xdata(), np.degrees(ANGLES))
        assert np.allclose(force.lines[k].get_ydata(), np.linalg.norm(cycle.shaking_force, axis=1))
        assert np.array_equal(moment.lines[k].get_ydata(), cycle.shaking_moment[:, 2])  # planar: with its sign
        assert np.array_equal(hodograph.lines[k].get_xydata()[:-1], cycle.shaking_force[:, :2])
    labels = [axes.get_ylabel() for axes in (torque, force, moment, hodograph)]
    assert labels == ["torque [N m]", "shaking force [N]", "shaking moment [N m]", "shaking force along y [N]"]
    assert moment.get_xlabel() == "crank.rz [deg]"


@pytest.mark.slow
def test_drives_of_a_robot():
    motion = {"joint1.rz": ([0, 1, 2], 1.0, 0.0), "joint2.rz": ([0, 1, 2], 1.0, 3.0)}
    axes = plots.cycle(library.six_link(joints="RRRRRR").cycle(
        motion=motion | {f"joint{i}.rz": (0.0, 0.0, 0.0) for i in range(3, 7)})).axes  # fmt: skip
    assert [text.get_text() for text in axes[0].get_legend().get_texts()] == [f"joint{i}.rz" for i in range(1, 7)]
    assert axes[2].get_xlabel() == "sample"
    slide = plots.cycle(library.toggle().cycle("rail.z", [0.0, -0.01], speed=0.1)).axes
    assert (slide[0].get_ylabel(), slide[2].get_xlabel()) == ("force of drive [N]", "rail.z [m]")


def test_mistakes():
    with pytest.raises(mv.errors.ResponseError, match=r"cycles = \[\]"):
        plots.cycle([])
    with pytest.raises(mv.errors.ResponseError, match="expected 1, one for each cycle"):
        plots.cycle(library.hoeken().cycle("crank.rz", ANGLES, speed=1.0), labels=["a", "b"])


@pytest.mark.slow
def test_multipliers_against_the_unit_circle():
    cycle = library.hoeken().cycle("crank.rz", 2 * np.pi * np.arange(128) / 128, speed=2 * np.pi)
    for stiffness, title, mark in ((0.2, "multipliers: stable", "o"), (0.3, "multipliers: unstable", "s")):
        data = cycle.periodic({"crank.rz": (stiffness, 1e-3)})
        frozen, circle = plots.periodic(data).axes
        assert np.allclose(frozen.lines[0].get_ydata(), np.abs(data.frozen[:, 0]) / (2 * np.pi))
        shown = np.concatenate([line.get_xydata() for line in circle.lines[1:]]) @ (1, 1j)
        assert np.allclose(np.sort_complex(shown), np.sort_complex(data.multipliers()))
        assert circle.get_title(loc="left") == title
        outside = [line.get_marker() for line in circle.lines[1:] if len(line.get_xdata())]
        assert mark in outside
