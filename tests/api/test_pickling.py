"""Results go to other processes and back, whatever was asked of them before."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from mbsvib import library


def sent(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("name", ["quarter_car", "cubic_hexapod"])
def test_a_system_after_its_sensitivities(name):
    system = library.build(name).linearize()
    before = system.mode_sensitivities().frequencies
    other = sent(system)
    assert_array_equal(other.mode_sensitivities().frequencies, before)
    assert_array_equal(other.K, system.K)
    parameter = next(iter(system.parameters))
    assert_array_equal(sent(system).mode_sensitivities([parameter]).frequencies,
                       system.mode_sensitivities([parameter]).frequencies)  # fmt: skip


@pytest.mark.slow
def test_a_run():
    pytest.importorskip("casadi")
    run = library.slider_crank().simulate(np.linspace(0.0, 0.1, 6), {"torque": lambda t: 0.1 * t})
    other = sent(run)
    assert repr(other) == repr(run)
    for mine, theirs in ((run.outputs, other.outputs), (run.coordinates, other.coordinates), (run.rates, other.rates)):
        assert list(mine) == list(theirs)
        for name in mine:
            assert_array_equal(theirs[name], mine[name])
    assert_array_equal(other.energy.kinetic, run.energy.kinetic)
    for name, (turned, shifted) in run.frames().items():
        assert_array_equal(other.frames()[name][0], turned)
        assert_array_equal(other.frames()[name][1], shifted)
    coordinate = next(iter(run.coordinates))
    middle = float(run.coordinates[coordinate][2:4].mean())
    assert_array_equal(other.crossings(coordinate, middle), run.crossings(coordinate, middle))
    with pytest.raises(TypeError):
        other.outputs["new"] = 0.0


@pytest.mark.slow
def test_a_cycle():
    pytest.importorskip("casadi")
    model = library.slider_crank()
    cycle = model.cycle("A.rz", np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False), speed=3.0)
    before = cycle.sensitivities().shaking_force
    other = sent(cycle)
    assert_array_equal(other.torque, cycle.torque)
    assert_array_equal(other.sensitivities().shaking_force, before)
    for name, wrench in cycle.reactions.items():
        assert_array_equal(other.reactions[name], wrench)
