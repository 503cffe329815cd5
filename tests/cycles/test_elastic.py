"""Beams over a cycle: closed forms, rigid limits, balances of energy and force, and the steady state of a run."""

import numpy as np
import pytest

import mbsvib as mv

E, RHO, CRANK, ROD, WIDTH, HEIGHT = 2.1e11, 7800.0, 0.1, 0.4, 0.006, 0.02
STEEL = {"E": E, "nu": 0.3, "rho": RHO}
PIN = CRANK * np.array([np.cos(0.7), np.sin(0.7), 0.0])
WRIST = np.array([PIN[0] + np.sqrt(ROD**2 - PIN[1] ** 2), 0.0, 0.0])


def turn(samples):
    return 2.0 * np.pi * np.arange(samples) / samples


def crank_and_slider(inertia=1e-3):
    model = mv.Model("slider crank")
    model.add_body("arm", mass=1.0, inertia=(inertia,) * 3, position=(0, 0, 0))
    model.add_body("block", mass=0.5, inertia=(1e-4,) * 3, position=WRIST)
    model.add_joint("crank", "revolute", "ground", "arm", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("slide", "prismatic", "ground", "block", WRIST, axis=(1, 0, 0))
    return model


def joined(model, first, last):
    model.add_joint("pin", "revolute", "arm", first, PIN, axis=(0, 0, 1))
    model.add_joint("wrist", "revolute", last, "block", WRIST, axis=(0, 0, 1))
    return model


def slider_crank(stiffer=1.0, beta=0.0, inertia=1e-3, elements=2):
    model = crank_and_slider(inertia)
    section = {"type": "rectangle", "width": WIDTH, "height": HEIGHT}
    model.add_beam("rod", None, None, section, {**STEEL, "E": stiffer * E},
                   start=PIN, end=WRIST, elements=elements, beta=beta)  # fmt: skip
    return joined(model, "rod.0", f"rod.{elements}")


def blade(elements=8, beta=0.0, gravity=(0, -9.81, 0), second_order=False):
    model = mv.Model("blade", gravity=gravity)
    model.add_body("hub", mass=1.0, inertia=(1e-3,) * 3, position=(0, 0, 0))
    model.add_joint("pivot", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 0, 1))
    model.add_beam("wing", "hub", None, {"type": "rectangle", "width": 0.01, "height": 0.01}, STEEL, start=(0, 0, 0),
                   end=(1, 0, 0), elements=elements, beta=beta, second_order=second_order)  # fmt: skip
    return model


def sag(cycle, node):
    """Displacement of a node across the turning line."""
    angle, at = cycle.angles, cycle.positions[node]
    return -np.sin(angle) * at[:, 0] + np.cos(angle) * at[:, 1]


@pytest.mark.slow
def test_a_cantilever_that_turns_in_gravity():
    """EI w'''' - 2 W^2 rho A w = -rho A g cos W t without tension: inertia and centrifugal force add up."""
    speed, inertia, area, n = 5.0, 0.01**4 / 12, 0.01**2, 12
    k, mean = (2 * speed**2 * RHO * area / (E * inertia)) ** 0.25, 9.81 / (2 * speed**2)
    clamped_and_free = [[1, 0, 1, 0], [0, 1, 0, 1], [-np.cos(k), -np.sin(k), np.cosh(k), np.sinh(k)],
                        [np.sin(k), -np.cos(k), np.sinh(k), np.cosh(k)]]  # fmt: skip
    shape = np.linalg.solve(clamped_and_free, [-mean, 0, 0, 0])
    tip = mean + shape @ [np.cos(k), np.sin(k), np.cosh(k), np.sinh(k)]
    cycle = blade().cycle("pivot.rz", turn(n), speed=speed)
    assert sag(cycle, "wing.8") == pytest.approx(tip * np.cos(turn(n)), abs=5e-5 * abs(tip))
    weight = (1 + RHO * area) * 9.81
    assert cycle.reactions["pivot"][:, :3] + cycle.shaking_force == pytest.approx(
        np.tile([0, weight, 0], (n, 1)), abs=1e-10)  # fmt: skip


@pytest.mark.slow
def test_damping_of_the_beam_takes_the_power_of_the_drive():
    """Gravity bends a blade that turns to and fro in its own frame: the drive supplies what this dissipates."""
    speed, n = 5.0, 12
    free = blade(2).cycle("pivot.rz", turn(n), speed=speed)
    assert abs(free.torque.mean()) < 1e-11 * np.abs(free.torque).max()
    damped = blade(2, beta=1e-3).cycle("pivot.rz", turn(n), speed=speed)
    assert damped.torque.mean() > 1e-6 * np.abs(damped.torque).max()


def middle_of_rod(cycle, elements):
    """Displacement of the middle of the rod across its line, and what the load -rho A a makes it statically."""
    start, end = cycle.positions["rod.0"], cycle.positions[f"rod.{elements}"]
    along = (end - start) / ROD
    across = np.stack((-along[:, 1], along[:, 0], np.zeros(len(along))), axis=1)
    middle = ((cycle.positions[f"rod.{elements // 2}"] - 0.5 * (start + end)) * across).sum(axis=1)
    mean = 0.5 * (cycle.body_accelerations["rod.0"] + cycle.body_accelerations[f"rod.{elements}"])[:, :3]
    load = -RHO * WIDTH * HEIGHT * (mean * across).sum(axis=1)
    return middle, 5 * load * ROD**4 / (384 * E * HEIGHT * WIDTH**3 / 12)


@pytest.mark.slow
def test_a_slow_rod_bends_by_its_inertia():
    """A bar on two pins under a load that is linear over it: 5 q l^4 / 384 EI at its middle.

    Nodes of a frame that turns have no moments of the centripetal load, so that it takes 1 / elements^2 to converge.
    """
    coarse, fine = (middle_of_rod(slider_crank(elements=n).cycle("crank.rz", turn(32), speed=1.0), n) for n in (2, 4))
    largest = np.abs(fine[1]).max()
    assert fine[0] == pytest.approx(fine[1], abs=0.02 * largest)
    assert (4 * fine[0] - coarse[0]) / 3 == pytest.approx(fine[1], abs=2e-4 * largest)


def stiff_and_rigid():
    """The cycles of a rod that does not bend and of a rigid body."""
    n, speed, mass = 24, 30.0, RHO * WIDTH * HEIGHT * ROD
    axis, across = (WRIST - PIN) / ROD, mass * ROD**2 / 12
    tensor = across * (np.eye(3) - np.outer(axis, axis))
    rigid = crank_and_slider()
    rigid.add_body("rod", mass=mass, position=(PIN + WRIST) / 2,
                   inertia=(tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], 0, 0))  # fmt: skip
    known = joined(rigid, "rod", "rod").cycle("crank.rz", turn(n), speed=speed, about=(0.1, 0.2, 0.0))
    return slider_crank(1e6).cycle("crank.rz", turn(n), speed=speed, about=(0.1, 0.2, 0.0)), known


@pytest.mark.slow
def test_a_stiff_rod_is_a_rigid_body():
    cycle, known = stiff_and_rigid()
    for values, reference in ((cycle.torque, known.torque), (cycle.shaking_force, known.shaking_force)):
        assert values == pytest.approx(reference, abs=1e-7 * np.abs(reference).max())
    # the moment lacks the rotary inertia of the section, as its beam does
    assert cycle.shaking_moment == pytest.approx(known.shaking_moment, abs=1e-6 * np.abs(known.shaking_moment).max())
    for joint in ("pin", "wrist", "slide"):
        assert cycle.reactions[joint][:, :2] == pytest.approx(known.reactions[joint][:, :2], abs=1e-4)


@pytest.mark.slow
def test_the_steady_state_of_a_run():
    """A heavy flywheel holds the speed; what was bent at the start has decayed after six turns."""
    n, speed = 32, 75.0
    words = {"beta": 4e-4, "elements": 4}
    cycle = slider_crank(**words).cycle("crank.rz", turn(n), speed=speed)
    t = (12.0 * np.pi + turn(n)) / speed
    run = slider_crank(**words, inertia=1e7).simulate([0.0, *t], initial={"crank.rz": (0, speed)}, tolerance=1e-8)
    for name in ("rod.fixed_mode1", "rod.fixed_mode2", "slide.z"):
        values = np.asarray(run.coordinates[name])[1:]
        assert values == pytest.approx(cycle.coordinates[name], abs=1e-6 * np.abs(values).max())


@pytest.mark.slow
def test_a_drive_that_swings():
    """Two ways to say the same period; and forces on the ground that are those of the momentum."""
    n, w = 32, 20.0
    t = turn(n) / w
    swing = {"crank.rz": (0.4 * np.sin(w * t), 0.4 * w * np.cos(w * t), -0.4 * w**2 * np.sin(w * t))}
    cycle = slider_crank().cycle(motion=swing, period=2 * np.pi / w)
    ground = sum(cycle.reactions[joint][:, :3] for joint in ("crank", "slide"))
    assert ground == pytest.approx(-cycle.shaking_force, abs=1e-8 * np.abs(ground).max())
    twice = {name: tuple(np.tile(part, 2) for part in three) for name, three in swing.items()}
    again = slider_crank().cycle(motion=twice, period=4 * np.pi / w)
    assert again.torque[:n] == pytest.approx(cycle.torque, abs=1e-9 * np.abs(cycle.torque).max())


@pytest.mark.slow
def test_a_superelement_that_turns_is_stretched():
    """A mass m on a spring k at the radius R: m W^2 R / (k - m W^2)."""
    radius, speed, k = 0.3, 10.0, 1000.0
    model = mv.Model("governor")
    model.add_body("hub", mass=1.0, inertia=(1.0,) * 3, position=(0, 0, 0))
    model.add_joint("pivot", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 0, 1))
    mass, stiffness = np.diag([0.0] * 6 + [1.0] * 6), np.kron([[1, -1], [-1, 1]], k * np.eye(6))
    place = (radius, 0, 0)
    model.add_superelement("spring", mass, None, stiffness, {"a": place, "b": place}, {"a": "hub"})
    cycle = model.cycle("pivot.rz", turn(8), speed=speed)
    stretched = np.linalg.norm(cycle.positions["spring.b"], axis=1) - radius
    assert stretched == pytest.approx(np.full(8, speed**2 * radius / (k - speed**2)), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["block.mass", "pin.position.x", "pin.position.z", "spring.damping"])
def test_derivatives_are_those_of_cycles_with_other_values(name):
    """Also to the height of a pin, as which the rod bends out of the plane of the mechanism."""
    model, words = slider_crank(beta=1e-4), {"speed": 30.0, "about": (0.0, 0.0, 0.0)}
    model.add_spring("spring", "ground", "block", (1.0, 0.1, 0.05), WRIST, stiffness=2e3, damping=5.0)
    cycle, value, step = model.cycle("crank.rz", turn(24), **words), model.parameters[name], 1e-5
    slopes = cycle.sensitivities(name)
    more, less = (model.with_values({name: value + sign * step}).cycle("crank.rz", turn(24), **words)
                  for sign in (1.0, -1.0))  # fmt: skip
    pairs = [(getattr(slopes, key)[0], getattr(more, key), getattr(less, key))
             for key in ("torque", "shaking_force", "shaking_moment")]  # fmt: skip
    pairs += [(slopes.reactions[joint][0], more.reactions[joint], less.reactions[joint]) for joint in model.joints]
    differences = [(high - low) / (2.0 * step) for _, high, low in pairs]
    size = max(np.abs(difference).max() for difference in differences)
    for (slope, _, _), difference in zip(pairs, differences, strict=True):
        assert slope == pytest.approx(difference, abs=1e-6 * size)


@pytest.mark.slow
def test_the_periodic_equations_of_a_blade_are_those_on_a_hub():
    """As published for speed 6: Wright et al. (1982), 7.3604; both converge, the frame that turns by 1 / elements^2."""
    unit = np.sqrt(E * 0.01**2 / 12.0 / RHO)
    flapping = []
    for elements in (2, 4):
        cycle = blade(elements, gravity=None, second_order=True).cycle("pivot.rz", turn(8), speed=6.0 * unit)
        periodic = cycle.periodic([])
        flapping.append(np.sort(np.abs(periodic.frozen[3]))[2] / unit)
        assert periodic.unresolved < 1e-9
    assert (4.0 * flapping[1] - flapping[0]) / 3.0 == pytest.approx(7.3604, rel=1e-3)
    assert [name.partition(".")[0] for name in periodic.coordinates] == ["wing"] * 24


@pytest.mark.slow
def test_the_multipliers_of_a_blade_are_those_of_constant_coefficients():
    """exp(l T) with the eigenvalues l of the equations, which do not vary; the drive is free to turn."""
    cycle = blade(1, beta=1e-3, gravity=None, second_order=True).cycle("pivot.rz", turn(8), speed=40.0)
    periodic = cycle.periodic({"pivot.rz": (30.0, 1.0)})
    found, expected = periodic.multipliers(), np.exp(periodic.frozen[0] * periodic.period)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(expected), abs=1e-8)
    assert periodic.stable


@pytest.mark.slow
def test_the_periodic_equations_of_a_stiff_rod_are_those_of_a_rigid_body():
    stiff, rigid = (cycle.periodic({"crank.rz": (3.0, 0.2)}) for cycle in stiff_and_rigid())
    for key in ("M", "C", "K"):
        reference = getattr(rigid, key)[:, 0, 0]
        assert getattr(stiff, key)[:, 0, 0] == pytest.approx(reference, abs=1e-6 * np.abs(reference).max())


def test_samples_that_are_no_period():
    with pytest.raises(mv.ModelError, match=r"not evenly spread over one turn"):
        blade(1).cycle("pivot.rz", [0.0, 1.0], speed=1.0)


@pytest.mark.slow
def test_what_a_bending_machine_does_not_have():
    with pytest.raises(mv.ModelError, match=r"cycle: the motion of 'slider crank' does not repeat after 1 s"):
        slider_crank().cycle("crank.rz", turn(8), speed=1.0, period=1.0)
    with pytest.warns(mv.errors.AccuracyWarning, match=r"8 samples leave .* take more"):
        cycle = slider_crank().cycle("crank.rz", turn(8), speed=1.0)
    with pytest.raises(mv.ModelError, match=r"'rod.rho' cannot be a symbol in finite motion"):
        cycle.sensitivities("rod.rho")
    with pytest.raises(mv.ModelError, match=r"period = 1.*expected 6.28319 s, over which its beams bend"):
        cycle.periodic(period=1.0)
    with pytest.raises(mv.ModelError, match=r"no periodic motion of 'rod' was found"):
        slider_crank(1e-3).cycle("crank.rz", turn(16), speed=30.0)


@pytest.mark.slow
def test_each_drive_has_to_repeat():
    """A table that moves by 1 um over two turns of a hub at 100 rad/s does not, over one turn."""
    speed, angle, size = 100.0, turn(8), 1e-6
    model = blade(1, gravity=None)
    model.add_body("table", mass=1.0, inertia=(1e-3,) * 3, position=(2, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "table", (2, 0, 0), axis=(0, 0, 1))
    steady = (angle, np.full(8, speed), np.zeros(8))

    def moved(harmonic):
        w = harmonic * speed
        at = harmonic * angle
        return size * np.sin(at), size * w * np.cos(at), -size * w**2 * np.sin(at)

    cycle = model.cycle(motion={"pivot.rz": steady, "rail.z": moved(1)}, period=2 * np.pi / speed)
    assert cycle.torques["rail.z"] == pytest.approx(-size * speed**2 * np.sin(angle))
    with pytest.raises(mv.ModelError, match=r"cycle: the motion of 'blade' does not repeat after 0\.0628319 s"):
        model.cycle(motion={"pivot.rz": steady, "rail.z": moved(0.5)}, period=2 * np.pi / speed)
