"""Arguments of exports that are none: refused in words, before anything is written, and nothing is taken for "yes"."""

import zipfile
from xml.etree import ElementTree

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from tests.export.plants import slider

SYSTEM = slider()
PLANT = control.ss([[-1.0]], [[1.0, 2.0]], [[3.0], [4.0]], np.zeros((2, 2)), name="plant")
SKYHOOK = control.ss([[-0.5]], [[1.0]], [[-3000.0]], [[0.0]], name="skyhook", inputs=["z"], outputs=["F"])


@pytest.mark.parametrize(("export", "suffix", "option"), [
    (mx.to_op4, "op4", "binary"), (mx.to_uff, "uff", "binary"), (mx.to_uff, "uff", "modes"),
    (mx.to_mat, "mat", "loader"), (mx.to_modelica, "mo", "connectors"),
])  # fmt: skip
@pytest.mark.parametrize("value", ["no", "ascii", 0, None, [], np.array([1.0, 2.0])])
def test_choices_are_yes_or_no(export, suffix, option, value, tmp_path):
    """``binary="ascii"`` would write a binary file, ``run="no"`` would run the code of an FMU."""
    with pytest.raises(mv.ExportError, match=f"{option} = .*; expected True or False"):
        export(SYSTEM, tmp_path / f"file.{suffix}", **{option: value})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("words", "message"), [
    ({"run": "no"}, "run = 'no'; expected True or False"),
    ({"limit": "low"}, "limit = 'low'; expected a relative error"),
    ({"limit": np.nan}, "limit = nan"), ({"limit": -1.0}, "0 or above"), ({"limit": [1.0]}, "limit = "),
])  # fmt: skip
def test_checks(words, message, tmp_path):
    with pytest.raises(mv.ExportError, match=message):
        mx.check_export(mx.to_npz(SYSTEM, tmp_path / "slider.npz"), SYSTEM, **words)


@pytest.mark.parametrize(("export", "arguments", "words", "message"), [
    ("to_modelica", (SYSTEM, None), {}, "path = None; expected the path of a file"),
    ("to_modelica", (SYSTEM, "a.mo"), {"name": 3}, "name = 3; expected letters"),
    ("to_c", (SYSTEM, "."), {"name": 3}, "name = 3; expected letters"),
    ("to_c", (SYSTEM, "."), {"method": ""}, "method = ''; expected 'zoh', 'foh' or 'tustin'"),
    ("to_fmu", (SYSTEM, "a.fmu", np.array([2.0, 3.0])), {}, "version = "),
    ("to_fmu", (SYSTEM, "a.fmu", [["2.0"]]), {}, "version = "),
    ("to_fmu", (SYSTEM, "a.fmu"), {"platforms": 3}, "platforms = 3; expected a name"),
    ("to_ssp", (SYSTEM, SKYHOOK, None), {}, "path = None; expected the path of a file"),
    ("to_ssp", (SYSTEM, SKYHOOK, "a.ssp"), {"outer": "no"}, "outer = 'no'; expected True or False"),
    ("to_ssp", (SYSTEM, SKYHOOK, "a.ssp"), {"name": 3}, "name = 3; expected a text"),
    ("to_ssp", (SYSTEM, SKYHOOK, "a.ssp"), {"connections": {"G": "z"}}, "to_ssp: connections: there is no input 'G'"),
    ("densities_from_uff", ("a.uff",), {"bandwidth": "wide"}, "bandwidth = 'wide'; expected a positive number"),
    ("h2syn", (PLANT, 1.0, 1), {}, "nmeas = 1.0, ncon = 1; .*expected smaller whole numbers"),
    ("hinfsyn", (PLANT, None, 1), {}, "nmeas = None, ncon = 1"),
    ("augw", (PLANT, "high"), {}, "w1 = 'high'; expected a finite number, or a StateSpace"),
    ("augw", (PLANT, None, np.nan), {}, "w2 = nan; expected a finite number"),
    ("augw", (PLANT, control.ss([[0.5]], [[1.0]], [[1.0]], 0, 0.1)), {}, "w1 = .*in continuous time"),
    ("named", (PLANT, []), {}, "list is not a system of python-control"),
    ("named", (PLANT, PLANT), {"name": 3}, "name = 3; expected a text"),
    ("named", (PLANT, PLANT), {"states": "no"}, "states = 'no'; expected True or False"),
    ("NamedStateSpace", (control.tf([1.0], [1.0, 1.0]),), {}, "space = TransferFunction; expected"),
    ("NamedStateSpace", (PLANT,), {"inputs": "u"}, "inputs = 'u'; expected 2 names"),
])  # fmt: skip
def test_what_is_refused(export, arguments, words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function = getattr(mx, export)
    with pytest.raises(mv.ExportError, match=message):
        getattr(function, "of", function)(*arguments, **words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("words", "message"), [
    ({"connections": 3}, r"connections = 3; expected a mapping \{input: output\}"),
    ({"connections": {1: "z"}}, "{1: 'z'}"),
    ({"excitation": "all"}, r"excitation = 'all'; expected a mapping \{input: number\}"),
    ({"excitation": {"road": "rough"}}, "excitation = .*expected a mapping"),
    ({"bonds": 3}, "bonds = 3; expected a mapping"),
    ({"systems": 3}, "systems = 3; expected a mapping"),
])  # fmt: skip
def test_mappings_of_a_check(words, message, tmp_path):
    car = mv.library.quarter_car().linearize()
    damper = control.ss([[-0.5]], [[1.0]], [[-3000.0]], [[0.0]], inputs=["body:az"], outputs=["actuator"], name="d")
    with pytest.raises(mv.ExportError, match=message):
        mx.check_cosimulation(car, damper, 1e-3, **words)


@pytest.mark.parametrize("letter", ["\n", "\r", "\x00", "\x01", "\x85", "\u2028", "\ud800"])
def test_names_that_files_cannot_hold(letter, tmp_path):
    """In XML, texts of HDF5 and of MATLAB, and in lines of C and Modelica; models refuse such names of parts."""
    bad = f"a{letter}b"
    for names in ({"inputs": [bad]}, {"outputs": [bad]}, {"states": [bad]}):
        with pytest.raises(mv.ResponseError, match="has a line break or another character that is not printed"):
            mv.StateSpace.from_arrays([[-1.0]], [[1.0]], [[1.0]], 0, **names)
    with pytest.raises(mv.ResponseError, match="not printed"):
        mv.System.from_matrices([[1.0]], None, [[1.0]], B=[[1.0]], inputs=[bad])
    space = mv.StateSpace.from_arrays([[-1.0]], [[1.0]], [[1.0]], 0, name=bad)
    for export in (mx.to_json, mx.to_npz, mx.to_mat, mx.to_hdf5, mx.to_op4):
        with pytest.raises(mv.ExportError, match="expected a text without line breaks"):
            export(space, tmp_path / "file.mat")
    assert not list(tmp_path.iterdir())
    text = mx.to_modelica(space, tmp_path / "a.mo").read_text("utf-8")
    assert 'model a "a b: der(x)' in text
    assert "Written by mbsvib for 'a b', version" in mx.to_c(space, tmp_path).header.read_text("ascii")
    document = zipfile.ZipFile(mx.to_fmu(space, tmp_path / "a.fmu")).read("modelDescription.xml")
    assert ElementTree.fromstring(document).get("modelName").startswith("a")
