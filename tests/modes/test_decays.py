"""Decays of what floats and is braked: real eigenvalues, also where several are the same."""

import numpy as np
import pytest

import mbsvib as mv


@pytest.mark.parametrize("y", [0.05, 0.4, 1.0, 1.25])
def test_equal_decays_of_what_floats_stay_real(y):
    """What Rayleigh damping brakes floats with six motions that decay by alpha; rounding parts them to pairs."""
    model = mv.Model("beams")
    section, material, alpha = {"type": "circle", "radius": 0.02}, {"E": 7e10, "rho": 2700.0, "nu": 0.3}, 0.7
    for name, start, end in (("one", (0, 0, 0), (1, y, 0.2)), ("two", (0, 0.5, 0), (1, 0.5, 0.1))):
        model.add_beam(name, None, None, section, material, start, end, elements=1, alpha=alpha)
    model.add_bushing("between", "one.1", "two.1", (0.5, 0.05, 0.1), (1e3,) * 6, (1.0,) * 6)
    modes = model.linearize().modes()
    values = modes.eigenvalues
    assert len(values) == 48
    assert np.count_nonzero(values == 0.0) == 6
    np.testing.assert_allclose(np.sort(values[values.imag == 0.0].real)[:6], -alpha, rtol=1e-11)
    assert np.abs(np.array(modes.errors)).max() < 1e-11
