"""What cannot become a unit is refused in words, and nothing half-written is left."""

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.fmu_.names import base_unit, identifier, unique_names
from tests.export.fmu.drive import unit
from tests.export.plants import slider

LAW = {"inputs": ["y"], "outputs": ["u"], "name": "law"}


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"version": "1.0"}, r'version = \'1\.0\'; expected "2\.0", "3\.0"'),
        ({"version": 3}, r'version = 3; expected "2\.0", "3\.0"'),
        ({"version": ()}, r"version = \(\)"),
        ({"tunable": "k.stiffnes"}, "Did you mean 'k.stiffness'"),
    ],
)
def test_words(more, words, tmp_path):
    with pytest.raises(mv.MbsvibError, match=words):
        mx.to_fmu(slider(), tmp_path / "unit.fmu", **more)
    assert list(tmp_path.iterdir()) == []


def test_paths(tmp_path):
    for path, words in (
        (tmp_path / "none" / "unit.fmu", "cannot be written"), (tmp_path / "unit.zip", r"ends in \.fmu"),
    ):  # fmt: skip
        with pytest.raises(mv.ExportError, match=words):
            mx.to_fmu(slider(), path)
    (tmp_path / "folder.fmu").mkdir()
    with pytest.raises(mv.ExportError, match="cannot be written"):
        mx.to_fmu(slider(), tmp_path / "folder.fmu")
    assert [path.name for path in tmp_path.rglob("*")] == ["folder.fmu"]


def test_a_refused_export_leaves_the_old_file_as_it_was(tmp_path):
    (tmp_path / "unit.fmu").write_bytes(b"old")
    with pytest.raises(mv.ExportError):
        mx.to_fmu(library.stewart().linearize(), tmp_path / "unit.fmu", tunable=("platform.position.z",))
    assert (tmp_path / "unit.fmu").read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (lambda: control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.01, **LAW), r"discrete in time \(dt = 0\.01\)"),
        (lambda: control.tf([1.0], [1.0, 0.5], 0.01), r"discrete in time \(dt = 0\.01\)"),
        (lambda: control.frd([1.0], [1.0]), "FrequencyResponseData; expected a control.StateSpace"),
        (lambda: control.ss([[np.nan]], [[1.0]], [[1.0]], [[0.0]], **LAW), "A of 'law' holds NaN"),
    ],
)
def test_controllers(law, words, tmp_path):
    for ports in ({}, {"outputs": "*"}):
        with pytest.raises(mv.ExportError, match=words):
            mx.to_fmu(law(), tmp_path / "law.fmu", **ports)
    assert list(tmp_path.iterdir()) == []


def test_other_things(tmp_path):
    for thing in (None, 3, "stewart", library.stewart(), np.eye(2)):
        with pytest.raises(mv.ExportError):
            mx.to_fmu(thing, tmp_path / "unit.fmu")


def test_a_static_gain_is_a_unit(tmp_path):
    file = mx.to_fmu(control.ss([], [], [], [[2.0, -3.0]], inputs=["a", "b"], outputs=["u"], name="gain"),
                     tmp_path / "gain.fmu")  # fmt: skip
    with unit(file, tmp_path / "gain") as gain:
        gain.set({"a": 1.0, "b": 0.5})
        gain.step(0.0, 0.1)
        assert gain.get(["u"]).tolist() == [0.5]


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_names_that_xml_and_files_find_hard(version, tmp_path):
    """Names with markup, letters of many alphabets, and the same for an input and an output."""
    names = ("<F> & \"d\" 'e'", "Kraft_ÄÖ", "力", "a" * 300)
    system = slider(inputs=names, outputs=("z", "Kraft_ÄÖ"), name='1 "µ" <slider>/..\\x')
    file = mx.to_fmu(system, tmp_path / "unit ä.fmu", version)
    assert tuple(file.names["input"]) == system.inputs
    assert file.names["output"] == {"z": "z", "Kraft_ÄÖ": "Kraft_ÄÖ (output)"}
    with unit(file, tmp_path / "unit ü") as plant:
        plant.set({file.names["input"][name]: 1.0 for name in system.inputs})
        plant.step(0.0, 0.1)
        y = plant.get(list(file.names["output"].values()))
    assert y[0] == y[1] != 0


def test_identifiers_and_unique_names():
    assert identifier("1 µ/..") == "model_1_____"
    assert identifier("") == "model_"
    assert unique_names({"input": ["x", "y\n"], "output": ["x", "x (output)", ""]}) == {
        "input": ["x", "y"], "output": ["x (output)", "x (output) (output)", "output"],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("unit", "base"),
    [
        ("N", {"kg": 1, "m": 1, "s": -2}), ("N m/rad", {"kg": 1, "m": 2, "s": -2, "rad": -1}), ("1/s", {"s": -1}),
        ("rad/s^2", {"rad": 1, "s": -2}), ("kg m^2", {"kg": 1, "m": 2}), ("m s^-1", {"m": 1, "s": -1}),
        ("modal/s", None), ("-", None),
        ("", None), ("furlong", None),
    ],
)  # fmt: skip
def test_units(unit, base):
    assert base_unit(unit) == base
