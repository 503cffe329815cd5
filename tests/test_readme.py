"""The README keeps its word: its Python runs, its YAML is the same model, its commands work, its pictures are there."""

import re
import shlex
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import mbsvib as mv
from tests.support.cli import invoke

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
MOST_BYTES = 150_000


def blocks(language):
    return [text for name, text in BLOCKS if name == language]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the README's model file and controller."""
    path = tmp_path_factory.mktemp("readme")
    (path / "damper.json").write_text(blocks("json")[0], encoding="utf-8")
    (path / "table.yaml").write_text(blocks("yaml")[0], encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def names(folder):
    """The names that are there after all blocks of Python, in order."""
    mpl.use("agg")
    from matplotlib import pyplot as plt

    space = {"__name__": "readme"}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for text in blocks("python"):
            exec(compile(text, "README.md", "exec"), space)
    yield space
    plt.close("all")


def test_the_python_runs(names, folder):
    system = names["system"]
    assert system.dof == 7
    assert names["G"].shape == (2, 2, 3)
    assert names["y"].shape == (2, 2001)
    assert names["plant"].input_labels == ["floor", "motor"]
    assert names["space"].states[0] == "hinge.rz"
    assert (folder / "isolation.png").stat().st_size > 10_000
    # at rest the table follows the floor
    assert abs(system.frequency_response([0.0])[0, 0, 0]) == pytest.approx(1.0, rel=1e-9)


def test_the_table_shown_is_the_one_printed(names):
    shown = blocks("text")[0].splitlines()
    assert str(names["system"].modes()).splitlines()[: len(shown)] == shown


def test_the_lamp_hangs_as_shown(names):
    result, held = names["found"], names["held"]
    frequency = [model.linearize().modes().frequencies[0] for model in (result.model, held)]
    shown = f"{result.displacements['arm'][4]:+.4f} rad, {frequency[0]:.4f} Hz\n" \
            f"{held.springs['spring'].preload:.3f} N, {frequency[1]:.4f} Hz\n"  # fmt: skip
    assert shown in blocks("text")
    with pytest.raises(mv.EquilibriumError, match=r"on body 'arm', .* missing"):
        names["raised"].linearize()


def test_the_isolation_is_as_shown(names):
    result = names["design"].optimum
    assert result.success
    assert f"{result.began:.3f} m/s^2 before, {result.objective:.3f} m/s^2 after\n" in blocks("text")
    assert names["loop"].stable


def test_the_studies_end_as_shown(names):
    best, off = names["best"], names["off"]
    shown = f"{best.objective:.4f} instead of {best.began:.4f}\n{off.first.round(2)}\n"
    assert best.success
    assert shown in blocks("text")
    assert np.allclose(off.std, off.first, rtol=0.05)


def test_the_mast_sways_as_shown(names):
    shown = re.search(r"frequencies\.round\(4\)\) +# \[(.*?)\]", README)
    assert list(map(float, shown[1].split())) == names["mast"].linearize().modes(3).frequencies.round(4).tolist()


def test_the_yaml_is_the_same_model(names, folder):
    model, system = mv.load(folder / "table.yaml"), names["system"]
    other = model.linearize()
    assert repr(model) == repr(names["model"])
    for matrix in ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D"):
        np.testing.assert_array_equal(getattr(other, matrix), getattr(system, matrix))
    assert (other.inputs, other.outputs, other.coordinates) == (system.inputs, system.outputs, system.coordinates)


def test_the_mistake_shown_is_answered_as_shown(folder, monkeypatch):
    words = (folder / "table.yaml").read_text(encoding="utf-8")
    (folder / "typo").mkdir()
    monkeypatch.chdir(folder / "typo")
    Path("table.yaml").write_text(words.replace("second: mirror,", "second: miror,"), encoding="utf-8")
    with pytest.raises(mv.ModelError) as error:
        mv.load("table.yaml")
    assert str(error.value) in " ".join(README.split())


@pytest.mark.slow
def test_the_commands_work(names, folder, monkeypatch):
    monkeypatch.chdir(folder)
    lines = [line for text in blocks("bash") for line in text.splitlines() if line.startswith("mbsvib ")]
    assert {line.split()[1] for line in lines} >= {"models", "modes", "bode", "step", "check", "export", "schema"}
    for line in lines:
        result = invoke(shlex.split(line)[1:])
        assert result.exit_code == 0, f"{line}\n{result.stderr}"
    for name in ("isolation.png", "table-step.png", "table.npz", "stewart.yaml"):
        assert (folder / name).exists()


def test_the_set_up_is_one_command_each():
    assert [text for text in blocks("bash") if "pip" in text] == [
        "pip install uv && uv run --no-dev mbsvib demo\n", "pip install uv && uv run pytest\n",
    ]  # fmt: skip
    # without the development group, which is six times as large
    assert re.findall(r"uv run (?!--no-dev |pytest)\S+", README) == []


def test_pictures_and_links_are_there_and_small():
    targets = re.findall(r"\]\(([^)#]+)\)", README)
    assert targets
    for target in targets:
        path = ROOT / target
        assert path.exists(), target
        if path.suffix == ".png":
            assert path.stat().st_size < MOST_BYTES


def test_no_address_or_path_of_a_machine():
    for word in ("http://", "/home/", "/root/", "/tmp/"):
        assert word not in README
