"""Measurements in universal files: written, read by pyuff and by us, and auto spectra."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.measurement.data import MeasuredMode
from mbsvib.measurement.points import Node
from tests.export.test_uff_foreign import function

pyuff = pytest.importorskip("pyuff", reason="pyuff is not installed: pip install 'mbsvib[test]'")
TURN = ((0.6, -0.8, 0.0), (0.8, 0.6, 0.0), (0.0, 0.0, 1.0))


def measurement(**more):
    """A roving hammer at a beam: one pair is missing; one node has axes of its own; one real and one complex mode."""
    rng = np.random.default_rng(1)
    responses = rng.standard_normal((2, 2, 5)) + 1j * rng.standard_normal((2, 2, 5))
    responses[1, 0] = np.nan
    nodes = (Node(7, "beam", (0.0, 0.0, 0.5)), Node(3, "beam", (1.0, 0.0, 0.5), TURN), Node(9, "", (2.0, 0.0, 0.0)))
    real = np.arange(18.0).reshape(3, 6) - 7.0
    mixed = np.column_stack(((1.0 - 2.0j) * real[:, :3], np.full((3, 3), np.nan)))
    modes = (MeasuredMode("bending", 12.5, 0.01, (7, 3, 9), real),
             MeasuredMode("whirl", 40.0, 0.25, (7, 3, 9), mixed))  # fmt: skip
    return mv.Measurement(2 * np.pi * np.linspace(1.0, 3.0, 5), responses, ("3X+", "9Z-"), ("7Z+", "3X+"),
                          output_units=("m/s^2", "m/s^2"), input_units=("N", "N"), nodes=nodes, modes=modes,
                          lines=((7, 3, 9),), **more)  # fmt: skip


@pytest.mark.parametrize("binary", [True, False])
def test_a_measurement_comes_back(tmp_path, binary):
    data = measurement(coherence=np.full((2, 2, 5), 0.75))
    back = mx.from_uff(mx.to_uff(data, tmp_path / "x.uff", binary=binary, modes=True))
    for name in ("outputs", "inputs", "output_units", "input_units", "output_points", "input_points", "nodes", "lines",
                 "left_out"):  # fmt: skip
        assert getattr(back, name) == getattr(data, name), name
    np.testing.assert_allclose(back.omega, data.omega, rtol=1e-15 if binary else 1e-5)
    np.testing.assert_allclose(back.responses, data.responses, rtol=1e-15 if binary else 1e-11)
    np.testing.assert_allclose(back.coherence[back.is_measured], 0.75)
    for mode, expected in zip(back.modes, data.modes, strict=True):
        assert (mode.name, mode.nodes) == (expected.name, expected.nodes)
        assert (mode.frequency, mode.damping_ratio) == pytest.approx((expected.frequency, expected.damping_ratio), 1e-5)
        np.testing.assert_allclose(mode.shape, expected.shape, rtol=1e-5, atol=1e-5)


def test_names_of_modes_are_one_line_each(tmp_path):
    """A name may be missing, or be the line that ends a data set."""
    shape = np.eye(1, 6)
    names = ("", "-1", "two\nlines", "  ", "n" * 90)
    data = replace(measurement(), modes=tuple(MeasuredMode(name, 1.0 + k, 0.01, (7,), shape)
                                              for k, name in enumerate(names)))  # fmt: skip
    back = mx.from_uff(mx.to_uff(data, tmp_path / "x.uff", modes=True))
    assert [mode.name for mode in back.modes] == ["Mode 1", "'-1'", "two lines", "Mode 4", "n" * 80]
    assert [mode.frequency for mode in back.modes] == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_pyuff_reads_a_measurement(tmp_path):
    data = measurement(coherence=np.full((2, 2, 5), 0.75))
    path = mx.to_uff(data, tmp_path / "x.uff", binary=False, outputs="9*", inputs="3*")
    sets = [item for item in pyuff.UFF(str(path)).read_sets() if item["type"] == 58]
    assert [(item["func_type"], item["rsp_node"], item["rsp_dir"], item["ref_node"], item["ref_dir"])
            for item in sets] == [(4, 9, -3, 3, 1), (6, 9, -3, 3, 1)]  # fmt: skip
    np.testing.assert_allclose(sets[0]["data"], data.responses[1, 1], rtol=1e-10)
    np.testing.assert_allclose(sets[1]["data"], 0.75)
    np.testing.assert_allclose(sets[1]["x"], data.frequencies)


def test_what_a_file_cannot_hold_is_refused_or_named(tmp_path):
    path, data = tmp_path / "x.uff", measurement()
    responses = data.responses.copy()
    responses[0, 1, 2] = np.nan
    close = replace(data, omega=2 * np.pi * (1.0 + 1e-8 * np.arange(5)))
    for wrong, options, message in (
        (data, {"omega": [1.0]}, "omega is given with a Measurement"),
        (replace(data, responses=responses), {}, r"response of '3X\+' to '3X\+' is not known at 2 Hz"),
        (close, {"binary": False}, "two lines .* same frequency"),
        (data["9*", "7*"], {}, "no responses"),
    ):
        with pytest.raises(mv.ExportError, match=message):
            mx.to_uff(wrong, path, **options)
    assert not path.exists()
    with pytest.warns(mv.LeftOutWarning, match="to_uff: variance, quantity of the measurement are left out"):
        mx.to_uff(replace(data, variance=np.ones((2, 2, 5)), output_units=("", ""), quantity="velocity"), path)
    assert mx.from_uff(path).output_units == ("", "")


def test_unknown_units_of_both_ends_come_back(tmp_path):
    data = replace(measurement(), output_units=("", ""), input_units=("", ""), quantity=None)
    back = mx.from_uff(mx.to_uff(data, tmp_path / "x.uff"))
    assert back.output_units == back.input_units == ("", "")


def test_auto_spectra_are_densities_of_a_bandwidth(tmp_path):
    """White noise of 2 (m/s^2)^2/Hz in lines of a Hann window: mean squares of 2 times 1.5 times the distance."""
    path, f = tmp_path / "x.uff", np.array([1.0, 1.25, 1.5])
    more = {"ordinate_spec_data_type": 12, "orddenom_spec_data_type": 0, "ord_data_type": 4}
    file = pyuff.UFF(str(path))
    file._write_set({"type": 164, "units_code": 5, "units_description": "mm (milli-newton)", "temp_mode": 1,
                     "length": 1000.0, "force": 1000.0, "temp": 1.0, "temp_offset": 273.15}, "overwrite")  # fmt: skip
    file._write_set(function((1, 3), (0, 0), np.full(3, 2e6 * 1.5 * 0.25), f, func_type=2, **more), "add")
    np.testing.assert_allclose(mx.densities_from_uff(path, 1.5 * 0.25)["1+Z"], np.column_stack((f, np.full(3, 2.0))))
    with pytest.raises(mv.ExportError, match=r"auto spectra of 1\+Z are mean squares by line.*bandwidth="):
        mx.densities_from_uff(path)
    file._write_set(function((2, 3), (0, 0), np.full(3, 5e6), f, func_type=9, **more), "add")
    with pytest.warns(mv.LeftOutWarning, match=r"auto spectra of 1\+Z .* left out"):
        assert list(mx.densities_from_uff(path)) == ["2+Z"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        both = mx.densities_from_uff(path, 0.375)
    np.testing.assert_allclose([both["1+Z"][:, 1], both["2+Z"][:, 1]], [[2.0] * 3, [5.0] * 3])
    with pytest.raises(mv.ExportError, match="bandwidth = -1"):
        mx.densities_from_uff(path, -1.0)
    file._write_set(function((1, 3), (0, 0), np.ones(3), f, func_type=2, **more), "add")
    with pytest.raises(mv.ExportError, match=r"several spectra of 1\+Z"):
        mx.densities_from_uff(path, 0.375)
