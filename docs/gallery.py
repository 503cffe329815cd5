"""The gallery: a page with each example's first figure and what it is about.

``python docs/gallery.py`` writes the page, ``pages/gallery.md``, which tests compare with the examples;
``python docs/run.py`` draws the pictures.
"""

from __future__ import annotations

import ast
import re
import runpy
from pathlib import Path

HERE = Path(__file__).parent
EXAMPLES = sorted((HERE.parent / "examples").glob("*.py"))
PAGE = HERE / "pages" / "gallery.md"
SENTENCE_END = re.compile(r"(?<!\b[A-Z])[.?](?=\s|$)")  # none after the initial of a name
INTRODUCTION = """\
# Gallery

The scripts in `examples/`. Each is a test as well: it asserts its numbers, and draws only when it is run, as in
`python examples/{first}.py`. The pictures are drawn by them.
"""


def description(path: Path) -> tuple[str, str]:
    """Return the title of an example and its first paragraph below, from its docstring."""
    title, _, rest = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")
    words = rest.strip().split("\n\n")[0]
    ends = [mark.end() for mark in SENTENCE_END.finditer(words)]
    return title.rstrip("."), words[: max(ends, default=0)]


def needs(path: Path) -> str | None:
    """Return the command by which what an example needs is installed, if that is not among the tests' packages.

    Its page has no picture, so that the site is built without that package.
    """
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    found = re.search(r"^Needs \w+: +(pip install .*)$", text, re.MULTILINE)
    return found[1] if found else None


def page() -> str:
    """Return the page."""
    parts = [INTRODUCTION.format(first=EXAMPLES[0].stem)]
    for path in EXAMPLES:
        title, words = description(path)
        command = needs(path)
        picture = f"![{title}](pictures/gallery/{path.stem}.png)" if command is None else f"It needs `{command}`."
        parts.append(f"## {title}\n\n{words}\n\n{picture}\n\n`examples/{path.name}`\n")
    return "\n".join(parts)


def draw(path: Path, folder: Path) -> Path:
    """Run an example, and write its first figure into a folder; where an extra is missing, what to install."""
    import matplotlib as mpl

    from mbsvib.errors import MbsvibError
    from mbsvib.plots import STYLE
    from mbsvib.plots._style import WIDEST, logarithmic

    mpl.use("agg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import LogLocator

    plt.show = lambda *_, **__: None
    plt.close("all")
    plt.style.use(STYLE)
    try:
        runpy.run_path(str(path), run_name="__main__")
    except (ImportError, MbsvibError) as error:
        if not isinstance(error, ImportError) and "pip install" not in str(error):
            raise
        plt.figure(figsize=(6.0, 1.0)).text(0.5, 0.5, f"Not drawn here.\n{error}", ha="center", va="center", wrap=True)
    picture = folder / f"{path.stem}.png"
    folder.mkdir(parents=True, exist_ok=True)
    figure = plt.figure(plt.get_fignums()[0])
    width, height = figure.get_size_inches()
    figure.set_size_inches(min(width, WIDEST), height)  # so that texts have 7 pt on the page
    for axis in [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]:
        if isinstance(axis.get_major_locator(), LogLocator):
            logarithmic(axis)
    figure.savefig(picture, dpi=100)
    plt.close("all")
    return picture


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
