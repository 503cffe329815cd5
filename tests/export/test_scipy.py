"""scipy.signal: the same matrices, and exact responses in time."""

import numpy as np
import pytest
from scipy import signal

import mbsvib as mv
import mbsvib_export as mx
from tests.export.plants import same_bits, slider, stewart


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_matrices_are_those_of_the_state_space(realization):
    space = stewart().state_space(realization)
    for plant in (mx.to_scipy(stewart(), realization), mx.to_scipy(space)):
        assert isinstance(plant, signal.StateSpace)
        assert plant.dt is None
        assert all(same_bits(getattr(plant, key), getattr(space, key)) for key in "ABCD")


def test_lsim_agrees_with_the_time_response():
    system = stewart()
    t = 1e-4 * np.arange(50)
    u = np.random.default_rng(2).normal(size=(len(system.inputs), len(t)))
    exact = system.time_response(t, u, hold="first")
    _, y, _ = signal.lsim(mx.to_scipy(system), u.T, t)
    assert np.all(np.abs(y.T - exact).max(axis=1) < 1e-10 * np.abs(exact).max(axis=1))


def test_discretised_poles():
    sampled = mx.to_scipy(slider()).to_discrete(1e-3)
    expected = np.exp(1e-3 * slider().modes().eigenvalues)
    assert np.sort_complex(np.linalg.eigvals(sampled.A)) == pytest.approx(np.sort_complex(expected), rel=1e-13)


def test_the_plant_is_a_copy():
    system = slider()
    plant = mx.to_scipy(system)
    plant.A[1, 0] = 0.0
    assert system.state_space().A[1, 0] == pytest.approx(-1e4 / 2)


@pytest.mark.parametrize("inputs", [(), ("F",), ("F", "G")])
@pytest.mark.parametrize("outputs", [(), ("z",), ("y", "z")])
@pytest.mark.parametrize("locked", [False, True])
def test_any_number_of_ports(inputs, outputs, locked):
    plant = mx.to_scipy(slider(inputs, outputs, locked=locked))
    n = 0 if locked else 2
    assert plant.A.shape == (n, n)
    assert plant.B.shape == (n, len(inputs))
    assert plant.C.shape == (len(outputs), n)
    assert plant.D.shape == (len(outputs), len(inputs))


def test_what_is_no_system_is_refused():
    with pytest.raises(mv.ExportError, match=r"to_scipy: system = ndarray.*linearize"):
        mx.to_scipy(np.eye(2))
