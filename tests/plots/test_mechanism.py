"""The mechanism and its topology as drawings."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import mechanism, topology
from mbsvib.plots._projection import axes_of


@pytest.mark.parametrize("name", [*mv.library.models()])
def test_every_built_in_mechanism_has_a_picture(name):
    model = mv.library.build(name)
    axes = mechanism(model).axes[0]
    assert axes.get_title(loc="left") == model.name
    drawn = sum(len(item.get_segments()) for item in axes.collections if hasattr(item, "get_segments"))
    assert drawn > 0


def test_a_system_looks_like_its_model():
    model = mv.library.build("stewart")
    pictures = [mechanism(source, names=False).axes[0].collections[2].get_segments()
                for source in (model, model.linearize())]  # fmt: skip
    assert sorted(map(np.ndarray.tolist, pictures[0])) == sorted(map(np.ndarray.tolist, pictures[1]))


def test_bodies_are_named():
    texts = {text.get_text() for text in mechanism(mv.library.build("stewart")).axes[0].texts}
    assert {"platform", "leg1.upper", "leg6.lower"} <= texts


def test_views_look_along_their_axis():
    np.testing.assert_allclose(axes_of("x"), [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(axes_of("y"), [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-15)
    np.testing.assert_allclose(axes_of("z"), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], atol=1e-15)
    turned = axes_of((30.0, 40.0))
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-15)


def test_what_is_not_complete_is_drawn_too():
    model = mv.Model("sketch")
    mechanism(model)
    model.add_body("b", 1.0, (1, 1, 1), position=(0, 0, 1))
    assert "b" in {text.get_text() for text in mechanism(model).axes[0].texts}


def test_topology_shows_tree_cuts_and_springs():
    system = mv.library.build("stewart").linearize()
    axes = topology(system).axes[0]
    looks = [line.get_label() for line in axes.lines]
    assert looks.count("cut joint") == len(system.cut_joints) == 5
    assert looks.count("joint of the tree") == 13
    assert looks.count("spring or damper") == 6
    assert set(system.cut_joints) <= {text.get_text() for text in axes.texts}


def test_topology_shows_gears_and_couplers():
    """A train of gears does not fall apart into bodies that have nothing to do with each other."""
    model = mv.Model("train")
    for i in range(4):
        model.add_body(f"g{i}", 1.0, (1, 1, 1), position=(i, 0, 0))
        model.add_joint(f"j{i}", "revolute", "ground", f"g{i}", position=(i, 0, 0))
    model.add_gear("pair", "j0", "j1", ratio=-2.0)
    model.add_coupler("belt", {"j1": 1.0, "j2": 2.0, "j3": -1.0})
    axes = topology(model.linearize()).axes[0]
    assert [line.get_label() for line in axes.lines].count("gear or coupler") == 3
    assert {"pair", "belt"} <= {text.get_text() for text in axes.texts}
