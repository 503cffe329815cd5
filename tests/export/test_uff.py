"""Universal files: written here, read by pyuff."""

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from tests.export.plants import same_bits, slider, stewart

pyuff = pytest.importorskip("pyuff", reason="pyuff is not installed: pip install 'mbsvib[uff]'")


def test_pyuff_reads_every_response(tmp_path):
    system = stewart()
    omega = np.geomspace(10.0, 1e5, 40)
    path = mx.to_uff(system, tmp_path / "plant.uff", omega)
    result = mx.from_uff(path)
    assert result.omega == pytest.approx(omega, rel=4e-16)
    assert same_bits(result.response, system.frequency_response(2 * np.pi * (omega / (2 * np.pi))))
    for key in ("inputs", "input_units", "outputs", "output_units"):
        assert getattr(result, key) == getattr(system, key)
    assert "15 inputs, 24 outputs, 40 frequencies" in repr(result)


def test_a_set_says_what_it_is(tmp_path):
    system = slider(outputs=("mass.z",))
    path = mx.to_uff(system, tmp_path / "x.uff")
    single = pyuff.UFF(str(path)).read_sets()
    assert (single["func_type"], single["rsp_node"], single["ref_node"]) == (4, 1, 1)
    assert (single["ordinate_spec_data_type"], single["orddenom_spec_data_type"]) == (8, 13)  # displacement, force
    assert (single["abscissa_spec_data_type"], single["abscissa_axis_units_lab"].strip()) == (18, "Hz")
    assert single["rsp_ent_name"].strip() == "mass.z"
    assert len(single["x"]) == len(system.frequency_grid())
    assert int(single["n_bytes"]) == 24 * len(single["x"])


def test_text_holds_the_responses_at_the_frequencies_that_it_holds(tmp_path):
    system = stewart()
    omega = 1e4 * np.sqrt([0.2, 0.3, 0.5])
    path = mx.to_uff(system, tmp_path / "x.uff", omega, binary=False)
    assert path.read_bytes().isascii()
    result = mx.from_uff(path)
    assert result.omega == pytest.approx(omega, rel=1e-5)
    exact = system.frequency_response(result.omega)
    assert np.abs(result.response - exact).max(axis=2) == pytest.approx(0.0, abs=1e-9 * np.abs(exact).max())


def test_what_does_not_fit(tmp_path):
    path = tmp_path / "x.uff"
    for system, message in (
        (slider(inputs=()), "0 inputs and 1 outputs"),
        (slider(inputs=("ü",)), "ASCII"),
        (slider(outputs=("a" * 81,)), "at most 80 characters"),
        (slider(outputs=("a / b",)), "without ' / '"),
        (np.eye(2), "to_uff: system = ndarray"),
    ):
        with pytest.raises(mv.ExportError, match=message):
            mx.to_uff(system, path, [1.0])
    assert not path.exists()


def test_damage(tmp_path):
    path = mx.to_uff(stewart(), tmp_path / "x.uff", [1.0, 2.0])
    raw = path.read_bytes()
    for content in (b"", b"text", raw[:400], raw[: len(raw) // 2]):
        path.write_bytes(content)
        with pytest.raises(mv.ExportError, match=r"x\.uff: "):
            mx.from_uff(path)
    with pytest.raises(mv.ExportError, match=r"none\.uff: cannot be read"):
        mx.from_uff(tmp_path / "none.uff")
