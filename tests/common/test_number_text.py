"""Numbers in texts: what Python alone takes for a number, and no file format does, is refused by every reader."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library, studies
from mbsvib.common.file_content import ContentError
from mbsvib.common.number_text import integer, nastran_integer, nastran_real, real
from mbsvib_export.uff_records import data_sets
from tests.support.cli import invoke

# the last two have digits of other scripts
ODD = ["1_0", "nan", "inf", "-Infinity", "0x10", "1e999", "", "１０", "٣"]


@pytest.mark.parametrize("text", ODD)
@pytest.mark.parametrize("read", [real, integer, nastran_real])
def test_a_number_for_python_only(read, text):
    with pytest.raises(ValueError, match=r"number|integer"):
        read(text)


@pytest.mark.parametrize(("text", "value"), [("10", 10.0), (" -.5e1\t", -5.0), ("+2.", 2.0), ("1E-3", 1e-3)])
def test_numbers(text, value):
    assert real(text) == nastran_real(text) == value
    assert integer(" +17 ") == nastran_integer("+17") == 17
    assert nastran_integer("  ") == 0
    assert nastran_real("1.5D+3") == nastran_real("1.5+3") == 1500.0


@pytest.mark.parametrize("text", ODD)
def test_urdf(tmp_path, text):
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="{text}"/>'
                    '<inertia ixx="1" iyy="1" izz="1"/></inertial></link><joint name="j" type="revolute">'
                    '<parent link="base"/><child link="arm"/></joint></robot>', encoding="utf-8")  # fmt: skip
    with pytest.raises(mv.ModelError, match=r"link 'arm': value = .*expected 1 finite number"):
        mv.load_urdf(path)


@pytest.mark.parametrize("text", ["1_0", "１０", "1_0.5"])
def test_files_of_lines(text):
    with pytest.raises(ContentError, match=r"is not (an integer|a number)"):
        next(data_sets(f"    -1\n  {text}\n    -1\n".encode()))


@pytest.mark.parametrize("option", ["--from 1_0", "--to nan", "--from inf", "--to １０"])
def test_options_of_commands(option):
    result = invoke(["bode", "quarter_car", *option.split()])
    assert (result.exit_code, "expected a number" in result.stderr) == (2, True)


@pytest.mark.parametrize("line", ["sweep quarter_car tyre.stiffness=1e5:2e5:1_0", "modes C１0RF1"])
def test_words_of_commands(line):
    assert invoke(line.split()).exit_code == 2


@pytest.mark.parametrize("size", ["１0", "9" * 5000], ids=["script", "long"])
def test_names_of_chains(size):
    with pytest.raises(mv.ModelError, match="there is no model"):
        library.build(f"C{size}RF1")


def test_tolerances():
    with pytest.raises(mv.ModelError, match="1_0 %"):
        studies.tolerances(library.quarter_car(), {"tyre.stiffness": "1_0 %"}, of=studies.frequency(1))


def test_arguments_are_numbers_and_no_texts():
    """numpy and float() alone take "1_0" for 10, and True for 1."""
    model = library.quarter_car()
    system = model.linearize()
    calls = [
        lambda: mv.StateSpace.from_arrays([["1_0"]], [[1.0]], [[1.0]], 0),
        lambda: mv.StateSpace.from_arrays(np.array([[1.0, b"2"]] * 2, dtype=object), [[1.0]] * 2, [[1.0, 1.0]], 0),
        lambda: system.frequency_response(["1_0"]),
        lambda: studies.sweep(model, {"tyre.stiffness": ["1_0"]}, of={"f": studies.frequency(1)}),
        lambda: model.linearize(values={"tyre.stiffness": ["1_0"]}),
        lambda: mv.Model("m").add_body("b", 1.0, [1, 1, 1], position=["1_0", 0, 0]),
        lambda: mv.Model("m").add_body("b", b"1_0", [1, 1, 1]),
        lambda: model.simulate([0.0, 1.0], inputs={"road": ["0", "1_0"]}),
    ]
    for call in calls:
        with pytest.raises((mv.ModelError, mv.ResponseError), match=r"expected .*number"):
            call()
