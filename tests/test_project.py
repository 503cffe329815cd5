"""What strangers and their assistants read first: recipes whose files exist, code that runs, citation and licences."""

import re
import tomllib
from pathlib import Path

import matplotlib as mpl
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation
from tests.test_docs import RUNNER

ROOT = Path(mv.__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
LLMS = (ROOT / "llms.txt").read_text(encoding="utf-8")


def test_files_of_the_recipes_exist():
    paths = re.findall(r"`((?:[\w.-]+/)+[\w.-]+)`", CONTRIBUTING)
    assert len(paths) > 30
    for path in paths:
        assert (ROOT / path).exists(), path


def test_names_in_the_recipes_are_in_their_files():
    """Tables and lists that a recipe tells to extend are in the file that it names."""
    for path, names in re.findall(r"\d\. `([\w/.]+)`: (?:its name in|a row of|its name and) ((?:`\w+`(?:, | and )?)+)",
                                  CONTRIBUTING):  # fmt: skip
        text = (ROOT / path).read_text(encoding="utf-8")
        for name in re.findall(r"`(\w+)`", names):
            assert re.search(rf"\b{name}\b", text), f"{path}: {name}"


def test_commands_of_the_set_up_are_those_of_ci():
    checks = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for command in ("uv run ruff check", "uv run lint-imports", "uv run mypy", "uv run pytest"):
        assert command in CONTRIBUTING
        assert command in checks


def test_code_for_assistants_prints_what_it_shows(tmp_path):
    mpl.use("agg")
    space, pairs = RUNNER.run(ROOT / "llms.txt", tmp_path)
    assert len(pairs) == LLMS.count("```text") >= 6
    for printed, shown in pairs:
        assert RUNNER.same(printed, shown), printed
    assert space["loop"].stable


def test_names_and_links_for_assistants_exist():
    for target in re.findall(r"\]\(([^)]+)\)", LLMS):
        assert (ROOT / target).exists(), target
    for name in re.findall(r"\bmx\.(\w+)", LLMS):
        assert hasattr(mx, name), name
    for name in re.findall(r"`(add_\w+)", LLMS):
        assert hasattr(mv.Model, name), name
    for kind in re.search(r"Kinds of joints: (.*?)\.", LLMS)[1].split():
        if kind not in ("screw", "universal"):  # which need a pitch, or two axes
            model = mv.Model("joint")
            model.add_body("b", 1.0, (1, 1, 1))
            model.add_joint("j", kind, "ground", "b", position=(0, 0, 0))
    assert isolation.study is not None


def test_citation_is_of_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {mv.__version__}\n" in text
    assert f"\nlicense: {PROJECT['license']}\n" in text
    from ruamel.yaml import YAML

    content = YAML(typ="safe").load(text)
    assert content["cff-version"] == "1.2.0"
    assert {"title", "message", "authors"} <= set(content)
    assert "Jiang" in {author["family-names"] for author in content["references"][0]["authors"]}


def test_addresses_of_the_project_are_stated():
    assert {"Homepage", "Changelog"} <= set(PROJECT["urls"])
    assert all(address.startswith("https://") for address in PROJECT["urls"].values())


def test_the_page_on_installation_has_every_extra_with_its_licence():
    page = (ROOT / "docs" / "pages" / "install.md").read_text(encoding="utf-8")
    lines = [line.strip("| ") for line in page.splitlines() if line.startswith("| ")]
    rows = [[cell.strip() for cell in line.split("|")] for line in lines]
    table = {row[0].strip("`"): row for row in rows}
    for extra, packages in EXTRAS.items():
        if extra in ("all", "bench", "test", "nastran"):  # for developers, or a sum
            continue
        row = table[extra]
        names = {re.split(r"[<>=\[]", package)[0] for package in packages}
        assert all(name in row[2] for name in names), f"{extra}: {names}"
        assert row[3]
    for extra, row in table.items():
        if extra in EXTRAS:
            assert (row[4] == "yes") == (extra in EXTRAS["all"][0]), extra
            assert "GPL" not in row[3].replace("LGPL", "") or row[4] == "no", extra
    core = " ".join(" ".join(row) for row in rows if row[0] == "–")
    for package in PROJECT["dependencies"]:
        name = re.split(r"[<>=]", package)[0]
        assert {"control": "python-control"}.get(name, name) in core


@pytest.mark.parametrize("package", ["imageio-ffmpeg", "slycot"])
def test_nothing_under_the_gpl_comes_with_all(package):
    everything = re.findall(r"\w+", EXTRAS["all"][0])
    assert package not in " ".join(" ".join(EXTRAS[extra]) for extra in everything if extra in EXTRAS)
