"""The mechanism and its topology as drawings."""

import numpy as np
import pytest
from matplotlib.text import Text

import mbsvib as mv
from mbsvib.plots import mechanism, topology
from mbsvib.plots._projection import axes_of
from tests.support.sizes import few
from tests.support.slow_cases import some


@pytest.mark.slow
@pytest.mark.parametrize("name", some(mv.library.models(), "stewart", "rssr", "gripper", "puma", "quarter_car"))
def test_every_built_in_mechanism_has_a_picture(name):
    model = mv.library.build(name)
    axes = mechanism(model).axes[0]
    assert axes.get_title(loc="left") == model.name
    drawn = sum(len(item.get_segments()) for item in axes.collections if hasattr(item, "get_segments"))
    assert drawn > 0


@pytest.mark.slow
def test_a_system_looks_like_its_model():
    model = mv.library.build("stewart")
    pictures = [mechanism(source, names=False).axes[0].collections[2].get_segments()
                for source in (model, model.linearize())]  # fmt: skip
    assert sorted(map(np.ndarray.tolist, pictures[0])) == sorted(map(np.ndarray.tolist, pictures[1]))


@pytest.mark.slow
def test_bodies_are_named():
    texts = {text.get_text() for text in mechanism(mv.library.build("stewart")).axes[0].texts}
    assert {"platform", "leg1.upper", "leg6.lower"} <= texts
    named = {text.get_text() for text in mechanism(mv.library.build("stewart_isolator")).axes[0].texts}
    assert {"Fx, Mx", "Fy, My", "Fz, Mz"} <= named  # arrows that begin at the same place


def tree_of_26():
    """Bodies at places by chance, each on a bushing of an earlier one."""
    chance = np.random.default_rng(3)
    model, places = mv.Model("tree"), [np.zeros(3)]
    for i in range(26):
        base = int(chance.integers(0, i + 1))
        places.append(places[base] + chance.uniform(-0.2, 0.3, 3))
        model.add_body(f"branch{i}", 1.0, (0.1, 0.1, 0.1), position=places[-1])
        model.add_bushing(f"mount{i}", f"branch{base - 1}" if base else "ground", f"branch{i}", position=places[base],
                          stiffness=(1.0,) * 6)  # fmt: skip
    return model


LIBRARY = ("quadruped", "stanford", "seven_r", "puma", "singular_beam", "stewart_isolator", "engine_on_mounts",
           "gripper", "wafer_stage", "carpet_scraper")  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("dpi", some([60, 220], 60))
@pytest.mark.parametrize("make", [*few((getattr(mv.library, name) for name in LIBRARY), 6), tree_of_26,
                                  pytest.param(lambda: mv.library.tree(5), marks=pytest.mark.slow)])  # fmt: skip
def test_names_overlap_nothing(make, dpi):
    figure = mechanism(make())
    figure.set_dpi(dpi)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    boxes = {text: Text.get_window_extent(text) for text in axes.texts if text.get_text()}
    others = [figure.legends[0].get_window_extent(), axes._left_title.get_window_extent()]
    texts = list(boxes)
    for i, text in enumerate(texts):
        assert not any(boxes[text].overlaps(boxes[other]) for other in texts[:i]), text.get_text()
        assert not any(boxes[text].overlaps(box) for box in others), text.get_text()
        assert figure.bbox.x0 <= boxes[text].x0 < boxes[text].x1 <= figure.bbox.x1
    if len(texts) < 20:  # centres of marks are seen where there is room
        marks = np.concatenate([axes.transData.transform(line.get_xydata()) for line in axes.lines])
        assert not any(box.contains(*mark) for box in boxes.values() for mark in marks)


@pytest.mark.slow
def test_the_legend_explains_what_is_drawn():
    words = [text.get_text() for text in mechanism(mv.library.quadruped()).legends[0].get_texts()]
    assert words == ["body, centre of mass", "joint", "axis of a joint", "bushing",
                     "input (torque: two heads)", "ground"]  # fmt: skip
    loops = [text.get_text() for text in mechanism(mv.library.stewart_isolator()).legends[0].get_texts()]
    assert {"spring", "cut joint"} <= set(loops)


@pytest.mark.slow
def test_bushings_are_rings_around_joints():
    axes = mechanism(mv.library.quadruped()).axes[0]
    bushings, *others = sorted((line for line in axes.lines if len(line.get_xdata())), key=lambda line: -line.get_ms())
    assert len(bushings.get_xdata()) == 16
    joints = next(line for line in others if line.get_mfc() == "white")
    places = {tuple(place) for place in np.round(bushings.get_xydata(), 9).tolist()}
    assert {tuple(place) for place in np.round(joints.get_xydata(), 9).tolist()} <= places
    assert bushings.get_zorder() <= joints.get_zorder()
    assert bushings.get_ms() > 2.0 * joints.get_ms()
    assert axes.lines.index(bushings) < axes.lines.index(joints)


def test_inputs_are_arrows():
    model = mv.Model("push")
    model.add_body("b", 1.0, (1, 1, 1), position=(0, 0, 1))
    model.add_input("F", "b", "x")
    axes = mechanism(model, view="y").axes[0]
    head = next(item for item in axes.collections if item.get_zorder() == 3.5).get_segments()
    (sides,) = head
    np.testing.assert_allclose(sides[1], [0.0, 1.0], atol=1e-12)  # the tip is at the body, the sides are behind it
    assert (sides[[0, 2], 0] < 0.0).all()
    np.testing.assert_allclose(sides[0, 1] + sides[2, 1], 2.0)


def test_views_look_along_their_axis():
    np.testing.assert_allclose(axes_of("x"), [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(axes_of("y"), [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-15)
    np.testing.assert_allclose(axes_of("z"), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], atol=1e-15)
    turned = axes_of((30.0, 40.0))
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-15)


@pytest.mark.slow
def test_what_is_not_complete_is_drawn_too():
    model = mv.Model("sketch")
    mechanism(model)
    model.add_body("b", 1.0, (1, 1, 1), position=(0, 0, 1))
    assert "b" in {text.get_text() for text in mechanism(model).axes[0].texts}


@pytest.mark.slow
def test_topology_shows_tree_cuts_and_springs():
    system = mv.library.build("stewart").linearize()
    axes = topology(system).axes[0]
    looks = [line.get_label() for line in axes.lines]
    assert looks.count("cut joint") == len(system.cut_joints) == 5
    assert looks.count("joint of the tree") == 13
    assert looks.count("spring or damper") == 6
    assert set(system.cut_joints) <= {text.get_text() for text in axes.texts}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stewart_isolator", "stewart", "quadruped", "seven_r", "engine_on_mounts"])
def test_names_of_the_topology_do_not_overlap(name):
    figure = topology(mv.library.build(name).linearize())
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i])


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


def test_a_torsion_spring_stands_at_the_joint_of_its_bodies():
    from mbsvib.plots._scene import of_model, of_system

    model = mv.Model("crank")
    model.add_body("crank", 1.0, (1, 1, 1), position=(0.5, 0, 0))
    model.add_body("wheel", 1.0, (1, 1, 1), position=(0.7, 0, 0))
    model.add_joint("pin", "revolute", "ground", "crank", position=(0.1, 0.2, 0.3), axis=(0, 1, 0))
    model.add_torsion_spring("motor", "ground", "crank", axis=(0, 1, 0), stiffness=5.0)
    model.add_torsion_spring("belt", "ground", "wheel", axis=(0, 1, 0), stiffness=5.0)     # no joint between these
    system = model.linearize()
    for scene in (of_model(model), of_system(system.name, system.provenance)):
        rings = {mark.name: scene.points[mark.point].tolist() for mark in scene.marks if mark.kind == "bushing"}
        assert rings == {"motor": [0.1, 0.2, 0.3], "belt": [0.7, 0.0, 0.0]}


@pytest.mark.slow
def test_torques_have_two_heads():
    def heads(direction, view):
        model = mv.Model("bar")
        model.add_body("bar", 1.0, (1, 1, 1), position=(0.5, 0, 0))
        model.add_joint("pin", "revolute", "ground", "bar", position=(0, 0, 0), axis=(0, 1, 0))
        model.add_input("u", "bar", direction)
        drawn = mechanism(model, view)
        words = {text.get_text() for text in drawn.legends[0].get_texts()}
        polylines = [segment for item in drawn.axes[0].collections if hasattr(item, "get_segments")
                     for segment in item.get_segments() if len(segment) == 3]  # fmt: skip
        return polylines, words

    (force,), words = heads("z", "y")
    assert "input" in words
    np.testing.assert_allclose(force[1], (0.5, 0.0), atol=1e-12)  # its point is where the force acts
    (first, second), words = heads("rx", "y")
    assert "input (torque: two heads)" in words
    np.testing.assert_allclose(second[1], (0.5, 0.0), atol=1e-12)
    assert first[1][0] < second[1][0]  # along x, one behind the other
    assert first[1][1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "view"), [("quarter_car", "y"), ("four_bar", "z")])
def test_slim_mechanisms_leave_the_corner_to_the_directions(name, view):
    axes = mechanism(mv.library.build(name), view).axes[0]
    sizes = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    assert min(sizes) == pytest.approx(0.5 * max(sizes))


@pytest.mark.slow
def test_the_legend_names_the_families_that_occur():
    model = mv.Model("bench")
    model.add_body("mass", 1.0, (1.0, 1.0, 1.0), position=(1.0, 0, 0))
    model.add_beam("arm", "ground", "mass", {"type": "circle", "radius": 0.01}, {"E": 7e10, "nu": 0.3, "rho": 2700.0},
                   (0, 0, 0), (1.0, 0, 0), elements=2)  # fmt: skip
    model.add_torsion_spring("twist", "ground", "mass", (1, 0, 0), stiffness=1.0)
    words = [text.get_text() for text in mechanism(model).legends[0].get_texts()]
    assert {"beam", "torsion spring"} <= set(words)
    model.add_bushing("mount", "ground", "mass", (1.0, 0, 0), (1, 1, 1, 0, 0, 0))
    assert "torsion spring, bushing" in [text.get_text() for text in mechanism(model).legends[0].get_texts()]
