"""The documentation keeps its word: its Python runs, prints what is shown, and pictures, links and names are there."""

import ast
import inspect
import re
import shlex
import textwrap
import tomllib
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import matplotlib as mpl
import pytest

import mbsvib as mv
from mbsvib.api.elsewhere import Elsewhere
from tests.support.cli import invoke

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted((DOCS / "pages").rglob("*.md"))
SLOW = {"accuracy", "control", "flexible", "howto", "isolation", "machines", "measurement", "motion", "noise",
        "roads", "robots", "rotors", "seeing", "studies", "tools", "tour", "trust", "tuning", "uncertain",
        "workspace"}  # fmt: skip
RUN = [pytest.param(page, marks=pytest.mark.slow if page.stem in SLOW else ()) for page in PAGES]


def _script(name):
    spec = spec_from_file_location(f"docs_{name}", DOCS / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


RUNNER, GALLERY, REFERENCE = _script("run"), _script("gallery"), _script("reference_pages")


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_pages_print_what_they_show_and_draw_their_pictures(page, tmp_path):
    mpl.use("agg")
    text = page.read_text(encoding="utf-8")
    _, pairs = RUNNER.run(page, tmp_path)
    for printed, shown in pairs:
        assert RUNNER.same(printed, shown), printed
    assert len(pairs) == text.count("```text")
    for picture in re.findall(r"\]\([./]*pictures/(?!gallery/)([^)]+)\)", text):
        assert (tmp_path / picture).stat().st_size > 2000, picture


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        assert target.startswith("https://") or (page.parent / target).exists(), target


def test_pictures_are_those_of_the_pages_and_small():
    folder = DOCS / "pages" / RUNNER.PICTURES
    pictures = [path for path in folder.rglob("*") if path.is_file()]
    assert sorted(path.relative_to(folder).as_posix() for path in pictures) == RUNNER.named(), "run: python docs/run.py"
    assert sum(path.stat().st_size for path in pictures) < 3e6


def test_every_page_is_in_the_table_of_contents():
    config = (DOCS / "mkdocs.yml").read_text(encoding="utf-8")
    assert sorted(re.findall(r": (\S+\.md)$", config, re.MULTILINE)) == sorted(
        page.relative_to(DOCS / "pages").as_posix() for page in PAGES)  # fmt: skip


def test_what_the_reference_names_exists():
    full = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    named = re.findall(r"^::: (\S+)$", full, re.MULTILINE)
    assert len(named) > 15
    for name in named:
        home, _, last = name.rpartition(".")
        try:
            import_module(name)
        except ModuleNotFoundError:
            assert hasattr(import_module(home), last), name


@pytest.mark.parametrize("home", [mv.System, mv.StateSpace])
def test_every_field_of_systems_has_words_in_the_reference(home):
    """The reference shows fields with a text below them; those of systems had none, M, C and K among them."""
    fields = {}
    for layer in reversed(home.__mro__[:-1]):
        body = ast.parse(textwrap.dedent(inspect.getsource(layer))).body[0].body
        for item, after in zip(body, [*body[1:], None], strict=True):
            if isinstance(item, ast.AnnAssign) and item.target.id in home.__dataclass_fields__:
                words = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                fields[item.target.id] = words or fields.get(item.target.id, False)
    public = [name for name in home.__dataclass_fields__ if not name.startswith("_")]
    assert len(public) > 12
    assert [name for name in public if not fields.get(name)] == []


def test_names_in_the_table_of_terms_exist():
    """First column of the table: adders and methods of models, systems and modes, functions and exporters."""
    import mbsvib as mv
    import mbsvib_export as mx

    text = (DOCS / "pages" / "coming_from.md").read_text(encoding="utf-8")
    first = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    names = [name for cell in first for name in re.findall(r"`([a-zA-Z_]+)[`(]", cell)]
    assert len(names) > 15
    homes = (mv, mv.Model, mv.System, mv.Modes, mx)
    for name in names:
        assert any(hasattr(home, name) for home in homes), name


@pytest.mark.slow
def test_commands_work(tmp_path, monkeypatch):
    pytest.importorskip("plotly", reason="plotly is not installed (extra 'report')")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_bytes((DOCS.parent / "examples" / "robots" / "arm.urdf").read_bytes())
    used = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        named = r"`(\w+\.(?:yaml|json))`:\n\n```\w+\n(.*?)^```$"
        for name, content in re.findall(named, text, re.DOTALL | re.MULTILINE):
            (tmp_path / name).write_text(content, encoding="utf-8")
        for block in re.findall(r"^```bash\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
            for line in block.splitlines():
                result = invoke(shlex.split(line)[1:])
                assert result.exit_code == 0, f"{line}\n{result.stderr}"
                used.add(shlex.split(line)[1])
    assert used >= {"models", "modes", "bode", "step", "check", "export", "schema", "loop", "budget", "robust", "tune"}
    for name in ("isolation.png", "table-step.png", "table.npz", "stewart.yaml", "tuned.json"):
        assert (tmp_path / name).exists()


def test_the_gallery_is_of_the_examples(tmp_path):
    assert GALLERY.PAGE.read_text(encoding="utf-8") == GALLERY.page(), "run: python docs/gallery.py"
    example = tmp_path / "example.py"
    example.write_text('"""A title.\n\nWhich one? This one. As is known (O. Nishihara, T. Asami, 2002): r =\n"""\n')
    assert GALLERY.description(example) == ("A title", "Which one? This one.")
    pictures = re.findall(r"pictures/gallery/(\w+)\.png", GALLERY.page())
    assert pictures == [path.stem for path in GALLERY.EXAMPLES if not GALLERY.needs(path)]
    example = next(path for path in GALLERY.EXAMPLES if path.stem == "inclined_chain")
    assert GALLERY.draw(example, tmp_path).stat().st_size > 10_000


def test_an_example_whose_extra_is_missing_has_a_picture_that_says_so(tmp_path):
    example = tmp_path / "needy.py"
    example.write_text("from mbsvib import ExportError\nraise ExportError('pip install \"mbsvib[rare]\"')\n")
    assert GALLERY.draw(example, tmp_path).stat().st_size > 500
    example.write_text("from mbsvib import ExportError\nraise ExportError('wrong')\n")
    with pytest.raises(mv.ExportError, match="wrong"):
        GALLERY.draw(example, tmp_path)


@pytest.mark.parametrize("name", REFERENCE.PAGES)
def test_pages_that_are_made_of_the_program_are_up_to_date(name):
    page = (REFERENCE.FOLDER / name).read_text(encoding="utf-8")
    assert page == REFERENCE.PAGES[name](), "run: python docs/reference_pages.py"


def test_names_beside_words_of_matlab_exist():
    """Columns behind the first: names of mbsvib and of the exporters with their module, others on a model or a result.
    """
    import control

    import mbsvib_export as mx
    from mbsvib.api.family import Family
    from mbsvib.api.loops import ClosedLoop
    from mbsvib.api.running import Cycle
    from mbsvib.feedback.margins import Margins
    from mbsvib.fitting.result import Fit
    from mbsvib.tuning.tuning import Design
    from mbsvib.uncertain.plant import UncertainPlant

    text = (DOCS / "pages" / "coming_from_matlab.md").read_text(encoding="utf-8")
    cells = [cell for line in text.splitlines() if line.startswith("| `") for cell in line.split("|")[2:]]
    homes = {"control": control, "family": Family, "cycle": Cycle, "data": mv.Measurement,
             "mv": mv, "mx": mx, "system": mv.System, "model": mv.Model, "loop": ClosedLoop, "margins": Margins,
             "fit": Fit, "plant": UncertainPlant, "space": mv.StateSpace, "design": Design,
             "study": mv.isolation.Isolation, "plots": mv.plots, "isolation": mv.isolation}  # fmt: skip
    named = [name for cell in cells for name in re.findall(r"`((?:\w+\.)+\w+)", cell)]
    assert len(named) > 80
    for name in named:
        home, *path = name.split(".")
        there = homes[home]
        for word in path:
            assert hasattr(there, word) or word in getattr(there, "__dataclass_fields__", {}), name
            there = getattr(there, word, None)


def _members(name):
    """The public members of a class that mbsvib defines; parts of models show what they are made of only."""
    home, _, last = name.rpartition(".")
    try:
        kind = getattr(import_module(home or "mbsvib"), last, None)
    except ModuleNotFoundError:  # a member
        return set()
    if not isinstance(kind, type) or home.startswith("mbsvib.elements"):
        return set()
    own = [base for base in kind.__mro__ if base.__module__.startswith("mbsvib")]
    return {member for base in own for member in {*vars(base), *vars(base).get("__annotations__", {})}
            if not member.startswith("_") and not isinstance(vars(base).get(member), Elsewhere)}  # fmt: skip


@pytest.mark.slow
def test_the_site_is_built(tmp_path):
    """With all warnings as errors: of links, of names in the reference, of docstrings."""
    pytest.importorskip("mkdocstrings", reason="mkdocs is not installed (extra 'docs')")
    import os
    import subprocess
    import sys

    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-f", DOCS / "mkdocs.yml", "-d", tmp_path],
        capture_output=True, text=True, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "pictures" / "mechanism.png").exists()
    drawn = {path.stem for path in (tmp_path / "pictures" / "gallery").glob("*.png")}
    assert drawn >= {path.stem for path in GALLERY.EXAMPLES if not GALLERY.needs(path)}
    pages = (tmp_path / "reference").glob("*/index.html")
    full = {name for page in pages for name in re.findall(r'id="(mbsvib[^"]*)"', page.read_text(encoding="utf-8"))}
    rendered = {name.rpartition(".")[2] for name in full}
    parts, words = ("studies", "library", "plots", "isolation", "report"), ("tunable", "goals")
    for word in words:
        assert {f"mbsvib.tuning.{word}.{name}" for name in import_module(f"mbsvib.tuning.{word}").__all__} <= full
    for package in ("mbsvib", *(f"mbsvib.{part}" for part in parts), "mbsvib_export"):
        public = set(import_module(package).__all__) - {"__version__", *parts, *words}
        assert public <= rendered, f"{package}: not in the reference: {sorted(public - rendered)}"
    missing = {f"{name}.{member}" for name in full for member in _members(name)} - full
    assert not missing, f"not in the reference: {sorted(missing)}"


def test_the_architecture_page_lists_the_layers_of_the_contract():
    """In the order that import-linter holds, and each with its folder."""
    contract = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    faces = {"__main__", "beams", "campbell", "superelements"}
    stated = [name for line in contract["contracts"][0]["layers"] for name in line.split(" | ") if name not in faces]
    page = (DOCS / "pages" / "architecture.md").read_text(encoding="utf-8")
    layers = page[page.index("## The layers") : page.index("## Data and verbs")]
    rows = re.findall(r"^\| (`[^|]*) \|", layers, re.MULTILINE)
    assert [name for row in rows for name in re.findall(r"`(\w+)`", row)] == stated
    picture = (DOCS / "pages" / "diagrams" / "layers.svg").read_text(encoding="utf-8")
    assert re.findall(r'class="layer">(\w+)<', picture) == [name for name in stated if name != "version"]
    for name in re.findall(r"`((?:\w+/)+\w+\.py)`", page):
        assert any((DOCS.parent / base / name).exists() for base in ("mbsvib", "export/mbsvib_export", "")), name
