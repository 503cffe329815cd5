"""Root loci: the best gain and what it does to all that vibrates, against the damping of closed loops."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, plots
from tests.isolation.scenes import active_strut, stiff_isolator


def force_locus(plant, gains):
    return isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), gains)


def least(plant, gain):
    """The least damping ratio of a closed loop."""
    return plant.with_gains(isolation.force_feedback(plant, gain)).damping_ratios.min(initial=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("gains", [[0.0, 300.0], [0.0, 138.0, 145.0, 300.0], np.linspace(0.0, 1e3, 7)])
def test_the_best_gain_is_between_those_that_are_given(gains):
    """s (s^2 + W^2) + g (s^2 + z^2) is damped most at g = W sqrt(W / z), by (W - z) / 2 z."""
    plant = isolation.actuated(active_strut(), "payload", "leg", directions="z")
    locus = force_locus(plant, gains)
    assert locus.best() == pytest.approx((100 * np.sqrt(2), 0.5), rel=1e-5)
    assert locus.best(1) == pytest.approx((100 * np.sqrt(2), 0.5), rel=1e-5)
    assert [float(cell) for cell in locus.table()["rows"][0][4:]] == pytest.approx([50.0, 50.0], rel=1e-4)
    assert "least damping 0 % → 50 % at gain 141.4" in str(locus).replace("\n", " ").lower()


@pytest.mark.slow
def test_poles_of_the_controller_that_vibrate_count():
    """Where z < W / 3 the mode is overdamped for a while; then an integrator's pole swings with one of its own."""
    plant = isolation.actuated(active_strut(leg=9e4, beside=1e3), "payload", "leg", directions="z")
    locus = force_locus(plant, [0.0, 1e3, 2e3])
    gain, ratio = locus.best()
    assert ratio == pytest.approx(least(plant, gain), rel=1e-9)
    above = force_locus(plant, [0.0, 2000.0, 4000.0])
    assert above.damping_ratios[1, 0] < 1.0  # the pair is at the zero
    for gain in (1000.0, 1900.0, 3500.0):
        assert above.best()[1] >= least(plant, gain)
    overdamped = force_locus(plant, np.linspace(0.0, 300.0, 40))
    gain, ratio = overdamped.best()
    assert ratio == 1.0
    assert least(plant, gain * 1.001) == 1.0
    assert least(plant, gain * 0.999) < 1.0
    assert overdamped.summary() == ("least damping 0 % → overdamped", f"at gain {gain:.4g}")


@pytest.mark.slow
def test_modes_that_do_not_move_are_told_apart():
    """Legs spin at 637 Hz whatever their force does; the zeros of the platform are far below."""
    plant = isolation.actuated(stiff_isolator(torsion_stiffness=20.0), "platform", length=0.1)
    locus = force_locus(plant, np.linspace(0.0, 5e3, 6))
    gain, ratio = locus.best()
    loop = plant.with_gains(isolation.force_feedback(plant, gain))
    assert ratio == pytest.approx(np.sort(loop.damping_ratios)[6], rel=1e-6)
    first, second = locus.summary()
    assert first.startswith("least damping 0.245 % → ")
    assert second == f"at gain {gain:.4g}, the largest gain given; 6 of 12 modes hardly move: 0.5 %"
    assert plots.root_locus(locus).legends[0].get_title().get_text() == f"{first}\n{second}"
    rows = locus.table()["rows"]
    assert [row[3] for row in rows[:6]] == ["hardly moves"] * 6
    zeros = np.array([float(row[2]) for row in rows])
    assert np.allclose(zeros[:6], 636.6, atol=0.2)
    assert zeros[6:].max() < 40.0
    assert all(row[5] == "" for row in rows)  # critical damping is within reach, no other is promised


@pytest.mark.slow
def test_a_law_is_asked_when_the_locus_is_made():
    plant = isolation.actuated(active_strut(), "payload", "leg", directions="z")
    feed = {"law": isolation.force_feedback}
    locus = isolation.root_locus(plant, lambda g: feed["law"](plant, g), [0.0, 300.0])
    feed.clear()
    assert locus.best()[1] == pytest.approx(0.5, rel=1e-6)
    assert plots.root_locus(locus).axes


def test_controllers_keep_their_states():
    plant = isolation.actuated(active_strut(), "payload", "leg", directions="z")
    laws = (isolation.velocity_feedback, isolation.force_feedback)
    with pytest.raises(mv.ResponseError, match=r"2 states at the gain 0 and 3 at 100; expected .* the same states"):
        isolation.root_locus(plant, lambda g: laws[g > 0.0](plant, g), [0.0, 100.0])


def test_loops_that_are_never_stable_say_so():
    plant = isolation.actuated(active_strut(damping=1.0), "payload", "leg", directions="z")
    locus = isolation.root_locus(plant, lambda g: isolation.velocity_feedback(plant, -g), [10.0, 100.0])
    assert locus.summary()[0] == "not stable at any gain"
    assert locus.best()[1] == -np.inf
    assert locus.table()["rows"][0][3:5] == ("not stable", "")
    still = isolation.root_locus(plant, lambda g: isolation.velocity_feedback(plant, 0.0), [0.0, 100.0])
    assert still.summary() == ("no pole moves", "1 of 1 modes hardly move: 0.0417 %")
    assert plots.root_locus(still).axes
    with pytest.raises(mv.ResponseError):
        still.best(2)


def test_a_mode_beside_a_loop_that_is_never_stable_keeps_its_damping():
    model = active_strut(damping=1.0)
    model.add_body("other", 2.0, (0.1, 0.1, 0.1), (1, 0, 0.3))
    model.add_joint("rail", "prismatic", "ground", "other", axis=(0, 0, 1))
    model.add_spring("mount", "ground", "other", (1, 0, 0), (1, 0, 0.2), 800.0, 4.0)
    plant = isolation.actuated(model, "payload", "leg", directions="z")
    locus = isolation.root_locus(plant, lambda g: isolation.velocity_feedback(plant, -g), [10.0, 100.0])
    assert locus.best(1) == (10.0, pytest.approx(4.0 / (2.0 * np.sqrt(800.0 * 2.0)), rel=1e-9))
    assert locus.best(2)[1] == -np.inf
    assert locus.table()["rows"][0][3] == "hardly moves"
