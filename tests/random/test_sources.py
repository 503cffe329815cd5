"""Sources of noise: densities by name and pattern, correlation, base motion."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation
from mbsvib.random.sources import base_noise, base_sources, sources

INPUTS, UNITS = ("F1", "F2", "base.z"), ("N", "N", "m/s^2")
R = np.array([[1.0, 0.3 + 0.4j], [0.3 - 0.4j, 1.0]])


def test_cross_densities():
    """R_ij sqrt(S_i S_j), with S alone on the diagonal; of a function and of a matrix, and of independent sources."""
    f, spectra = np.array([1.0, 2.0, 5.0]), {"F2": [(0.5, 4.0), (8.0, 4.0)], "F1": 9.0}
    for given in (R, lambda f: np.broadcast_to(R, (len(f), 2, 2)), None):
        known = sources(spectra, INPUTS, UNITS, "plant", given)
        assert known.names == ("F2", "F1")
        expected = np.outer([2.0, 3.0], [2.0, 3.0]) * (np.eye(2) if given is None else R)
        np.testing.assert_allclose(known.matrix(f), np.broadcast_to(expected, (3, 2, 2)), rtol=1e-12)
        across = known.across(f)
        assert across is None if given is None else not np.diagonal(across, axis1=1, axis2=2).any()
    assert sources(known, INPUTS, UNITS, "plant") is known
    assert sources(spectra, INPUTS, UNITS, "plant", np.eye(2)).correlation is None
    assert sources(spectra, INPUTS, UNITS, "plant", R).constant is None
    real = sources(spectra, INPUTS, UNITS, "plant", R.real).constant
    np.testing.assert_array_equal(real, R.real)


def test_names_go_before_patterns():
    for spectra in ({"F*": 1.0, "F2": 5.0}, {"F2": 5.0, "F*": 1.0}):
        known = sources(spectra, INPUTS, UNITS, "plant")
        assert {name: part.at(np.array([1.0]))[0] for name, part in zip(known.names, known.densities, strict=True)} == {
            "F1": 1.0, "F2": 5.0}  # fmt: skip


@pytest.mark.parametrize("given", [
    [[1.0, 0.3], [0.4, 1.0]], [[1.0, 1.1], [1.1, 1.0]], [[2.0, 0.3], [0.3, 1.0]], [[1.0, np.nan], [np.nan, 1.0]],
    np.eye(3), "strong", [[1.0, 0.3j], [0.3j, 1.0]],
])  # fmt: skip
def test_correlations_of_no_noise(given):
    with pytest.raises(mv.ResponseError, match="correlation"):
        sources({"F1": 1.0, "F2": 1.0}, INPUTS, UNITS, "plant", given)
    ordinary = sources({"F1": 1.0, "F2": 1.0}, INPUTS, UNITS, "plant", lambda f: given)
    with pytest.raises(mv.ResponseError, match="correlation"):
        ordinary.across(np.array([1.0, 2.0]))


def test_base_noise_by_direction():
    noise = base_noise({"x y": 4.0, "z": [(1.0, 9.0), (5.0, 9.0)]})
    assert noise.directions == ("x", "y", "z")
    assert noise.unbounded
    assert not base_noise({"z": [(1.0, 9.0), (5.0, 9.0)]}).unbounded
    known = base_sources(noise)
    assert known.names == ("base.x", "base.y", "base.z")
    assert known.correlation is None
    np.testing.assert_allclose(known.of(np.array([2.0]))[:, 0], [4.0, 4.0, 9.0])
    assert base_noise(noise) is noise
    np.testing.assert_array_equal(base_sources(base_noise({"x": 1.0, "y": 1.0}, correlation=R)).correlation, R)
    for spectra, words in (({"x z": 1.0, "z": 1.0}, "'z' has two spectra"), ({"w": 1.0}, "no direction 'w'"),
                           ({}, "a density for each direction"), (1.0, "a density for each direction")):  # fmt: skip
        with pytest.raises(mv.ResponseError, match=words):
            base_noise(spectra)
    assert base_noise({"z": isolation.vc_spectrum("VC-C")}, ("z",)).directions == ("z",)


@pytest.mark.parametrize("band", [1.0, "low", (1.0, 2.0, 3.0), (2.0, 1.0), (-1.0, 2.0), (1.0, np.inf), (np.nan, 1.0)])
def test_bands_that_are_none(band):
    space = mv.StateSpace.from_arrays([[-1.0]], [[1.0]], [[1.0]], 0)
    with pytest.raises(mv.ResponseError, match="band"):
        space.rms("y1", {"u1": 1.0}, band=band)
