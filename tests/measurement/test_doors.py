"""Measurements from and to other programs: python-control, numpy files, SEP 005, pandas; a measured mirror."""

import sys
from pathlib import Path

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.errors import ExportError

MIRROR = Path(__file__).parents[2] / "examples" / "data" / "fsm_excerpt.npz"


def noisy():
    rng = np.random.default_rng(1)
    values = rng.standard_normal((2, 2, 4)) + 1j * rng.standard_normal((2, 2, 4))
    return mv.Measurement([1.0, 2.0, 4.0, 5.0], values, ["p", "q"], ["F", "M"], variance=np.abs(values),
                          coherence=np.full((2, 2, 4), 0.9), averages=7.5, quantity="velocity",
                          output_units=("m/s", "rad/s"), input_units=("N", "N m"))  # fmt: skip


def test_frd_of_python_control_there_and_back():
    data = noisy()
    frd = data.to_frd()
    assert (frd.output_labels, frd.input_labels) == (["p", "q"], ["F", "M"])
    back = mv.Measurement.from_frd(frd, quantity="velocity")
    np.testing.assert_array_equal(back.responses, data.responses)
    np.testing.assert_array_equal(back.omega, data.omega)
    assert (back.outputs, back.inputs, back.quantity) == (data.outputs, data.inputs, ("velocity",) * 2)
    system = mv.library.two_link().linearize()
    omega = np.array([1.0, 5.0])
    one = mv.Measurement.from_frd(mx.to_frd(system, omega))
    np.testing.assert_array_equal(one.responses, system.frequency_response(omega))
    with pytest.raises(mv.ResponseError, match="StateSpace has no frequency responses"):
        mv.Measurement.from_frd(system.state_space())


def test_table_of_pandas():
    pytest.importorskip("pandas")
    data = noisy()
    table = data.to_pandas()
    assert table.shape == (4, 4)
    np.testing.assert_array_equal(table["q", "F"].to_numpy(), data.responses[1, 0])
    np.testing.assert_allclose(table.index, data.frequencies)
    back = mv.Measurement.from_pandas(table.iloc[::-1], variance=data.variance)
    assert (back.outputs, back.inputs) == (data.outputs, data.inputs)
    np.testing.assert_array_equal(back.responses, data.responses)
    np.testing.assert_allclose(back.omega, data.omega, rtol=1e-15)
    part = mv.Measurement.from_pandas(table.drop(columns=[("q", "F")]))
    assert not part.is_measured[1, 0]
    assert part.is_measured.sum() == 3
    for wrong, message in (
        (table["q"], "1 levels of columns; expected a DataFrame"),
        (table.rename_axis(index="omega [rad/s]"), r"rows 'omega \[rad/s\]'"),
        (table[[("q", "F"), ("q", "F")]], "two columns"),
        (data.responses, "ndarray with rows None and 0 levels"),
    ):
        with pytest.raises(mv.ResponseError, match=message):
            mv.Measurement.from_pandas(wrong)


def test_numpy_file_there_and_back(tmp_path):
    data = noisy()
    back = mv.Measurement.from_npz(data.to_npz(tmp_path / "data.npz"))
    for name in ("omega", "responses", "variance", "coherence"):
        np.testing.assert_array_equal(getattr(back, name), getattr(data, name))
    for name in ("outputs", "inputs", "quantity", "output_units", "input_units", "averages"):
        assert getattr(back, name) == getattr(data, name)
    (tmp_path / "none.npz").write_bytes(b"no archive")
    with pytest.raises(mv.ResponseError, match=r"none.npz: no file of arrays that can be read"):
        mv.Measurement.from_npz(tmp_path / "none.npz")
    np.savez(tmp_path / "lines.npz", responses=data.responses, outputs=data.outputs, inputs=data.inputs)
    with pytest.raises(mv.ResponseError, match="omega is missing; the file has responses, outputs, inputs"):
        mv.Measurement.from_npz(tmp_path / "lines.npz")
    raw, broken = (tmp_path / "data.npz").read_bytes(), tmp_path / "broken.npz"
    for k in range(0, len(raw), 40):
        broken.write_bytes(raw[:k] + bytes(20) + raw[k + 20 :] if k % 80 else raw[:k])
        try:
            mv.Measurement.from_npz(broken)
        except mv.ResponseError as error:
            assert "from_npz: " in str(error) or "Measurement: " in str(error)  # noqa: PT017
    with pytest.raises(mv.ResponseError, match="response is nothing that a measurement has"):
        mv.Measurement.from_npz(MIRROR, response="responses_100")


def test_files_of_arrays_keep_what_channels_share_of_the_noise(tmp_path):
    """A virtual point from a file tells as much to further assemblies and fits; damaged entries are refused."""
    rng = np.random.default_rng(0)
    places, names = {1: (0, 0, 0), 2: (0, 0.1, 0), 3: (0, 0, 0.1)}, ["1X+", "1Y+", "1Z+", "2X+", "2Z+", "3X+"]
    data = mv.Measurement([1.0, 2.0], rng.standard_normal((6, 1, 2)), names, ["F"], quantity="velocity", nodes=places,
                          variance=rng.uniform(1.0, 2.0, (6, 1, 2)))  # fmt: skip
    point = data.virtual_point("p", (0.1, 0.2, 0.3), "*")
    where = point.to_npz(tmp_path / "point.npz")
    back = mv.Measurement.from_npz(where)
    np.testing.assert_array_equal(back.common_errors.matrices(), point.common_errors.matrices())
    assert data.to_npz(tmp_path / "plain.npz").exists()
    assert mv.Measurement.from_npz(tmp_path / "plain.npz").common_errors is None
    with np.load(where) as file:
        arrays = dict(file)
    for changed in ({"common_rows": arrays["common_rows"][1:]}, {"common_variance": -arrays["common_variance"]},
                    {"common_columns": np.array("a")}):  # fmt: skip
        np.savez(tmp_path / "wrong.npz", **(arrays | changed))
        with pytest.raises(mv.ResponseError, match=r"common_rows .* with responses .*; expected"):
            mv.Measurement.from_npz(tmp_path / "wrong.npz")


def test_all_arrays_of_a_numpy_file(tmp_path):
    """Noise of all kinds, unsorted frequencies of other programs in Hz, names of other programs."""
    data = noisy()
    covariance = np.einsum("ijn,kjn->ikn", data.responses, data.responses.conj())
    full = mv.Measurement(data.omega, data.responses, data.outputs, data.inputs, covariance=covariance,
                          noise_variance=0.5 * np.abs(data.responses), averages=3,
                          line_correlation=[0.6, -0.1])  # fmt: skip
    back = mv.Measurement.from_npz(full.to_npz(tmp_path / "full.npz"))
    for name in ("covariance", "noise_variance", "variance", "line_correlation"):
        np.testing.assert_array_equal(getattr(back, name), getattr(full, name))
    assert (back.averages, back.coherence) == (3, None)
    np.savez(tmp_path / "other.npz", f=data.frequencies, G=data.responses, outputs=np.array("p"), inputs=["F", "M"],
             s2=data.variance[:1])  # fmt: skip
    with pytest.raises(mv.ResponseError, match="outputs"):
        mv.Measurement.from_npz(tmp_path / "other.npz", frequencies="f", responses="G")
    np.savez(tmp_path / "other.npz", f=data.frequencies, G=data.responses[:1], outputs=np.array("p"), inputs=["F", "M"],
             s2=data.variance[:1])  # fmt: skip
    other = mv.Measurement.from_npz(tmp_path / "other.npz", frequencies="f", responses="G", variance="s2")
    np.testing.assert_allclose(other.omega, data.omega, rtol=1e-15)
    assert (other.outputs, other.inputs) == (("p",), ("F", "M"))
    np.testing.assert_array_equal(other.variance, data.variance[:1])
    with pytest.raises(mv.ResponseError, match="noise is missing"):
        mv.Measurement.from_npz(tmp_path / "other.npz", frequencies="f", responses="G", noise_variance="noise")


def test_frequencies_of_other_programs_in_any_order():
    """Of python-control, with its arrays of either name, and of pandas."""
    data = noisy()
    order = [2, 0, 3, 1]
    for field in ("frdata", "fresp"):
        frd = type("FRD", (), {"omega": data.omega[order], field: data.responses[..., order],
                               "output_labels": ["p", "q"], "input_labels": ["F", "M"]})()  # fmt: skip
        back = mv.Measurement.from_frd(frd, variance=data.variance)
        np.testing.assert_array_equal(back.responses, data.responses)
        np.testing.assert_array_equal(back.omega, data.omega)


def test_pandas_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    modes = mv.MeasuredModes([1.0])
    for call, name in ((noisy().to_pandas, "to_pandas"), (modes.to_dataframe, "to_dataframe")):
        with pytest.raises(ExportError, match=f"{name}: needs pandas, which is not installed"):
            call()


def test_a_closed_loop_of_sep005():
    """An outer reference, by pattern, in another unit; the step by times or by rate; one record of each name."""
    rng = np.random.default_rng(3)
    r = rng.standard_normal(8000)
    u, y = np.zeros(8000), np.zeros(8000)
    for k in range(1, 8000):
        y[k] = 0.5 * u[k - 1]
        u[k] = r[k] - y[k]
    noise = 0.2 * rng.standard_normal(8000)
    channels = [{"name": "loop.r", "data": r, "fs": 50},
                {"name": "y", "data": 1e3 * (y + noise), "fs": 50, "unit_str": "mm"},
                {"name": "u", "data": u, "time": np.arange(8000) / 50}]  # fmt: skip
    data = mv.Measurement.from_sep005(channels, "u", "loop.*", segments=20)
    assert (data.outputs, data.inputs, data.output_units, data.input_units) == (("y",), ("u",), ("m",), ("",))
    exact = 0.5 * np.exp(-1j * data.omega / 50)
    assert np.mean(np.abs(data.responses[0, 0] - exact) ** 2) / np.mean(data.variance) == pytest.approx(1.0, abs=0.3)
    given = {"u": u}, {"y": y + noise}
    plain = mv.Measurement.from_records(1 / 50, *given, reference={"r": r}, segments=20)
    np.testing.assert_allclose(data.responses, plain.responses, rtol=1e-9)
    with pytest.raises(mv.ResponseError, match="u is there more than once"):
        mv.Measurement.from_sep005([*channels, channels[2]], "u")
    with pytest.raises(mv.ResponseError, match="no channels"):
        mv.Measurement.from_sep005([], "u")
    for wrong in ({"fs": 0.0}, {"fs": -50.0}, {"fs": None}):
        with pytest.raises(mv.ResponseError, match="'y' has neither 'time' nor a positive 'fs'"):
            mv.Measurement.from_sep005([channels[0], channels[1] | wrong, channels[2]], "u")


def test_the_measured_mirror():
    """The peaks that its README has, at the resolution of the excerpt; noise is a part of the variance."""
    with pytest.raises(mv.ResponseError, match="responses is missing; the file has frequencies, outputs"):
        mv.Measurement.from_npz(MIRROR)
    data = mv.Measurement.from_npz(MIRROR, responses="responses_100", variance="variance_100",
                                   noise_variance="noise_variance_100")  # fmt: skip
    assert (data.outputs, data.inputs) == (("s1", "s2", "s3"), ("V1", "V2", "V3"))
    largest = np.linalg.svd(np.moveaxis(data.responses, -1, 0), compute_uv=False)[:, 0]
    for peak in (640.3, 813.2, 924.2, 999.5):
        near = np.abs(data.frequencies - peak) < 12.0
        assert data.frequencies[near][np.argmax(largest[near])] == pytest.approx(peak, abs=2.4)
    assert np.median(data.noise_variance / data.variance) < 1.0


def sep005(**change):
    t = np.arange(4096) / 100.0
    u = np.random.default_rng(2).standard_normal(4096)
    y = np.convolve(u, [0.0, 0.5, 0.3])[:4096]
    channels = [{"name": "force", "data": u / 1e3, "fs": 100, "unit_str": "kN", "start_timestamp": "a"},
                {"name": "acc", "data": y / 9.80665, "time": t, "unit_str": "g", "start_timestamp": "a"}]  # fmt: skip
    channels[1] |= change
    return channels


def test_channels_of_sep005_come_in_si_units():
    data = mv.Measurement.from_sep005(sep005(), inputs="force", segments=16)
    exact = np.polyval([0.3, 0.5, 0.0], np.exp(-1j * data.omega / 100.0))
    assert np.abs(data.responses[0, 0] - exact).max() < 0.05
    assert (data.output_units, data.input_units, data.quantity) == (("m/s^2",), ("N",), ("acceleration",))
    for change, message in (
        ({"time": None}, "'acc' has neither 'time' nor a positive 'fs'"),
        ({"time": None, "fs": 50}, "records differ, .*acc: 4096 samples each 0.02 s a"),
        ({"start_timestamp": "b"}, "records differ"),
    ):
        with pytest.raises(mv.ResponseError, match=message):
            mv.Measurement.from_sep005(sep005(**change), inputs="force", segments=16)
    with pytest.raises(mv.ResponseError, match="'name' is missing"):
        mv.Measurement.from_sep005([{"data": [1.0]}], inputs="force")


def test_names_with_dots_pass_python_control():
    """python-control has no dots in names: ports and joined parts have a colon there, and a dot here."""
    data = mv.Measurement([1.0, 2.0], np.ones((2, 1, 2)), ["a.tip.x", "B:101X+"], ["a.tip.z"])
    frd = data.to_frd()
    assert (frd.output_labels, frd.input_labels) == (["a:tip:x", "B:101X+"], ["a:tip:z"])
    back = mv.Measurement.from_frd(frd)
    assert (back.outputs, back.inputs) == (data.outputs, data.inputs)


def test_records_in_tables_of_pandas():
    pandas = pytest.importorskip("pandas")
    t, (u, y) = 0.01 * np.arange(400), np.random.default_rng(0).standard_normal((2, 400))
    table, result = pandas.DataFrame({"F": u, "y": y}), {}
    for kind, inputs, outputs in (("table", table[["F"]], table[["y"]]), ("dict", {"F": u}, {"y": y})):
        result[kind] = mv.Measurement.from_records(pandas.Series(t), inputs, outputs, segments=8).responses
        assert mv.Records(t, inputs, outputs).samples == 400
    np.testing.assert_array_equal(result["table"], result["dict"])
    for dates in (pandas.to_datetime(t, unit="s"), pandas.to_timedelta(t, unit="s")):
        with pytest.raises(mv.ResponseError, match="expected even times"):
            mv.Measurement.from_records(dates, {"F": u}, {"y": y}, segments=8)
