"""XML files of unknown origin: elements and attributes only, no document type, no entities, no deep nesting."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from mbsvib.common.file_content import ContentError

# Elements within each other; a chain of a hundred bodies in MJCF has as many. Recursion ends at about a thousand.
DEEPEST = 500
# Elements of a file, each of which takes a hundred bytes and a microsecond; five million pack into 20 kB. Robots of
# ten thousand bodies and units of a hundred thousand variables stay below.
MOST_ELEMENTS = 500_000


def read_xml(content: bytes) -> ElementTree.Element:
    """Return the root element of an XML text.

    Document types are refused: their entities can unfold to any size, or name other files.
    """
    parser, builder, depth, count = expat.ParserCreate(), ElementTree.TreeBuilder(), 0, 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth += 1
        count += 1
        if count > MOST_ELEMENTS:
            raise ContentError(f"line {parser.CurrentLineNumber}: more than {MOST_ELEMENTS} elements.")
        if depth > DEEPEST:
            raise ContentError(f"line {parser.CurrentLineNumber}: elements are nested more than {DEEPEST} deep.")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: Any) -> None:
        raise ContentError(f"line {parser.CurrentLineNumber}: a document type (<!DOCTYPE>) is not read, as its "
                           f"entities can unfold to any size; remove it.")  # fmt: skip

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = builder.data, refuse
    try:
        parser.Parse(content, True)
        return builder.close()
    except ContentError:
        raise
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two: encodings
        raise ContentError(f"it is no XML: {error}.") from error
