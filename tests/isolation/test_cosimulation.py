"""Plant and controller as units, co-simulated: the same loop as here, and sampled loops at the same steps."""

import pytest

import mbsvib_export as mx
from mbsvib import isolation
from tests.isolation.scenes import active_strut

pytest.importorskip("fmpy")


@pytest.mark.slow
def test_largest_stable_steps_are_those_of_sampled_loops():
    plant = isolation.actuated(active_strut(damping=60.0), "payload", "leg", directions="z")
    law = isolation.velocity_feedback(plant, 500.0)
    check = mx.check_cosimulation(plant.system, law.state_space(), 1e-3, masters=("jacobi", "gauss-seidel"))
    loop = plant.with_gains(law)
    assert check.growth == pytest.approx(loop.poles().real.max(), rel=1e-9)
    assert all(item.difference < 1e-9 for item in check.masters)
    # one after the other the law acts on what it has just measured, both at once a step later
    for master, late in (("gauss-seidel", 0.0), ("jacobi", 1.0)):
        step = check[master].largest_stable_step
        for factor, stable in ((0.99, True), (1.01, False)):
            h = factor * step
            assert loop.sampled(1.0 / h, late * h).stable is stable, (master, factor)


@pytest.mark.slow
def test_force_feedback_as_units():
    plant = isolation.actuated(active_strut(damping=60.0), "payload", "leg", directions="z")
    law = isolation.force_feedback(plant, 140.0, leak=5.0)
    check = mx.check_cosimulation(plant.system, law.state_space(), 1e-3, masters="iteration", duration=0.128)
    assert check.growth == pytest.approx(plant.with_gains(law).poles().real.max(), rel=1e-9)
    assert check["iteration"].difference < 1e-9
    assert check["iteration"].order == pytest.approx(2.0, abs=0.2)
