"""Type of an XML file by its root element, MJCF, URDF or another one; and limits of what it asks memory for."""

from __future__ import annotations

from math import prod
from os import PathLike
from xml.etree.ElementTree import Element

from mbsvib.common.file_content import ContentError, content_of, read_xml
from mbsvib.errors import ModelError

# Numbers by which a short file asks for much memory, and their largest product: copies of elements (a model of ten
# thousand bodies is sparse already), and pixels of textures and height fields.
_COPIED = {"replicate": ("count",), "composite": ("count",), "flexcomp": ("count",)}
_MOST_COPIES = 10_000
_SIZED = {"hfield": ("nrow", "ncol"), "texture": ("width", "height")}
_LARGEST_FIELD = 100_000_000
# Of the element <size>: numbers, and bytes of memory.
_MOST_RESERVED, _MOST_MEMORY = 10_000_000, 2**31
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40, "P": 2**50, "E": 2**60}


def root_of(path: str | PathLike[str]) -> str:
    """Return the name of an XML file's root element, such as "mujoco" or "robot"."""
    return _read(path).tag


def _read(path: str | PathLike[str]) -> Element:
    try:
        return read_xml(content_of(path, lambda text: ModelError(text, element=str(path)), "an MJCF or URDF file"))
    except ContentError as error:
        raise ModelError(f"{path}: no XML that is read: {error}", element=str(path)) from error


def check_kind(path: str | PathLike[str]) -> None:
    """Refuse files other than MJCF, and those that ask for more memory than a mechanism needs.

    Files that it includes are left to MuJoCo.
    """
    top = _read(path)
    tag = top.tag
    if tag == "robot":
        raise ModelError(f"{path}: the file's element is <robot>, a URDF; read it by load_urdf.", element=str(path))
    if tag != "mujoco":
        raise ModelError(f"{path}: the file's element is <{tag}>; expected <mujoco>, as MJCF has it.",
                         element=str(path))  # fmt: skip
    _check_sizes(top, 1, path)


def _check_sizes(element: Element, copies: int, path: str | PathLike[str]) -> None:
    """Compare the numbers of copies, nested ones multiplied, and of pixels with their limits."""
    if element.tag in _COPIED:
        copies *= max(1, _product(element, _COPIED[element.tag]))
        if copies > _MOST_COPIES:
            raise _too_large(path, element, f"{copies} copies", _MOST_COPIES)
    if element.tag in _SIZED and _product(element, _SIZED[element.tag]) > _LARGEST_FIELD:
        raise _too_large(path, element, f"{_product(element, _SIZED[element.tag])} points", _LARGEST_FIELD)
    if element.tag == "size":
        for key, text in element.items():
            most = _MOST_MEMORY if key == "memory" else _MOST_RESERVED
            unit = text.strip()[-1:].upper()
            factor = _UNITS.get(unit, 1) if key == "memory" else 1
            if _number(text.strip().rstrip("KMGTPEkmgtpe")) * factor > most:
                raise _too_large(path, element, f"{key} = {text!r}", most)
    for child in element:
        _check_sizes(child, copies, path)


def _product(element: Element, keys: tuple[str, ...]) -> int:
    return prod(_number(word) for key in keys for word in element.get(key, "").split())


def _number(text: str) -> int:
    """The whole number at the beginning; what is none is left to MuJoCo, which refuses it."""
    try:
        return int(min(float(text), 1e18)) if text[:20].lower() != "nan" else 0
    except ValueError:
        return 0


def _too_large(path: str | PathLike[str], element: Element, size: str, most: int) -> ModelError:
    return ModelError(f"{path}: <{element.tag} name={element.get('name')!r}>: {size}; expected {most} at most. Remove "
                      f"it, or make it smaller.", element=element.get("name"), field=element.tag)  # fmt: skip
