"""Tables as text: width, encodings and consoles."""

import io
import re
import sys

import pytest

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


class Terminal(io.StringIO):
    """A stream that is a terminal of UTF-8."""

    encoding = "utf-8"

    def isatty(self):
        return True


def test_terminal_gets_styles_and_whole_columns(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()
    tables.show("Modes", COLUMNS, ROWS, ["note"], stream=stream)
    words = stream.getvalue()
    assert words.startswith("\x1b[1mModes\x1b[0m\n")
    assert re.sub(r"\x1b\[\dm", "", words) == tables.text("Modes", COLUMNS, ROWS, ["note"], ascii_only=False) + "\n"


@pytest.mark.parametrize(("variable", "value"), [("NO_COLOR", "1"), ("TERM", "dumb")])
def test_terminal_without_styles_where_the_user_says_so(monkeypatch, variable, value):
    monkeypatch.setenv(variable, value)
    stream = Terminal()
    tables.show("Modes", COLUMNS, ROWS, stream=stream)
    assert "\x1b" not in stream.getvalue()


def test_pipe_gets_plain_text():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    tables.show("Modes", COLUMNS, ROWS, ["a note"], stream=stream)
    expected = tables.text("Modes", COLUMNS, ROWS, ["a note"], ascii_only=False) + "\n"
    assert stream.buffer.getvalue().decode() == expected


def test_pipe_that_cannot_encode_gets_ascii():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii", write_through=True)
    tables.show("Fx → x", COLUMNS, ROWS, stream=stream)
    assert stream.buffer.getvalue().decode() == tables.text("Fx → x", COLUMNS, ROWS, ascii_only=True) + "\n"


def test_cells_of_wide_and_of_combining_characters():
    assert tables.width("ζ 振動") == 6
    assert tables.width("e\u0301") == 1
    words = tables.text("", [("名", "center"), ("f", "right")], [("振動", 1), ("a", 22)], ascii_only=False).splitlines()
    assert len({tables.width(line.rstrip()) for line in words}) == 2  # rules, and rows that end in the right column
    assert words[3:5] == ["  振動    1", "   a     22"]


def test_encodable():
    assert tables.encodable("─", "utf-8")
    assert not tables.encodable("─", "latin-1")
    assert not tables.encodable("a", "no such encoding")
