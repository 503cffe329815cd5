"""Run the Python of a page: its pictures come from that, and what it prints is held to what the page shows.

A hook of mkdocs, and what ``tests/test_docs.py`` calls. A block of text right after a block of Python is its output.
"""

from __future__ import annotations

import re
from contextlib import chdir, redirect_stdout
from importlib.util import module_from_spec, spec_from_file_location
from io import StringIO
from pathlib import Path
from typing import Any

PAGES = Path(__file__).parent / "pages"
BLOCK = re.compile(r"^```python\n(?P<code>.*?)^```$(?:\n\n?^```text\n(?P<shown>.*?)^```$)?", re.DOTALL | re.MULTILINE)
PICTURES = "pictures"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
ROUNDING = 1e-9  # numbers below are nothing but that, and other machines round otherwise


def run(page: Path, folder: Path) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Run the blocks of a page in order, in a folder; return its names, and what blocks printed and should have."""
    text = page.read_text(encoding="utf-8")
    space: dict[str, Any] = {"__name__": "page"}
    pairs = []
    with chdir(folder):
        for block in BLOCK.finditer(text):
            printed = StringIO()
            with redirect_stdout(printed):
                exec(compile(block["code"], page.name, "exec"), space)
            if block["shown"] is not None:
                pairs.append((printed.getvalue(), block["shown"]))
    return space, pairs


def same(printed: str, shown: str) -> bool:
    """Whether two texts say the same: equal words, and numbers that agree within what is shown of them."""
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=False)
    near = all(a == b or abs(float(a) - float(b)) <= max(ROUNDING, 2e-5 * abs(float(b))) for a, b in pairs)
    return near and NUMBER.sub("0", printed) == NUMBER.sub("0", shown)


def on_pre_build(config: Any) -> None:
    """Run all pages, so that their pictures are there when the site is built."""
    import matplotlib as mpl

    mpl.use("agg")
    folder = Path(config["docs_dir"]) / PICTURES
    folder.mkdir(exist_ok=True)
    for page in sorted(PAGES.rglob("*.md")):
        for printed, shown in run(page, folder)[1]:
            if not same(printed, shown):
                raise ValueError(f"{page.name} shows\n{shown}\nbut prints\n{printed}")
    _draw_gallery(folder / "gallery")


def _draw_gallery(folder: Path) -> None:
    """Draw the examples; the page of the gallery names each picture, so that mkdocs tells which is missing."""
    spec = spec_from_file_location("docs_gallery", Path(__file__).with_name("gallery.py"))
    if spec is None or spec.loader is None:
        raise ImportError("gallery.py is not beside run.py.")
    gallery = module_from_spec(spec)
    spec.loader.exec_module(gallery)
    for example in [path for path in gallery.EXAMPLES if gallery.needs(path) is None]:
        with redirect_stdout(StringIO()):
            gallery.draw(example, folder)
