"""Strips of mode shapes: what is drawn against the modes, pages, names."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection

import mbsvib as mv
from mbsvib.plots import mode_strips


def heights(axes):
    """Heights of bars, (directions, bodies)."""
    return np.array([[path.vertices[1, 1] for path in group.get_paths()]
                     for group in axes.collections if isinstance(group, PolyCollection)])  # fmt: skip


@pytest.mark.slow
def test_bars_are_the_displacements_of_the_bodies():
    system = mv.library.gripper().linearize()
    modes = system.modes()
    figure = mode_strips(system, radius=0.2)
    assert len(figure.axes) == len(modes)
    assert [text.get_text() for text in figure.axes[-1].get_xticklabels()] == list(modes.bodies)
    for k, axes in enumerate(figure.axes):
        shape = np.array([modes.body_shapes[name][:, k] for name in modes.bodies]).real
        expected = np.stack((shape[:, 0], shape[:, 1], 0.2 * shape[:, 5]))
        expected /= expected.flat[np.abs(expected).argmax()]
        drawn = heights(axes)
        assert np.allclose(drawn, expected)
        assert drawn.max() == pytest.approx(1.0)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["x", "y", "rz", "rotations × 0.2 m"]


@pytest.mark.slow
def test_titles_tell_frequency_and_damping():
    system = mv.library.stewart_isolator().linearize()
    first, *_, last = (axes.get_title(loc="left") for axes in mode_strips(system).axes)
    assert first == "mode 1: 9.576 Hz, damping ratio 8.36 %"
    assert last == "mode 12: 318.3 Hz, damping ratio 40 %"
    assert mode_strips(mv.library.gripper().linearize(), 2).axes[0].get_title(loc="left") == "mode 2: rigid-body mode"


def test_rotations_are_multiplied_by_the_radius_of_gyration():
    model = mv.Model("disc")
    model.add_body("disc", 2.0, (0.5, 0.5, 0.5))
    model.add_bushing("mount", "ground", "disc", position=(0.0, 0.0, 0.1), stiffness=(1e3, 2e3, 3e3, 50.0, 70.0, 90.0))
    figure = mode_strips(model.linearize())
    assert figure.legends[0].get_texts()[-1].get_text() == "rotations × 0.5 m"


def test_complex_shapes_are_drawn_in_phase_and_in_quadrature():
    system = mv.System.from_matrices(np.eye(2), np.diag([0.4, 0.0]), [[2.0, -1.0], [-1.0, 2.0]])
    modes = system.modes()
    assert np.abs(modes.shapes.imag).max() > 0.01
    for k, axes in enumerate(mode_strips(system).axes):
        drawn = heights(axes)[0].astype(complex)
        dashes = next(group for group in axes.collections if isinstance(group, LineCollection))
        for path in dashes.get_segments():
            drawn[round(float(path[:, 0].mean()))] += 1j * path[0, 1]
        shape = modes.shapes[:, k]
        assert abs(np.vdot(drawn, shape)) ** 2 == pytest.approx(np.vdot(drawn, drawn).real * np.vdot(shape, shape).real)
        assert abs((drawn**2).sum().imag) < 1e-9  # most nearly real


@pytest.mark.slow
def test_many_modes_take_pages_and_many_bodies_lines():
    system = mv.library.chain(30).linearize()
    first, last = mode_strips(system), mode_strips(system, page=3)
    assert (len(first.axes), len(last.axes)) == (12, 6)
    assert first.get_suptitle().endswith("page 1 of 3")
    assert last.axes[0].get_title(loc="left").startswith("mode 25: ")
    line = first.axes[0].lines[1]
    shape = np.array([system.modes().body_shapes[name][5, 0] for name in system.bodies])
    assert np.allclose(line.get_ydata(), shape / shape[np.abs(shape).argmax()])
    assert len(mode_strips(system.modes(), [3, 1]).axes) == 2


def test_names_do_not_overlap():
    figure = mode_strips(mv.library.stewart_isolator().linearize(), [1, 4])
    figure.canvas.draw()
    boxes = [label.get_window_extent() for label in figure.axes[-1].get_xticklabels()]
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i])
    legend, title = figure.legends[0].get_window_extent(), figure._suptitle.get_window_extent()
    assert not legend.overlaps(title)


def test_some_bodies():
    figure = mode_strips(mv.library.stewart_isolator().linearize(), 1, bodies="leg1.*")
    assert [text.get_text() for text in figure.axes[-1].get_xticklabels()] == ["leg1.lower", "leg1.upper"]


@pytest.mark.parametrize(("arguments", "words"), [
    ({"modes": 0}, "modes count from 1"), ({"modes": [5]}, "modes from 1 to 4"), ({"page": 2}, "pages 1 to 1"),
    ({"bodies": "wing"}, "body 'wing'"), ({"radius": 0.0}, "a length"),
])  # fmt: skip
def test_refusals(arguments, words):
    with pytest.raises(mv.ResponseError, match=words):
        mode_strips(mv.library.gripper().linearize(), **arguments)
    with pytest.raises(mv.ResponseError, match="expected a System"):
        mode_strips(mv.library.gripper())
