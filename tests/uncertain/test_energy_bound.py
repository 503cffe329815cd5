"""Bounds of mean squares by energy and dissipation: closed forms, samples of parameters, what has none."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation
from mbsvib.uncertain.rms_bound import energy_bound
from tests.random.scenes import oscillator

LIMITS = {"s.stiffness": 0.2, "s.damping": (1.0, 4.0), "b.mass": (1.8, 2.3)}


def bound(plant, output, **noise):
    filters = [(isolation.white(density) if isinstance(density, float) else density).filter for density in
               noise.values()]  # fmt: skip
    return energy_bound(plant.linear, plant.parameters, output, list(noise), filters)


def test_one_mode_reaches_its_bound():
    """S / (4 c k) and S / (4 c m) at the worst corner; a base acceleration is a force -m a, in the heaviest case."""
    plant = oscillator().linearize().uncertain(LIMITS)
    assert bound(plant, "x", F=3.0) == pytest.approx(3.0 / (4.0 * 640.0), rel=1e-8)
    assert bound(plant, "v", F=3.0) == pytest.approx(3.0 / (4.0 * 1.8), rel=1e-8)
    assert bound(plant, "x", base=3.0) == pytest.approx(2.3**2 * 3.0 / (4.0 * 640.0), rel=1e-8)


def test_filtered_noise_counts_with_its_highest_density():
    plant = oscillator().linearize().uncertain(LIMITS)
    band = isolation.shaped([10.0, 0.0], [1.0, 2.0, 400.0], 3.0)  # 10 s / (s^2 + 2 s + 400): 5 at 20 rad/s
    assert bound(plant, "x", F=band) == pytest.approx(25.0 * 3.0 / (4.0 * 640.0), rel=1e-6)


def test_a_hexapod_with_light_damping_has_a_bound_near_what_is_reached():
    stage = mv.library.cubic_hexapod(stiffness=2e5, damping=3.5)
    plant = stage.linearize().uncertain({"leg*.k.stiffness": 0.1, "platform.mass": (9.0, 12.0)})
    softest = plant.at(dict.fromkeys(list(plant.limits)[:6], 1.8e5)).rms("z", {"Fz": 1.0})["z"]
    assert bound(plant, "z", Fz=1.0) == pytest.approx(softest**2, rel=1e-8)
    several = bound(plant, "x", Fx=1.0, My=2.0)
    for case in plant.sample(5, seed=1):
        assert case.rms("x", {"Fx": 1.0, "My": 2.0})["x"] ** 2 < several < np.inf


@pytest.mark.slow
def test_lightly_damped_legs_have_a_worst_root_mean_square():
    plant = mv.library.cubic_hexapod(stiffness=2e5, damping=3.5).linearize().uncertain({"leg*.k.stiffness": 0.1})
    worst = plant.worst_rms("z", {"Fz": 1.0})
    assert worst.lower["z"] <= worst.upper["z"] <= 1.001 * worst.lower["z"]


def test_what_has_no_such_proof_is_infinite():
    """Accelerations, undamped and free mechanisms, forces across displacements, loops."""
    plant = oscillator().linearize().uncertain(LIMITS)
    assert bound(plant, "a", F=1.0) == np.inf
    assert bound(oscillator(c=1e-9).linearize().uncertain({"s.damping": (0.0, 1.0)}), "x", F=1.0) == np.inf
    assert bound(oscillator(k=1e-6).linearize().uncertain({"s.stiffness": (0.0, 1.0)}), "x", F=1.0) == np.inf
    loop = plant.feedback([[-1.0]], "v", "F")
    assert bound(loop, "x", F=1.0) == np.inf
    across = mv.System.from_matrices(np.eye(2), np.eye(2), [[4.0, 1.0], [-1.0, 4.0]], inputs=["F", "G"],
                                     outputs=["x", "y"], B=np.eye(2), Cq=np.eye(2))  # fmt: skip
    assert energy_bound(across, (), "x", ["F"], [isolation.white(1.0).filter]) == np.inf


def test_forces_of_uncertain_springs_are_bounded():
    """E[(k x)^2] = S k / (4 c) without the damper's part, convex in k: a bound above every sample."""
    model = oscillator()
    model.add_force_output("force", "s", "z")
    plant = model.linearize().uncertain(LIMITS)
    band = isolation.shaped([300.0], [1.0, 300.0], 3.0)
    worst = bound(plant, "force", F=band)
    assert all(case.rms("force", {"F": band})["force"] ** 2 < worst < np.inf for case in plant.sample(10, seed=0))
