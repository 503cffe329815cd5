"""Tables as text: width, encodings and consoles."""

import io
import sys

import pytest
from rich.console import Console

from mbsvib.common import tables

COLUMNS = [("mode", "right"), ("f [Hz]", "right"), ("shape", "left")]
ROWS = [(1, "780.6", "platform.x"), (12, "1269.6", "hip[1].rx")]

PLAIN = """\
Modes
 ----------------------------
  mode   f [Hz]   shape
 ----------------------------
     1    780.6   platform.x
    12   1269.6   hip[1].rx
 ----------------------------
a note"""


def test_text_is_aligned_and_ascii_on_request():
    words = tables.text("Modes", COLUMNS, ROWS, ["a note"], ascii_only=True)
    assert words == PLAIN
    assert words.isascii()
    assert "\x1b" not in words


def test_width_comes_from_the_content_not_from_the_terminal(monkeypatch):
    wide = tables.text("", COLUMNS, [(1, "x" * 300, "y")])
    monkeypatch.setenv("COLUMNS", "20")
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert tables.text("", COLUMNS, [(1, "x" * 300, "y")]) == wide
    assert "x" * 300 in wide
    assert "\x1b" not in wide


def test_long_titles_and_notes_stay_on_one_line():
    long = "word " * 60 + "end"
    words = tables.text(long, COLUMNS, ROWS, [long], ascii_only=True).splitlines()
    assert words[0] == long
    assert words[-1] == long


def test_ascii_where_standard_output_cannot_encode(monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    words = tables.text("Fx → x", COLUMNS, ROWS, ["90°", "ζ"])
    assert words.isascii()
    assert words.startswith("Fx -> x")
    assert "90 deg" in words
    assert words.endswith("\\u03b6")


def test_a_row_of_wrong_length_is_refused():
    with pytest.raises(ValueError, match="2 entries, the table 3 columns"):
        tables.text("", COLUMNS, [(1, 2)])


def test_terminal_gets_styles_and_whole_columns():
    console = Console(file=io.StringIO(), force_terminal=True, width=25, color_system="standard")
    tables.show(console, "Modes", COLUMNS, ROWS, ["note"])
    words = console.file.getvalue()
    assert "\x1b[" in words
    assert "platform.x" in words
    assert "hip[1].rx" in words


def test_pipe_gets_plain_text():
    console = Console(file=io.StringIO(), force_terminal=False, width=10)
    tables.show(console, "Modes", COLUMNS, ROWS, ["a note"])
    assert console.file.getvalue() == tables.text("Modes", COLUMNS, ROWS, ["a note"], ascii_only=False) + "\n"


def test_pipe_that_cannot_encode_gets_ascii():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii", write_through=True)
    tables.show(Console(file=stream, force_terminal=False), "Fx → x", COLUMNS, ROWS)
    assert stream.buffer.getvalue().decode() == tables.text("Fx → x", COLUMNS, ROWS, ascii_only=True) + "\n"


def test_encodable():
    assert tables.encodable("─", "utf-8")
    assert not tables.encodable("─", "latin-1")
    assert not tables.encodable("a", "no such encoding")
