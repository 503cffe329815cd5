"""Responses, measurements and sweeps as data sets of xarray: axes, coordinates, units, all digits."""

import sys

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx

xarray = pytest.importorskip("xarray")
FREQUENCIES = np.array([0.5, 1.0, 3.0])


@pytest.mark.slow
def test_a_frequency_response():
    system = mv.library.quarter_car().linearize()
    data = mx.to_xarray(system, 2.0 * np.pi * FREQUENCIES, outputs=["travel", "body.az"])
    assert data["response"].dims == ("output", "input", "frequency")
    assert data.frequency.attrs == {"units": "Hz"}
    np.testing.assert_allclose(data.frequency, FREQUENCIES, rtol=1e-15)
    assert data.attrs == {"name": "quarter_car"}
    for output, unit in (("travel", "m"), ("body.az", "m/s^2")):
        assert data.sel(output=output).output_unit == unit
        for source in system.inputs:
            exact = system.frequency_response(2.0 * np.pi * FREQUENCIES, output, source)[0, 0]
            np.testing.assert_allclose(data["response"].sel(output=output, input=source), exact, rtol=1e-12)
    assert data.sel(input="actuator").input_unit == "N"
    space = mx.to_xarray(system.state_space(), [1.0], inputs="load")
    assert space["response"].shape == (len(system.outputs), 1, 1)
    with pytest.raises(mv.ExportError, match="to_xarray"):
        mx.to_xarray("quarter_car", [1.0])


def test_a_measurement_with_its_noise():
    rng = np.random.default_rng(0)
    responses = rng.normal(size=(2, 1, 3)) + 1j * rng.normal(size=(2, 1, 3))
    covariance = np.einsum("in,jn->ijn", responses[:, 0], responses[:, 0].conj()) + 3.0 * np.eye(2)[..., None]
    data = mv.Measurement(2.0 * np.pi * FREQUENCIES, responses, ["a", "b"], ["F"], covariance=covariance,
                          output_units=["m/s^2", "m/s^2"], input_units=["N"]).to_xarray()  # fmt: skip
    assert (data["response"].sel(output="b", input="F").values == responses[1, 0]).all()
    assert data["covariance"].dims == ("output", "other_output", "frequency")
    np.testing.assert_allclose(data["covariance"].values, covariance, rtol=1e-14)
    np.testing.assert_allclose(data["variance"].sel(output="a", input="F"), covariance[0, 0].real, rtol=1e-14)
    assert list(data.output_unit.values) == ["m/s^2", "m/s^2"]
    assert (float(data.frequency[1]), data.frequency.attrs["units"]) == (1.0, "Hz")
    bare = mv.Measurement(2.0 * np.pi * FREQUENCIES, responses, ["a", "b"], ["F"]).to_xarray()
    assert set(bare.variables) == {"response", "frequency", "output", "input"}


def test_a_sweep_over_a_grid():
    values = {"tyre.stiffness": [1e5, 2e5, 3e5], "body.mass": [200.0, 300.0]}
    sweep = mv.sweep(mv.library.quarter_car(), values, {"f": "modes.frequencies", "stable": "modes.stable"},
                     how="grid")  # fmt: skip
    data = sweep.to_xarray()
    assert data["f"].dims == ("tyre.stiffness", "body.mass", "f entry")
    assert data["stable"].dims == ("tyre.stiffness", "body.mass")
    assert (data["f"].values == sweep.grid("f")).all()
    assert data["tyre.stiffness"].attrs == {"units": "N/m"}
    assert data["f"].attrs == {"units": "Hz"}
    at = data.sel({"tyre.stiffness": 2e5, "body.mass": 300.0, "f entry": 2})["f"]
    assert at == sweep["f"][np.flatnonzero((sweep["tyre.stiffness"] == 2e5) & (sweep["body.mass"] == 300.0))[0], 1]


def test_paired_variables_tracks_and_failed_points():
    model = mv.library.quarter_car()
    paired = mv.sweep(model, {"tyre.stiffness": [1e5, 2e5], "body.mass": [200.0, 300.0]}, {"f": "modes.frequencies"},
                      how="paired").to_xarray()  # fmt: skip
    assert paired["f"].dims == ("point", "f entry")
    assert paired["body.mass"].dims == ("point",)
    tracks = mv.track(model, {"tyre.stiffness": [1e5, 2e5]})
    data = tracks.to_xarray()
    assert data["frequencies"].dims == ("tyre.stiffness", "mode")
    assert (data["frequencies"].sel(mode=tracks.modes[1]).values == tracks.mode(tracks.modes[1])).all()
    failing = mv.sweep(model, {"body.mass": [300.0, -1.0]}, "modes.frequencies").to_xarray()
    assert [error[:28] for error in failing["error"].values] == ["", "ModelError: body 'body': mas"]
    assert np.isnan(failing["modes.frequencies"].sel({"body.mass": -1.0})).all()


def test_xarray_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(mv.ExportError, match=r"to_xarray: needs xarray.*mbsvib\[xarray\]"):
        mx.to_xarray(mv.library.quarter_car().linearize(), [1.0])
