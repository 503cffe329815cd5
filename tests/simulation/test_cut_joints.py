"""Coordinates of joints at which loops are cut: in runs, their crossings, events, and where runs start."""

import casadi as ca
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library
from mbsvib.finite_motion.joints import coordinates, displacement
from mbsvib.finite_motion.numbers import Numbers


def turning():
    """A four-bar that turns over some times."""
    return library.four_bar().simulate(np.linspace(0.0, 0.5, 11), initial={"A.rz": (0.0, 40.0)})


@pytest.mark.slow
def test_angles_of_a_four_bar_add_up_to_zero_over_whole_turns():
    run = turning()
    assert run.trace.cut.names == ("C.rz",)
    angles, rates = (np.array([part[f"{name}.rz"] for name in "ABCD"]) for part in (run.coordinates, run.rates))
    assert np.ptp(angles[0]) > 4.0 * np.pi
    np.testing.assert_allclose(angles.sum(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(rates.sum(axis=0), 0.0, atol=1e-8 * np.abs(rates).max())
    # what is passed at whole turns is passed there by all
    at = run.crossings("C.rz", float(run.coordinates["C.rz"][5]))
    assert np.abs(at - run.time[5]).min() < 1e-9


@pytest.mark.slow
def test_a_joint_that_is_displaced_is_in_the_tree():
    """The same motion, started by the rate of any joint of the loop."""
    run = turning()
    for name in ("C.rz", "D.rz", "B.rz"):
        other = library.four_bar().simulate(run.time, initial={name: (0.0, float(run.rates[name][0]))})
        assert name in other.trace.session.names
        for joint in "ABCD":
            np.testing.assert_allclose(other.coordinates[f"{joint}.rz"], run.coordinates[f"{joint}.rz"], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("digits", "atol"), [(17, 1e-10), (8, 1e-6)])
def test_all_joints_of_a_loop_may_be_displaced_where_they_agree(digits, atol):
    """The state of another run, also as it is printed; what does not agree is refused, displacements and rates."""
    t = [0.0, 0.02]
    run = library.four_bar().simulate(t, initial={"A.rz": (0.3, 2.0)})
    start = {name: tuple(float(f"{part[name][0]:.{digits}g}") for part in (run.coordinates, run.rates))
             for name in run.coordinates}  # fmt: skip
    again = library.four_bar().simulate(t, initial=start)
    for name in start:
        np.testing.assert_allclose(again.coordinates[name], run.coordinates[name], atol=atol)
        np.testing.assert_allclose(again.rates[name], run.rates[name], atol=atol)
    place, rate = start["B.rz"]
    with pytest.raises(mv.ModelError, match=r"loops cannot be closed with A\.rz = 0\.3, B\.rz = "):
        library.four_bar().simulate(t, initial=start | {"B.rz": (place + 1e-4, rate)})
    with pytest.raises(mv.ModelError, match=r"loops do not allow these rates of A\.rz, B\.rz"):
        library.four_bar().simulate(t, initial=start | {"B.rz": (place, rate + 1e-3)})


@pytest.mark.slow
def test_a_slider_at_which_the_loop_is_cut():
    t = np.linspace(0.0, 0.4, 9)
    run = library.slider_crank().simulate(t, initial={"A.rz": (0.0, 10.0)})
    start = {name: (0.0, float(run.rates[name][0])) for name in ("A.rz", "B.rz", "C.rz")}
    cut = library.slider_crank().simulate(t, initial=start)
    assert cut.trace.cut.names == ("rail.z",)
    np.testing.assert_allclose(cut.coordinates["rail.z"], run.coordinates["rail.z"], atol=1e-8)
    np.testing.assert_allclose(cut.rates["rail.z"], run.rates["rail.z"], atol=1e-7)
    level = float(run.coordinates["rail.z"][5])
    ended = library.slider_crank().simulate(t, initial=start, until={"rail.z": level})
    assert ended.time[-1] == pytest.approx(run.crossings("rail.z", level)[0], rel=1e-7)


@pytest.mark.slow
def test_a_run_starts_with_rates_of_all_joints_of_a_loop():
    run, model = turning(), library.four_bar()
    state = {name: (0.0, float(rates[0])) for name, rates in run.rates.items()}
    on = model.simulate(run.time[:3], initial=state)
    for name in state:
        np.testing.assert_allclose(on.rates[name], run.rates[name][:3], atol=1e-5)
    state["C.rz"] = (0.0, 1.01 * state["C.rz"][1])
    with pytest.raises(mv.ModelError, match=r"C\.rz is .* leave out one of them"):
        model.simulate([0.0, 0.1], initial=state)


@pytest.mark.slow
def test_a_run_starts_with_all_coordinates_of_a_cut_joint():
    """The loop of a four-bar is cut at a joint that also slides."""
    model = library.four_bar()
    at = model.joints["C"].position
    model = model.with_parts(joints={name: joint for name, joint in model.joints.items() if name != "C"})
    model.add_joint("C", "cylindrical", "coupler", "rocker", at, axis=(0, 1, 0))
    run = model.simulate([0.0, 1e-3], initial={"A.rz": (0.0, 2.0)})
    state = {name: (0.0, float(run.rates[name][0])) for name in run.coordinates}
    assert {"C.z", "C.rz"} <= set(state)
    on = model.simulate([0.0, 1e-3], initial=state)
    for name in run.coordinates:
        assert on.coordinates[name] == pytest.approx(run.coordinates[name], abs=1e-9)
    for name in ("C.z", "C.rz"):
        with pytest.raises(mv.ModelError, match=rf"{name} is .* leave out one of them"):
            model.simulate([0.0, 1e-3], initial=state | {name: (0.0, state[name][1] + 1e-2)})


KINDS = {"revolute": {"axis": (0.3, -0.5, 0.8)}, "prismatic": {"axis": (1, 2, 3)}, "cylindrical": {"axis": (1, 2, 3)},
         "universal": {"axis": (1, 2, 3), "axis2": (0, 3, -2)}, "planar": {"axis": (1, 2, 3)},
         "screw": {"axis": (1, 2, 3), "pitch": 0.02}}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_coordinates_follow_from_the_displacement(kind):
    """Joint coordinates to a displacement and back."""
    model = mv.Model()
    for body in ("a", "b"):
        model.add_body(body, 1.0, (1, 1, 1))
    model.add_joint("j", kind, "a", "b", (0.1, 0.2, 0.3), **KINDS[kind])
    joint, numbers = model.joints["j"], Numbers(model)
    values = np.random.default_rng(3).uniform(-1.5, 1.5, len(joint.freedom))
    q = ca.SX.sym("q", len(values))
    back = coordinates(joint, numbers, displacement(joint, numbers, q))
    assert [name for name, _ in back] == [name for name, _ in joint.freedom]
    result = ca.Function("back", [q], [ca.vertcat(*(value for _, value in back))])(values)
    np.testing.assert_allclose(np.asarray(result)[:, 0], values, atol=1e-12)
