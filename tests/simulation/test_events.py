"""Events that end a run, against closed forms, and what is refused."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library

G = 9.81


def ball(height=2.0):
    """A free fall beside a spring that is not touched, so that all is in closed form."""
    model = mv.Model("ball", gravity=(0, 0, -G))
    model.add_body("ball", 0.5, (1e-3,) * 3, (0, 0, height))
    model.add_joint("rail", "prismatic", "ground", "ball", (0, 0, height), axis=(0, 0, 1))
    model.add_output("speed", "ball", "z", quantity="velocity")
    model.add_output("z", "ball", "z")
    return model


@pytest.mark.parametrize("count", [2, 9, 200])
def test_a_fall_ends_on_the_floor(count):
    run = ball().simulate(np.linspace(0.0, 3.0, count), until={"rail.z": -2.0})
    when = np.sqrt(2 * 2.0 / G)
    assert run.time[-1] == pytest.approx(when, rel=1e-9)
    assert run.coordinates["rail.z"][-1] == pytest.approx(-2.0, rel=1e-9)
    assert run["speed"][-1] == pytest.approx(-G * when, rel=1e-9)
    assert run.time[:-1] == pytest.approx(np.linspace(0.0, 3.0, count)[: len(run) - 1])
    assert (run.ended_by, run.complete) == ("rail.z", True)
    assert "ended by 'rail.z'" in repr(run)


def test_the_first_of_several_events_ends_the_run():
    until = {"rail.z": -2.0, "speed": -3.0, "z": -1.9}
    run = ball().simulate(np.linspace(0.0, 3.0, 7), until=until)
    assert run.ended_by == "speed"
    assert run.time[-1] == pytest.approx(3.0 / G, rel=1e-9)


def test_a_run_without_event_goes_on_to_its_end():
    run = ball().simulate([0.0, 0.1, 0.2], until={"z": -5.0})
    assert run.ended_by is None
    assert run.time.tolist() == [0.0, 0.1, 0.2]


def test_where_a_run_starts_is_no_event():
    """Thrown upwards from the value that ends it, the ball comes back to it."""
    run = ball().simulate(np.linspace(0.0, 3.0, 16), initial={"rail.z": (0.0, 4.0)}, until={"z": 0.0})
    assert run.time[-1] == pytest.approx(2 * 4.0 / G, rel=1e-9)


@pytest.mark.slow
def test_a_run_that_starts_next_to_an_event_goes_on_to_the_next_one():
    model, t = library.pendulum_chain(2), np.linspace(0.0, 4.0, 41)
    free = model.simulate(t, initial={"pin1.rz": 2.0})
    first = model.simulate(t, initial={"pin1.rz": 2.0}, until={"pin1.rz": 0.0})
    state = {name: (first.coordinates[name][-1], first.rates[name][-1]) for name in first.coordinates}
    second = model.simulate(t, initial=state, until={"pin1.rz": 0.0})
    assert first.time[-1] + second.time[-1] == pytest.approx(free.crossings("pin1.rz")[1], rel=1e-7)


def test_a_run_goes_on_where_another_one_ended():
    """Bounces, each a run of its own: the ball loses no height."""
    model, when, state = ball(), [], (0.0, 0.0)
    for _ in range(3):
        run = model.simulate(np.linspace(0.0, 5.0, 11), initial={"rail.z": state}, until={"rail.z": -2.0})
        when.append(run.time[-1])
        state = (-2.0, -run.rates["rail.z"][-1])
    fall = np.sqrt(2 * 2.0 / G)
    assert when == pytest.approx([fall, 2 * fall, 2 * fall], rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, pytest.param(41, marks=pytest.mark.slow)])
def test_rotation_vectors_are_counted_beyond_a_turn(count):
    """Also where there are many turns from one sample to the next."""
    model = mv.Model("top")
    model.add_body("top", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("ball", "spherical", "ground", "top", (0, 0, 0))
    run = model.simulate(np.linspace(0.0, 20.0, count), initial={"ball.rz": (0.0, 2.0)}, until={"ball.rz": 13.0})
    assert run.time[-1] == pytest.approx(6.5, rel=1e-9)
    assert run.coordinates["ball.rz"][-1] == pytest.approx(13.0, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("torque", [[0.0, 0.2], lambda t: 0.01 * (t + 20.0)], ids=["samples", "function"])
def test_a_torque_that_grows_over_many_turns(torque):
    """One interval is gone in parts, of which each has its part of the ramp from rest: J a = c (t + 20 s)."""
    model = mv.Model("top")
    model.add_body("top", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("ball", "spherical", "ground", "top", (0, 0, 0))
    model.add_input("torque", "top", "rz")
    run = model.simulate([-20.0, 0.0], {"torque": torque}, initial={"ball.rz": (0.3, 0.0)})
    expected = 0.3 + 0.1 * 20.0**3 / 6.0  # 21 turns between two samples
    assert run.coordinates["ball.rz"][-1] == pytest.approx(expected, rel=1e-7)
    assert run.rates["ball.rz"][-1] == pytest.approx(0.1 * 20.0**2 / 2.0, rel=1e-7)


def test_functions_are_resolved_between_samples():
    """m x'' = sin(w t) from rest: x = (t - sin(w t) / w) / (m w)."""
    model, w = mv.Model("slide"), 40.0
    model.add_body("b", 2.0, (0.1, 0.1, 0.1))
    model.add_joint("rail", "prismatic", "ground", "b", axis=(0, 0, 1))
    model.add_input("F", "b", "z")
    t = np.array([0.0, 0.4, 2.0])
    run = model.simulate(t, {"F": lambda t: np.sin(w * t)}, tolerance=1e-10)
    assert run.coordinates["rail.z"] == pytest.approx((t - np.sin(w * t) / w) / (2.0 * w), abs=1e-9)


@pytest.mark.slow
def test_a_force_ends_a_run_and_is_crossed():
    """A spring's force has no rate that is told: its crossing is bracketed."""
    model = mv.Model("oscillator")
    model.add_body("m", 2.0, (1, 1, 1), (0, 0, 1.0))
    model.add_joint("rail", "prismatic", "ground", "m", (0, 0, 1.0), axis=(0, 0, 1))
    model.add_spring("k", "ground", "m", (0, 0, 0), (0, 0, 1.0), 50.0)
    model.add_force_output("force", "k")
    t, omega = np.linspace(0.0, 2.0, 41), 5.0
    free = model.simulate(t, initial={"rail.z": 0.1})
    # the tension is 5 N cos(5 t)
    crossed = free.crossings("force", 2.0)
    first = np.arccos(0.4) / omega
    assert crossed == pytest.approx([first, 2 * np.pi / omega - first, 2 * np.pi / omega + first], rel=1e-7)
    ended = model.simulate(t, initial={"rail.z": 0.1}, until={"force": 2.0})
    assert ended.time[-1] == pytest.approx(first, rel=1e-7)
    assert ended["force"][-1] == pytest.approx(2.0, rel=1e-7)


@pytest.mark.slow
def test_a_linkage_with_inputs():
    """The same time as the crossing of a run that goes on, with functions of time as inputs."""
    model = library.four_bar()
    model.add_input("push", next(iter(model.bodies)), "x")
    name = "A.rz"
    words = {"t": np.linspace(0.0, 0.4, 21), "inputs": {"push": lambda t: 2.0 * np.sin(9.0 * t)}}
    free = model.simulate(**words)
    level = 0.5 * free.coordinates[name][8]
    run = model.simulate(**words, until={name: level})
    assert run.time[-1] == pytest.approx(free.crossings(name, level)[0], rel=1e-7)
    assert run.energy.balance == pytest.approx(np.zeros(len(run)), abs=1e-7 * np.ptp(run.energy.kinetic))


@pytest.mark.parametrize(
    ("until", "said"),
    [({"rail.x": 1.0}, r"until: 'rail.x' is neither a coordinate nor an output.*Did you mean 'rail.z'"),
     ({"z": "low"}, r"until\['z'\] = 'low'"), ({"z": np.nan}, r"until\['z'\] = nan"),
     ("z", "a mapping of coordinates")],
)  # fmt: skip
def test_mistakes_are_named(until, said):
    with pytest.raises(mv.ModelError, match=said):
        ball().simulate([0.0, 1.0], until=until)
