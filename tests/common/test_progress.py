"""Progress: a function of the caller, a line on a terminal, or nothing."""

import pytest

from mbsvib.common.progress import counting


def test_a_function_is_told_what_is_done(capsys):
    calls = []
    with counting(lambda done, total: calls.append((done, total)), 10, "sweep", 2) as tell:
        tell(3)
        tell(5)
    assert calls == [(5, 10), (10, 10)]
    assert capsys.readouterr().err == ""


def test_a_line_begins_and_ends_with_the_state_of_the_work(capsys):
    with counting(True, 4, "sweep of car", 1) as tell:
        for _ in range(3):
            tell(1)
    states = capsys.readouterr().err.removesuffix("\n").split("\r")[1:]
    assert states[0].startswith("sweep of car [########......................] 1/4, ")
    assert states[-1].startswith("sweep of car [" + "#" * 30 + "] 4/4, ")
    assert "left" not in states[-1]


def test_the_line_ends_where_the_work_fails(capsys):
    with pytest.raises(ZeroDivisionError), counting(True, 4, "sweep"):
        1 / 0  # noqa: B018
    assert capsys.readouterr().err.endswith("\n")


def test_nothing_is_written_where_no_terminal_is(capsys):
    with counting(None, 4, "sweep") as tell:
        tell(4)
    assert capsys.readouterr().err == ""
