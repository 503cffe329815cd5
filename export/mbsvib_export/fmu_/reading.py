"""FMUs of mbsvib as data: description and numbers, without loading a binary.

resources/model.lti holds the numbers that the binary computes with (``matrices`` has its layout), the description the
names. A checksum and a token, made of both, say whether they are as they were written.
"""

from __future__ import annotations

import hashlib
import os
import re
import struct
import zipfile
import zlib
from xml.etree.ElementTree import Element
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.linalg import block_diag

from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_path
from mbsvib.common.file_content import LARGEST_UNPACKED, ContentError, content_of, read_xml
from mbsvib.common.number_text import real
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.fmu_.matrices import MAGIC
from mbsvib_export.fmu_.names import original_outputs
from mbsvib_export.reading import archive_of, unpacked

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")
_DESCRIPTION, _NUMBERS = "modelDescription.xml", "resources/model.lti"
_TOKENS = {"2.0": "guid", "3.0": "instantiationToken"}
_HEAD, _SIZES, _TOKEN = 16, 48, 64
# Bytes of a description; that of a thousand states with all their dependencies has five million.
LARGEST_DESCRIPTION = 100_000_000


def description_of(path: str | os.PathLike[str]) -> Element:
    """Return the description of any FMU after checking archive and identifiers; nothing is unpacked to the disk."""
    return _opened(path)[0]


def state_space_in(path: str | os.PathLike[str]) -> tuple[StateSpace, tuple[str, ...]]:
    """Return the state space in an FMU of ``to_fmu``, parameters at start values, and the folders of its binaries."""
    file = os.fspath(path)
    top, text, content, platforms = _opened(path)
    if content is None:
        raise ExportError(f"{file}: has no {_NUMBERS}, so that mbsvib has not written it; its equations are known by "
                          f"running it only: check_export(..., run=True), if you trust its origin.")  # fmt: skip
    version = top.get("fmiVersion", "")
    if version not in _TOKENS:
        raise ExportError(f"{file}: is an FMU of FMI {version!r}; expected 2.0 or 3.0.")
    try:
        variables = _variables(top)
        starts = [real(start) for _, _, start in variables["parameter"]]
        token = top.get(_TOKENS[version], "")
        a, b, c, d = _matrices(content, token, text, [len(item) for item in variables.values()], starts)
    except (ContentError, ValueError, struct.error, np.linalg.LinAlgError) as error:
        raise ExportError(f"{file}: {error}. The file is damaged, or was changed after it was written; export it "
                          f"again.") from error  # fmt: skip
    inputs, input_units, outputs, output_units, states, state_units = (
        tuple(item[k] for item in variables[kind]) for kind in ("input", "output", "state") for k in (0, 1))
    space = StateSpace(top.get("modelName", ""), "unit", a, b, c, d, np.eye(len(a)), states, state_units, inputs,
                       input_units, original_outputs(outputs, inputs), output_units)  # fmt: skip
    return space, platforms


def _opened(path: str | os.PathLike[str]) -> tuple[Element, str, bytes | None, tuple[str, ...]]:
    """The description as tree and text, the file of numbers, and the folders of binaries."""
    file = os.fspath(a_path(path, "check_export", ExportError))
    raw = content_of(file, ExportError, "an FMU")
    try:
        with archive_of(raw) as archive:
            _check_size(archive, file)
            names = archive.namelist()
            if _DESCRIPTION not in names:
                raise ContentError("there is none")
            text = unpacked(archive, _DESCRIPTION)
            content = unpacked(archive, _NUMBERS) if _NUMBERS in names else None
        top = read_xml(text)
    except ContentError as error:
        raise ExportError(f"{file}: is no archive with a modelDescription.xml in it, or is damaged ({error}); export "
                          f"it again.") from error  # fmt: skip
    if top.tag != "fmiModelDescription":
        raise ExportError(f"{file}: the description's element is <{top.tag}>; expected <fmiModelDescription>.")
    for kind in ("ModelExchange", "CoSimulation", "ScheduledExecution"):
        for element in top.findall(kind):
            _check_identifier(element.get("modelIdentifier", ""), file)
    platforms = dict.fromkeys(name.split("/")[1] for name in names if re.fullmatch(r"binaries/[^/]+/[^/]+", name))
    return top, text.decode("utf-8", "replace"), content, tuple(platforms)


def _check_size(archive: zipfile.ZipFile, file: str) -> None:
    """Refuse an archive that would fill memory or disk, before anything is unpacked."""
    entries = archive.infolist()
    described = sum(entry.file_size for entry in entries if entry.filename == _DESCRIPTION)
    if described > LARGEST_DESCRIPTION:
        raise ExportError(f"{file}: its {_DESCRIPTION} has {described / 1e6:.3g} MB; expected at most "
                          f"{LARGEST_DESCRIPTION / 1e6:.3g} MB. Nothing was unpacked.")  # fmt: skip
    size = sum(entry.file_size for entry in entries)
    if size > LARGEST_UNPACKED:
        raise ExportError(f"{file}: holds {len(entries)} files of {size / 1e9:.3g} GB together; expected at most "
                          f"{LARGEST_UNPACKED / 1e9:.3g} GB, as an FMU has. Nothing was unpacked.")  # fmt: skip


def _check_identifier(identifier: str, file: str) -> None:
    """Refuse what is no C name: the binary is named after it, and a path would lead out of the archive."""
    if not IDENTIFIER.fullmatch(identifier):
        raise ExportError(f"{file}: modelIdentifier = {identifier!r}; expected the name of a C function, of letters, "
                          f"digits and underscores. Nothing of it was run.")  # fmt: skip


def _variables(top: Element) -> dict[str, list[tuple[str, str, str]]]:
    """Name, unit and start value of the variables by their kind, which stand in the order of the matrices."""
    listed = []
    for element in top.iterfind("ModelVariables/*"):
        number = element.find("Real") if element.tag == "ScalarVariable" else element
        if number is None or number.tag not in ("Real", "Float64"):
            raise ContentError(f"the variable {element.get('name')!r} is of another type than Real or Float64")
        listed.append((element, number))
    states = {number.get("derivative") for _, number in listed}
    result: dict[str, list[tuple[str, str, str]]] = {"input": [], "output": [], "state": [], "parameter": []}
    for element, number in listed:
        causality = element.get("causality", "")
        role = "state" if causality == "local" and element.get("valueReference") in states else causality
        if role in result:
            result[role].append((element.get("name", ""), number.get("unit", ""), number.get("start", "")))
    return result


def _matrices(
    content: bytes, token: str, text: str, counts: list[int], starts: list[float]
) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D of the file of numbers, after comparing checksum, token and sizes; counts as in the description."""
    if len(content) < _HEAD + _SIZES + _TOKEN or content[:8] != MAGIC:
        raise ContentError(f"{_NUMBERS} is no file of to_fmu of this version")
    body = content[_HEAD + _SIZES + _TOKEN :]
    if struct.unpack("<Q", content[8:_HEAD])[0] != zlib.crc32(content[_HEAD:]):
        raise ContentError(f"the checksum of {_NUMBERS} is wrong")
    sizes = content[_HEAD : _HEAD + _SIZES]
    n, m, o, p, blocks, entries = struct.unpack("<6q", sizes)
    if content[_HEAD + _SIZES : _HEAD + _SIZES + _TOKEN].rstrip(b"\0") != token.encode():
        raise ContentError(f"{_DESCRIPTION} and {_NUMBERS} do not belong together: their tokens differ")
    written = text.replace(f"={quoteattr(token)}", '=""', 1)
    digest = hashlib.sha256(sizes + body + written.encode()).hexdigest()
    if token.strip("{}").replace("-", "") != digest[:32]:
        raise ContentError(f"{_DESCRIPTION} is not as it was written: its token is that of another text")
    if [m, o, n, p] != counts:
        raise ContentError(f"{_NUMBERS} has {m} inputs, {o} outputs, {n} states and {p} parameters, {_DESCRIPTION} "
                           f"{counts}")  # fmt: skip
    affine, k = bool(entries % 2), entries // 2
    integers = blocks + 1 + p + 1 + k
    if min(blocks, entries) < 0 or len(body) % 8 or integers > len(body) // 8:
        raise ContentError(f"sizes in {_NUMBERS} do not fit its bytes")
    integer_table = np.frombuffer(body[: 8 * integers], "<i8")
    real = np.frombuffer(body[8 * integers :], "<f8")
    if not np.isfinite(real).all():
        raise ContentError(f"{_NUMBERS} holds NaN or infinity")
    edges, first, indices = np.split(integer_table, [blocks + 1, blocks + p + 2])
    if edges[0] != 0 or edges[-1] != n or (np.diff(edges) < 1).any():
        raise ContentError(f"the blocks of {_NUMBERS} do not fit {n} states")
    squares = (np.diff(edges) ** 2).tolist()
    shapes = [(n, m), (o, n), (o, m), *([(n, n), (o, n)] if affine else [])]
    if len(real) != 2 * n + m + p + k + sum(squares) + sum(rows * columns for rows, columns in shapes):
        raise ContentError(f"{len(real)} numbers in {_NUMBERS} do not fit its sizes")
    _, _, _, values, slopes, numbers = np.split(real, np.cumsum([n, n, m, p, k]))
    if not np.array_equal(values, starts):
        raise ContentError("start values of parameters differ between the two files")
    if len(first) != p + 1 or first[0] != 0 or first[-1] != k or (np.diff(first) < 0).any():
        raise ContentError(f"the parameters of {_NUMBERS} do not fit their entries")
    if ((indices < 0) | (indices >= len(numbers))).any() or len(slopes) != k:
        raise ContentError(f"entries of parameters lie outside of the matrices in {_NUMBERS}")
    parts = np.split(numbers, np.cumsum([*squares, *(rows * columns for rows, columns in shapes)])[:-1])
    on_diagonal = [part.reshape(size, size) for part, size in zip(parts[:blocks], np.diff(edges), strict=True)]
    a = block_diag(*on_diagonal) if n else np.zeros((0, 0))
    b, c, d, *more = (part.reshape(shape) for part, shape in zip(parts[blocks:], shapes, strict=True))
    if more:  # E x' = A x + B u,  y = C x + F x' + D u
        e, f = more
        a, b = np.linalg.solve(e, a), np.linalg.solve(e, b)
        with np.errstate(all="ignore"):
            c, d = c + f @ a, d + f @ b
        if not all(np.isfinite(matrix).all() for matrix in (a, b, c, d)):
            raise ContentError("its mass matrix cannot be inverted")
    return a, b, c, d
