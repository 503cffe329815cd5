"""Run the Python of a page: its pictures come from that, and what it prints is held to what the page shows.

A hook of mkdocs, and what ``tests/test_docs.py`` calls. A block of text right after a block of Python is its output.
``python docs/run.py`` draws all pictures of the pages anew, which takes some minutes.
"""

from __future__ import annotations

import re
from contextlib import chdir, redirect_stdout
from importlib.util import module_from_spec, spec_from_file_location
from io import StringIO
from pathlib import Path
from shutil import copyfile, rmtree
from tempfile import TemporaryDirectory
from typing import Any

PAGES = Path(__file__).parent / "pages"
BLOCK = re.compile(r"^```python\n(?P<code>.*?)^```$(?:\n\n?^```text\n(?P<shown>.*?)^```$)?", re.DOTALL | re.MULTILINE)
PICTURES = "pictures"
COLOURS = 48  # of pictures in the checkout
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
ROUNDING = 1e-9  # numbers below are nothing but that, and other machines round otherwise: pages show "…" in their place
TINY = re.compile(r"[-+]?\d\.\d+e-(?:1\d|[2-9]\d|\d{3})\b")


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
    printed = TINY.sub("…", printed)
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=False)
    near = all(a == b or abs(float(a) - float(b)) <= max(ROUNDING, 2e-5 * abs(float(b))) for a, b in pairs)
    return near and NUMBER.sub("0", printed) == NUMBER.sub("0", shown)


def check(folder: Path) -> None:
    """Run all pages in a folder, where their pictures are then, and hold them to what they print."""
    import matplotlib as mpl

    mpl.use("agg")
    for page in sorted(PAGES.rglob("*.md")):
        for printed, shown in run(page, folder)[1]:
            if not same(printed, shown):
                raise ValueError(f"{page.name} shows\n{shown}\nbut prints\n{printed}")


def on_pre_build(config: Any) -> None:
    """Hold all pages to what they print before the site is built of them and of the pictures in the checkout."""
    with TemporaryDirectory() as folder:
        check(Path(folder))


def named() -> list[str]:
    """Return the pictures that pages show, each once."""
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES.rglob("*.md"))
    return sorted(set(re.findall(rf"\]\([./]*{PICTURES}/([^)]+)\)", text)))


def draw() -> None:
    """Draw all pictures anew: those of pages, and one of each example."""
    with TemporaryDirectory() as name:
        drawn, folder = Path(name), PAGES / PICTURES
        check(drawn)
        _draw_gallery(drawn / "gallery")
        rmtree(folder, ignore_errors=True)
        for picture in named():
            (folder / picture).parent.mkdir(parents=True, exist_ok=True)
            _reduced(drawn / picture, folder / picture)


def _reduced(source: Path, target: Path) -> None:
    """Write a picture with few colours, so that all of them stay below 3 MB; motions are copied."""
    from PIL import Image

    if source.suffix != ".png":
        copyfile(source, target)
        return
    with Image.open(source) as picture:
        picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)


def _draw_gallery(folder: Path) -> None:
    """Draw the examples."""
    spec = spec_from_file_location("docs_gallery", Path(__file__).with_name("gallery.py"))
    if spec is None or spec.loader is None:
        raise ImportError("gallery.py is not beside run.py.")
    gallery = module_from_spec(spec)
    spec.loader.exec_module(gallery)
    for example in [path for path in gallery.EXAMPLES if gallery.needs(path) is None]:
        with redirect_stdout(StringIO()):
            gallery.draw(example, folder)


if __name__ == "__main__":
    draw()
