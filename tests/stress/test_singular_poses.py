"""Poses at which loops lose a constraint or springs lose a direction: refused or named there, right beside them."""

import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.library import stewart
from tests.stress import reference
from tests.stress.compare import HONEST
from tests.support.digits import mp
from tests.support.exact import Exact

PLATFORM = np.radians([-50.0, 50.0, 70.0, 170.0, 190.0, 290.0])


def four_bar(height, other):
    """Bars of about 1, 2, 1 and 2 m along one line; its two inner joints are ``height`` and ``other`` above it."""
    model = mv.Model("flat four-bar")
    points = np.array([(0, 0, 0), (1, height, 0), (3, other, 0), (2, 0, 0)], dtype=float)
    names = ("ground", "crank", "coupler", "rocker", "ground")
    for i, name in enumerate(names[1:4]):
        model.add_body(name, 1.0 + i, (0.1, 0.12, 0.11), position=(points[i] + points[i + 1]) / 2)
    for i in range(4):
        model.add_joint(f"j{i}", "revolute", names[i], names[i + 1], position=points[i])
        model.add_bushing(f"s{i}", names[i], names[i + 1], points[i], (0, 0, 0, 0, 0, 100.0 * (i + 1)))
    model.add_input("f", "crank", "x", position=points[1])
    model.add_output("x", "coupler", "y")
    return model


def smallest_pivot(system):
    return min(group.retained for group in system.provenance.reduction.groups)


@pytest.mark.parametrize("height", [0.0, 2.0**-60, 2.0**-51, 2.0**-45])
def test_a_flat_four_bar_is_refused(height):
    """Its constraints are dependent in this pose only; that holds as far as doubles can tell from 1e-13 off."""
    for other in (0.0, height):
        with pytest.raises(mv.SingularPoseError, match=r"singular pose. 1 of their 5 .* 2 in neighbouring poses"):
            four_bar(height, other).linearize()


@pytest.mark.few(3)
@pytest.mark.parametrize("power", range(2, 42, 3))
def test_a_four_bar_just_off_flat(power):
    """Right to eps / (smallest pivot), which is promised; warned of where that is more than 1e-12."""
    for other in (0.0, 1.0, 0.7):
        model = four_bar(2.0**-power, other * 2.0**-power)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            system = model.linearize()
            modes = system.modes(rtol=1e-12)
        names = {type(item.message).__name__ for item in caught}
        pivot = smallest_pivot(system)
        assert ("NearSingularWarning" in names) == (pivot < 1e-4)
        if pivot < 2e-4:
            assert "AccuracyWarning" in names
        exact = reference.exact(model, redundant="1e-60")
        (square,) = reference.squares(exact)
        error = float(abs(mp.mpf(float(modes.natural[0])) / mp.sqrt(square) - 1))
        assert error <= modes.errors[0] <= 1e-15 + 5e-16 / pivot


def test_responses_just_off_flat():
    """Frequency and time response keep as many digits."""
    model = four_bar(2.0**-12, 0.7 * 2.0**-12)
    with pytest.warns(mv.NearSingularWarning):
        system = model.linearize()
    omega = system.modes().natural[0] * np.array([0.1, 0.9, 3.0])
    with reference.precision("1e-60"):
        expected = Exact(model).frequency_response(omega)
    assert np.abs(system.frequency_response(omega) / expected - 1).max() <= 1e-11


@pytest.mark.parametrize("offset", [0.0, 1e-15, 1e-12])
def test_a_stewart_platform_at_its_singular_yaw(offset):
    """At 90 deg no leg feels a screw of the platform: a mode of exactly 0, and the others to all digits."""
    model = stewart(platform_angles=PLATFORM + np.pi / 2 + offset, ports="none")
    modes = model.linearize().modes(rtol=1e-12)
    assert modes.rigid == 1
    assert "1 rigid-body mode, exactly 0 Hz." in modes.remarks()
    with mp.workdps(reference.DIGITS):
        squares = reference.squares(reference.exact(model))
        omega = [mp.sqrt(abs(v)) for v in squares]
    assert omega[0] < 1e-11 * omega[-1]
    error = [float(abs(mp.mpf(float(a)) / b - 1)) for a, b in zip(modes.natural[1:], omega[1:], strict=True)]
    assert max(error) <= 3e-15


@pytest.mark.few(2)
@pytest.mark.parametrize("offset", [1e-10, 1e-8, 1e-6, 1e-4, 1e-2])
def test_a_stewart_platform_near_its_singular_yaw(offset):
    """The soft mode feels nothing but small differences of the geometry: eps / offset of it, promised and warned of."""
    model = stewart(platform_angles=PLATFORM + np.pi / 2 + offset, ports="none")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        modes = model.linearize().modes(rtol=1e-12)
    assert modes.rigid == 0
    with mp.workdps(reference.DIGITS):
        omega = [mp.sqrt(v) for v in reference.squares(reference.exact(model))]
    error = np.array([float(abs(mp.mpf(float(a)) / b - 1)) for a, b in zip(modes.natural, omega, strict=True)])
    assert (error <= HONEST * modes.errors[0::2] + 4e-16).all()
    assert error[1:].max() <= 3e-15
    assert modes.errors[0] <= 5e-16 / offset + 1e-14
    assert bool(caught) == (modes.errors[0] > 1e-12)
