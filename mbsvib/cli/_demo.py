"""The demonstration: an isolating platform, from bodies and joints to a closed loop, FMUs and a report."""

from __future__ import annotations

import os
from pathlib import Path

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, Command, option
from mbsvib.common import tables

FOLDER = Path("mbsvib-demo")


def demo(folder: Path = FOLDER, as_json: bool = False) -> None:
    """Compute an isolating platform end to end: modes, Bode, isolation, active damping, FMUs, report."""
    from mbsvib.cli._demo_stages import STAGES, Work

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise shell.UsageProblem(f"'{folder}' cannot be made: {error.strerror}. Give another folder by -o.") from error
    work = Work(folder, quiet=as_json)
    for number, stage in enumerate(STAGES, 1):
        work.say(f"{'' if number == 1 else chr(10)}{number}/{len(STAGES)}  {stage.title}")
        stage.run(work)
    if as_json:
        shell.say_json({"folder": str(folder), "files": dict(work.files), "figures": work.results,
                        "missing": [{"extra": extra, "what": words} for extra, words, _ in work.missing]})  # fmt: skip
        return
    shown_folder = shell.shown(folder)
    shell.say("")
    tables.show(f"Written to {shown_folder}", [("file", "left"), ("what is in it", "left")], work.files)
    if work.missing:
        rows = [(words, command_line(extra, command)) for extra, words, command in work.missing]
        shell.say("")
        tables.show("What needs an extra", [("what", "left"), ("command", "left")], rows)
    shell.say("Next: " + command_line("", f"modes {Path(shown_folder) / 'isolator.yaml'}"))


def command_line(extra: str, command: str) -> str:
    """Return what to type for a command that needs an extra, or none: by uv where uv has run this one.

    ``command``: words after ``mbsvib``.
    """
    if "UV" in os.environ:
        needed = f"--extra {extra} " if extra else ""
        return f"uv run --no-dev {needed}mbsvib {command}"
    needed = f'pip install "mbsvib[{extra}]" && ' if extra else ""
    return f"{needed}mbsvib {command}"


COMMANDS = {"demo": Command(demo, (
    option("--folder", "-o", to="folder", metavar="FOLDER", type=Path, default=FOLDER, completes="file",
           words="Where the files go. Default: mbsvib-demo."),
    JSON,
))}  # fmt: skip
