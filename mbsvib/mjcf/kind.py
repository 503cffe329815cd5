"""Type of an XML file by its root element: MJCF, URDF or another one."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree

from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from os import PathLike


def root_of(path: str | PathLike[str]) -> str:
    """Return the name of an XML file's root element.

    Parameters
    ----------
    path : str or path-like
        The file.

    Returns
    -------
    str
        Its name, such as "mujoco" or "robot".

    Raises
    ------
    ModelError
        If the file cannot be read or is no XML.
    """
    try:
        with open(path, "rb") as stream:
            for _, element in ElementTree.iterparse(stream, events=("start",)):
                return str(element.tag)
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror or error}.", element=str(path)) from error
    except ElementTree.ParseError as error:
        raise ModelError(f"{path}: no XML: {error}.", element=str(path)) from error
    return ""


def check_kind(path: str | PathLike[str]) -> None:
    """Refuse files other than MJCF.

    Parameters
    ----------
    path : str or path-like
        The file.

    Raises
    ------
    ModelError
        If it cannot be read, or is something else.
    """
    tag = root_of(path)
    if tag == "robot":
        raise ModelError(f"{path}: the file's element is <robot>, a URDF; read it by load_urdf.", element=str(path))
    if tag != "mujoco":
        raise ModelError(f"{path}: the file's element is <{tag}>; expected <mujoco>, as MJCF has it.",
                         element=str(path))  # fmt: skip
