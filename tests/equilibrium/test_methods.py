"""Model.equilibrium and Model.moved as users call them, on mechanisms with answers in closed form."""

import numpy as np
import pytest

import mbsvib as mv
from tests.equilibrium.test_search import G, check, pendulum, reloaded, truss


def hanging_chain(links=9, span=1.6):
    """Equal rods between two pins, folded upwards like an arch to begin with."""
    model = mv.Model("chain", gravity=G)
    turn = 2.0 * np.pi / 3.0  # of the arch
    at = np.linspace(-turn / 2, turn / 2, links + 1)
    pins = np.stack([np.sin(at), 0 * at, np.cos(at) - np.cos(turn / 2)], axis=1)
    pins *= span / (pins[-1, 0] - pins[0, 0])
    for i in range(links):
        a, b = pins[i : i + 2]
        tilt = -np.arctan2(b[2] - a[2], b[0] - a[0])
        model.add_body(f"rod{i}", 0.5, (0.0, 1e-3, 1e-3), (a + b) / 2, orientation=(0, tilt, 0))
        model.add_joint(f"pin{i}", "revolute", f"rod{i - 1}" if i else "ground", f"rod{i}", a, axis=(0, 1, 0))
    model.add_joint("last", "revolute", f"rod{links - 1}", "ground", pins[-1], axis=(0, 1, 0))
    return model


@pytest.mark.slow
def test_a_chain_hangs_in_its_catenary():
    model = hanging_chain()
    result = model.equilibrium(report=True)
    slope = []
    for body in result.model.bodies.values():
        along = np.array(body.orientation)[:, 0]
        slope.append(along[2] / along[0])
    # each rod's weight bends the line of thrust by the same step of its slope
    steps = np.diff(slope)
    assert steps == pytest.approx(np.full(8, steps.mean()), rel=1e-11)
    assert steps.mean() > 0
    assert slope[4] == pytest.approx(0.0, abs=1e-11)
    check(model, result)
    assert len(result.model.linearize().modes().frequencies) == 7


@pytest.mark.slow
def test_equilibrium_gives_a_model_and_leaves_the_old_one():
    model = pendulum(0.5)
    there = model.equilibrium()
    assert isinstance(there, mv.Model)
    assert there.gravity == model.gravity
    assert model.bodies["rod"].position[0] > 0.1
    assert there.equilibrium().bodies == there.bodies
    with pytest.raises(mv.EquilibriumError, match=r"Find the pose with model\.equilibrium"):
        model.linearize()
    with pytest.raises(mv.EquilibriumError, match="snap through"):
        truss(100.0).equilibrium()
    result = truss(100.0).equilibrium(snap=True, report=True)
    assert result.model.bodies["crown"].position[2] < 0
    assert result.iterations == len(result.residuals) - 1


def test_a_model_without_loads_is_where_it_is():
    model = mv.library.stewart()
    result = model.equilibrium(report=True)
    assert (result.iterations, result.residuals) == (0, (0.0,))
    assert result.model.bodies == model.bodies
    assert result.model.joints == model.joints
    assert np.array_equal(result.model.linearize().K, model.linearize().K)


def test_loops_may_be_cut_elsewhere():
    model = reloaded(mv.library.stewart(), (300.0, -200.0, -900.0))
    first = model.equilibrium()
    second = model.equilibrium(cut=[f"leg{i}.slide" for i in range(1, 6)])
    assert second.bodies["platform"].position == pytest.approx(first.bodies["platform"].position, abs=1e-14)


def test_a_massless_node_goes_to_where_its_springs_balance():
    model = mv.Model("node", gravity=G)
    model.add_body("mass", 2.0, (0.1, 0.1, 0.1), (0, 0, -1.0))
    model.add_body("node", 0.0, (0, 0, 0), (0, 0, -0.5))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(0, 0, 1))
    model.add_joint("rail2", "prismatic", "ground", "node", axis=(0, 0, 1))
    model.add_spring("upper", "ground", "node", (0, 0, 0), (0, 0, -0.5), 1000.0)
    model.add_spring("lower", "node", "mass", (0, 0, -0.5), (0, 0, -1.0), 3000.0)
    there = model.equilibrium()
    assert there.bodies["node"].position[2] == pytest.approx(-0.5 - 19.62 / 1000, abs=1e-14)
    assert there.bodies["mass"].position[2] == pytest.approx(-1.0 - 19.62 / 1000 - 19.62 / 3000, abs=1e-14)


def test_a_maxwell_element_gives_way_and_its_static_spring_does_not():
    def model(static):
        result = mv.Model("mount", gravity=G)
        result.add_body("mass", 2.0, (0.1, 0.1, 0.1), (0, 0, 1.0))
        result.add_joint("rail", "prismatic", "ground", "mass", axis=(0, 0, 1))
        result.add_spring("k", "ground", "mass", (0, 0, 0), (0, 0, 1.0), 1000.0)
        result.add_maxwell("m", "ground", "mass", (0, 0, 0), (0, 0, 1.0), 500.0, 10.0, static)
        return result

    there = model(0.0).equilibrium()
    assert there.linearize().dof == 2  # one of them massless
    assert there.springs["m"].end[2] == pytest.approx(1.0 - 19.62 / 1000, abs=1e-14)
    there = model(100.0).equilibrium()
    assert there.springs["m"].end[2] == pytest.approx(1.0 - 19.62 / 1100, abs=1e-14)
    assert there.springs["m"].preload == pytest.approx(-100 * 19.62 / 1100, rel=1e-12)


def test_parts_that_cannot_move_are_refused_by_name():
    model = mv.Model("mast")
    model.add_body("tip", 1.0, (0.1, 0.1, 0.1), (1.0, 0, 0))
    rod, steel = {"type": "circle", "radius": 0.02}, {"E": 2.1e11, "nu": 0.3, "rho": 7800}
    model.add_beam("tube", "ground", "tip", rod, steel, start=(0, 0, 0), end=(1.0, 0, 0))
    with pytest.raises(mv.ModelError, match=r"'tip\.x' is not a joint coordinate"):
        model.moved({"tip.x": 0.1})
    assert model.equilibrium(report=True).iterations == 0


def test_a_joint_without_words_for_the_pose_of_equilibrium_is_named():
    model = mv.Model("odd", gravity=G)
    model.add_body("part", 1.0, (0.1, 0.1, 0.1), (0.3, 0.1, 0))
    model.add_joint("odd", None, "ground", "part", (0.0, 0.0, 0.0), free=("y", "rx", "ry"))
    model.add_bushing("k", "ground", "part", (0.0, 0.0, 0.0), (100, 100, 100, 5, 5, 5))
    with pytest.raises(mv.ModelError, match="joint 'odd': its free rotations have turned"):
        model.equilibrium()


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("stiffness", [1e4, 1e9, 1e13])
def test_springs_too_stiff_for_positions_to_tell_their_force_balance_as_well(stiffness, free):
    model = mv.Model("press", gravity=G)
    model.add_body("die", 1.0, (0.1, 0.1, 0.1), (0.3, 0.1, 0.7))
    words = {"free_length": 0.7} if free else {}
    for i, (x, y) in enumerate(((0, 0), (1, 0), (0, 1))):
        model.add_bushing(f"k{i}", "ground", "die", (x, y, 0.7), (0.1 * stiffness, 0.1 * stiffness, 0, 0, 0, 0))
        model.add_spring(f"s{i}", "ground", "die", (x, y, 0), (x, y, 0.7), stiffness, **words)
    there = model.equilibrium()
    force = sum(spring.tension for name, spring in there.springs.items() if name[0] == "s")
    assert force == pytest.approx(-9.81, rel=1e-9)
    assert there.linearize().modes().frequencies[0] > 0
    assert there.equilibrium().springs == there.springs


def test_geared_pendulums_come_to_rest():
    model = mv.Model("geared", gravity=G)
    for name, x, mass in (("a", 0.0, 1.0), ("b", 1.0, 2.0)):
        model.add_body(name, mass, (0.01, 0.01, 0.01), (x + 0.5, 0, 0))
        model.add_joint(f"{name}.pin", "revolute", "ground", name, (x, 0, 0), axis=(0, -1, 0))
    model.add_gear("mesh", "a.pin", "b.pin", -3.0)
    there = model.equilibrium()
    position = [np.array(there.bodies[name].position) - (x, 0, 0) for name, x in (("a", 0.0), ("b", 1.0))]
    a = np.arctan2(position[0][2], position[0][0])
    assert np.cos(a) - 6.0 * np.cos(-3.0 * a) == pytest.approx(0.0, abs=1e-11)
    assert there.linearize().K[0, 0] > 0
    assert position[1] == pytest.approx((0.5 * np.cos(-3 * a), 0, 0.5 * np.sin(-3 * a)), abs=1e-12)


def test_rotors_keep_to_their_bodies():
    model = pendulum(0.5)
    model.add_rotor("wheel", "rod", speed=100.0, axis=(0, 0, 1), inertia=0.01)
    there = model.equilibrium()
    assert there.rotors["wheel"].axis == pytest.approx((np.sin(0.5), 0, np.cos(0.5)), abs=1e-13)


def test_a_quadruped_stands_on_its_feet():
    model = reloaded(mv.library.quadruped())
    there = model.equilibrium()
    weight = 9.81 * sum(body.mass for body in model.bodies.values())
    feet = [spring for name, spring in there.springs.items() if name.endswith(".foot")]
    assert len(feet) == 4
    carried = []
    for foot in feet:
        up = np.array(foot.orientation) @ foot.preload[:3]
        carried.append(up[2] if foot.first == "ground" else -up[2])
    assert sum(carried) == pytest.approx(weight, rel=1e-10)
    assert min(carried) > 0.1 * weight
    assert there.bodies["trunk"].position[2] < model.bodies["trunk"].position[2]
    plain, loaded = (m.linearize().modes().frequencies for m in (mv.library.quadruped(), there))
    assert np.abs(loaded - plain).max() > 1e-3
