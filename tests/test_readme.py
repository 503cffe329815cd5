"""The README keeps its word: its Python runs, its table is the printed one, its pictures are there, and it is short."""

import re
from pathlib import Path

import matplotlib as mpl
import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
MOST_BYTES, MOST_LINES = 150_000, 150


def blocks(language):
    return [text for name, text in BLOCKS if name == language]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("readme")


@pytest.fixture(scope="module")
def names(folder):
    """The names that are there after all blocks of Python, in order."""
    mpl.use("agg")
    space = {"__name__": "readme"}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for text in blocks("python"):
            exec(compile(text, "README.md", "exec"), space)
    return space


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


def test_it_is_short():
    assert len(README.splitlines()) <= MOST_LINES


def test_no_address_or_path_of_a_machine():
    for word in ("http://", "/home/", "/root/", "/tmp/"):
        assert word not in README
