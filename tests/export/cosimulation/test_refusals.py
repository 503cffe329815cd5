"""What cannot be co-simulated is refused by name, before anything runs."""

import re
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mbsvib as mv
import mbsvib_export as mx
from mbsvib_export.cosimulation.unit import state_space_of_unit
from mbsvib_export.fmu_.binaries import this_platform
from tests.export.cosimulation.loops import controller, plant, speed_feedback

H = 1e-3


def refused(words, *given, **more):
    with pytest.raises(mv.ExportError, match=words):
        mx.check_cosimulation(*given, **more)


def test_algebraic_loops_by_the_signals_in_them():
    refused(r"algebraic loop: y \(plant\) <- F \(controller\) <- y \(plant\)", plant("acceleration"),
            controller(-1.0, through=-1.0), H)  # fmt: skip


def test_units_that_differ(tmp_path):
    """A law that comes from a model has units: this one wants accelerations."""
    law = mv.Model("law")
    law.add_body("mass", 1.0, (1, 1, 1))
    law.add_joint("guide", "prismatic", "ground", "mass", axis=(0, 0, 1))
    law.add_spring("k", "ground", "mass", start=(0, 0, -1), end=(0, 0, 0), stiffness=1.0, damping=1.0)
    law.add_base_motion("y", "z")
    law.add_force_output("F", "k")
    refused(r"output .y. \[m\] does not go with the controller.s input .y. \[m/s\^2\]", plant("displacement"),
            law.linearize(), H)  # fmt: skip


def test_units_without_connection():
    refused("no connection from outputs of the controller to inputs of the plant: there is u on one side, F, d",
            plant(), controller(-1.0, outputs=("u",)), H)  # fmt: skip
    refused("no connection from outputs of the plant", plant(), controller(-1.0, inputs=("w",)), H)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("units")
    return (mx.to_fmu(plant(), folder / "plant.fmu", platforms=this_platform()),
            mx.to_fmu(speed_feedback(), folder / "law.fmu", platforms=this_platform()))  # fmt: skip


@pytest.mark.parametrize(
    ("words", "more"),
    [
        ("no input 'f'.*Did you mean 'F'", {"connections": {"f": "F"}}),
        ("'G' for the plant's input 'd' is not an output of 'law'", {"connections": {"d": "G"}}),
        ("excitation: 'F' is not a free input. These are free: d", {"excitation": {"F": 1.0}}),
        ("excitation holds NaN", {"excitation": {"d": np.nan}}),
        ("masters = 'jakobi'; expected 'jacobi'.*Did you mean 'jacobi'", {"masters": "jakobi"}),
        ("masters = 3; expected a name, or a list of names", {"masters": 3}),
        ("bonds: the plant has no 'Y'", {"bonds": {"F": "Y"}}),
        ("bonds: the plant has no 'G'", {"bonds": {"G": "z"}}),
        ("bonds: 'y' is in m/s; expected a displacement in m or an angle", {"bonds": {"F": "y"}}),
        ("systems = 'law'; expected 'plant' or 'controller'", {"systems": {"law": plant()}}),
        ("duration = -1", {"duration": -1}),
    ],
)
def test_words(words, more, files):
    refused(words, *files, H, **more)


@pytest.mark.parametrize("step", [0.0, -1e-3, np.nan, np.inf, "fast"])
def test_steps(step):
    refused("step = .*expected a positive number", plant(), speed_feedback(), step)


def test_a_run_that_fails_tells_the_last_messages_of_the_units(files, monkeypatch):
    def stepped(instance, *_):
        instance.log += [f"{instance.unit.name} {k}" for k in (1, 2, 3, 4, 4)]
        raise RuntimeError("no step")

    monkeypatch.setattr("mbsvib_export.cosimulation.unit.Instance.stepped", stepped)
    refused(r"plant\.fmu, law\.fmu, jacobi: no step slider 3; slider 4$", *files, H, masters="jacobi")


def test_an_input_of_both():
    both = controller(-1.0, inputs=("y", "d"))
    refused("both FMUs have an input 'd'; say 'plant:d'", plant(), both, H, connections={"d": None})


def test_files_that_are_no_units(tmp_path):
    good = mx.to_fmu(plant(), tmp_path / "good.fmu")
    content = good.path.read_bytes()
    (tmp_path / "cut.fmu").write_bytes(content[: len(content) // 2])
    (tmp_path / "text.fmu").write_text("no archive")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("readme.txt", "nothing")
    for name, words in (("cut", "damaged"), ("text", "damaged"), ("empty", "damaged"), ("none", "no such file")):
        refused(f"{name}.fmu.*{words}", tmp_path / f"{name}.fmu", speed_feedback(), H)


def rewritten(source, path, change):
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            result = change(name, old.read(name))
            if result is not None:
                new.writestr(name, result)
    return path


@pytest.mark.few(1)
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_units_that_were_tampered_with(version, tmp_path):
    good = mx.to_fmu(plant(), tmp_path / "good.fmu", version)

    def flipped(name, content):
        return content[:-9] + bytes([content[-9] ^ 1]) + content[-8:] if name.endswith(".lti") else content

    def another(name, content):
        return None if name.startswith("binaries") else content

    def no_library(name, content):
        return b"\x7fELF" if name.startswith("binaries") else content

    def no_description(name, content):
        return content[: len(content) // 2] if name.endswith(".xml") else content

    for change, words in (
        (flipped, r"cannot be instantiated: .*damaged"), (another, "holds no binary for"),
        (no_library, "cannot be loaded"), (no_description, "or is damaged .it is no XML"),
    ):  # fmt: skip
        path = rewritten(good.path, tmp_path / "bad.fmu", change)
        refused(words, path, speed_feedback(), H)
        with pytest.raises(mv.ExportError, match=words):
            state_space_of_unit(path)


def test_units_of_the_first_version(tmp_path):
    """A whole description of FMI 1.0 is refused for its version, not for what else it lacks."""
    text = ('<fmiModelDescription fmiVersion="1.0" modelName="m" modelIdentifier="m" guid="g" '
            'numberOfContinuousStates="0" numberOfEventIndicators="0"><ModelVariables/></fmiModelDescription>')
    with zipfile.ZipFile(tmp_path / "old.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", text)
    refused(r"old\.fmu: is an FMU of FMI 1\.0; expected 2\.0 or 3\.0", tmp_path / "old.fmu", speed_feedback(), H)


@pytest.mark.slow
@pytest.mark.parametrize(("lacks", "message"), [
    (("maxOutputDerivativeOrder", "canGetAndSetFMUstate"),
     {"slopes": "'law' gives no derivatives of outputs", "iteration": "'law' does not support repeated steps"}),
    (("canInterpolateInputs",),
     dict.fromkeys(("slopes", "iteration"), "'law' takes no inputs that vary within a step"))])
def test_masters_that_a_unit_cannot_follow_are_left_out(lacks, message, tmp_path):
    """Unless they were asked for by name."""
    law = mx.to_fmu(speed_feedback(), tmp_path / "law.fmu", "2.0")

    def less(name, content):
        if name.endswith("Description.xml"):
            content = re.sub(rb' (%s)="\w+"' % "|".join(lacks).encode(), b"", content)
        return content

    unit = rewritten(law.path, tmp_path / "less.fmu", less)
    result = mx.check_cosimulation(plant(), unit, H, duration=H)
    assert [item.method for item in result.masters] == ["jacobi", "gauss-seidel"]
    assert result.remarks == tuple(f"Left out: {method}, as {why}." for method, why in message.items())
    for method, why in message.items():
        refused(f"'{method}' is not possible, as {why}", plant(), unit, H, masters=method)


def test_reading_back_gives_every_bit_and_the_names(tmp_path):
    """An input and an output of one name: the file calls the output something else, the reader does not."""
    law = control.ss([[-3.0]], [[2.0]], [[0.1]], [[0.7]], inputs=["u"], outputs=["u"], name="law")
    for version in ("2.0", "3.0"):
        file = mx.to_fmu(law, tmp_path / "law.fmu", version)
        assert file.names["output"] == {"u": "u (output)"}
        space = state_space_of_unit(file)
        assert (space.inputs, space.outputs) == (("u",), ("u",))
        assert [space.A[0, 0], space.B[0, 0], space.C[0, 0], space.D[0, 0]] == [-3.0, 2.0, 0.1, 0.7]


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    return mx.to_fmu(plant(), tmp_path_factory.mktemp("unit") / "good.fmu", "2.0").path.read_bytes()


@pytest.mark.slow
@given(place=st.floats(0, 1, exclude_max=True), bits=st.integers(1, 255), cut=st.booleans())
def test_spoilt_archives_are_refused_or_as_they_were(content, place, bits, cut):
    """Any byte changed, or all behind it missing; what still opens answers as before."""
    k = int(place * len(content))
    spoilt = content[:k] if cut else content[:k] + bytes([content[k] ^ bits]) + content[k + 1 :]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bad.fmu"
        path.write_bytes(spoilt)
        try:
            space = state_space_of_unit(path)
        except mv.ExportError:
            return
        np.testing.assert_array_equal(space.A, plant().state_space().A)


def test_fmpy_logs_of_its_own_are_left_alone(tmp_path, capfd):
    """A unit of FMI 2 that is driven through fmpy afterwards says what is wrong, as before."""
    from tests.export.fmu.drive import Unit

    file = mx.to_fmu(plant(), tmp_path / "plant.fmu", "2.0")
    mx.check_cosimulation(file, speed_feedback(), H, masters="jacobi", duration=H)
    made = Unit(file, tmp_path / "unit")
    with pytest.raises(Exception, match="fmi2DoStep failed"):
        made.step(0.0, H)
    made.fmu.freeInstance()
    assert "not allowed in this order of calls" in capfd.readouterr().out
