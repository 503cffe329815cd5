"""Responses in the complex plane, and singular values."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import nyquist, singular_values


def test_a_lightly_damped_mode_is_a_circle(slider):
    """The velocity of a mass on a spring: a circle of diameter 1/c around 1/2c."""
    axes = nyquist(slider(damping=4.0), "v", "F").axes[0]
    x, y = axes.lines[0].get_data()
    assert "m/s" in axes.get_xlabel()
    scale = x.max() * 4.0
    np.testing.assert_allclose(np.hypot(x / scale - 0.125, y / scale), 0.125, rtol=1e-9)
    np.testing.assert_allclose(axes.lines[1].get_ydata(), -y)


def test_the_critical_point_where_there_is_no_unit(slider):
    assert any(line.get_marker() == "+" for line in nyquist(slider(damping=4.0), "a", "ax").axes[0].lines)
    assert not any(line.get_marker() == "+" for line in nyquist(slider(damping=4.0), "x", "F").axes[0].lines)


def test_singular_values_bound_every_direction():
    system = mv.library.build("stewart").linearize()
    axes = singular_values(system).axes[0]
    assert axes.get_ylabel() == "singular values [m/N]"
    assert axes.get_title(loc="left") == "Fx, Fy, Fz → x, y, z"
    x, top = axes.lines[0].get_data()
    lowest = axes.lines[2].get_ydata()
    G = system.frequency_response(2.0 * np.pi * x)[:3, :3]
    for way in (np.eye(3)[2], np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)):
        size = np.linalg.norm(np.einsum("ijk,j->ik", G, way), axis=0)
        assert (size <= top * (1 + 1e-9)).all()
        assert (size >= lowest * (1 - 1e-9)).all()


@pytest.mark.slow
def test_each_pair_of_units_has_a_panel_of_singular_values():
    system = mv.library.build("stewart").linearize()
    figure = singular_values(system)
    assert [axes.get_ylabel() for axes in figure.axes] == [
        f"singular values [{unit}]" for unit in ("m/N", "m/(N m)", "rad/N", "rad/(N m)")]  # fmt: skip
    assert [axes.get_title(loc="left") for axes in singular_values(system, "x", ["Fx", "Mx"]).axes] == [
        "Fx → x", "Mx → x"]  # fmt: skip
    x, largest = figure.axes[3].lines[0].get_data()
    G = system.frequency_response(2.0 * np.pi * x)[3:, 3:]
    np.testing.assert_allclose(largest, np.linalg.norm(np.moveaxis(G, 2, 0), 2, axis=(1, 2)), rtol=1e-9)


def test_singular_values_of_nothing():
    """No force along x moves what slides along y: a panel of zeros has limits and says so."""
    model = mv.Model("two")
    for name, axis in (("first", (1, 0, 0)), ("second", (0, 1, 0))):
        model.add_body(name, 1.0, (1, 1, 1))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name, axis=axis)
        model.add_spring(f"{name}.k", "ground", name, tuple(-x for x in axis), (0, 0, 0), 100.0, 1.0)
    model.add_input("F", "first", "x")
    model.add_output("y", "second", "y")
    axes = singular_values(model.linearize()).axes[0]
    assert axes.get_ylim() == (0.0, 1.0)
    assert [text.get_text() for text in axes.texts] == ["zero"]


def test_more_units_than_a_figure_holds_are_asked_for():
    model = mv.Model("many")
    model.add_body("body", 1.0, (1, 1, 1))
    model.add_bushing("mount", "ground", "body", (0, 0, 0), np.full(6, 1e3), np.full(6, 1.0))
    for direction in ("x", "rx"):
        model.add_input(f"u.{direction}", "body", direction)
        model.add_base_motion(f"floor.{direction}", direction)
        for quantity in ("displacement", "velocity", "acceleration"):
            model.add_output(f"{quantity}.{direction}", "body", direction, quantity=quantity)
    with pytest.raises(mv.ResponseError, match=r"24 pairs of units.*outputs=\['displacement.x'\]"):
        singular_values(model.linearize())
