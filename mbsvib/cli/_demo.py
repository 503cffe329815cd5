"""The demonstration: the Stewart platform from bodies and joints to figures and files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from mbsvib.cli import _shell as shell

FOLDER = Path("mbsvib-demo")
# (extra, what it is for, the command that needs it)
EXTRAS = (
    ("report", "a page for any browser, the modes in motion", "report stewart"),
    ("video", "a mode as MP4 (.gif needs no extra)", "animate stewart -o mode.mp4"),
    ("fmu", "a functional mock-up unit where no C compiler is", "export stewart -o stewart.fmu"),
    ("hdf5", "matrices and state space as HDF5", "export stewart -o stewart.h5"),
)


def demo(
    folder: Annotated[Path, typer.Option("--folder", "-o", metavar="FOLDER", help="Where the files go.")] = FOLDER,
) -> None:
    """Compute the Stewart platform end to end: modes, Bode plots, step response, files in a folder."""
    from mbsvib import library, plots
    from mbsvib.cli._drawing import write_figure
    from mbsvib.cli._records import csv_text
    from mbsvib.common import tables
    from mbsvib.files import save
    from mbsvib_export import to_json, to_npz
    from mbsvib_export.atomic_file import write_atomic

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise shell.UsageProblem(f"'{folder}' cannot be made: {error.strerror}. Give another folder by -o.") from error
    model = library.stewart(ports=("platform", "base"))
    system = model.linearize()
    modes = system.modes()
    tables.show(shell.console(), **modes.table())

    files = []

    def wrote(name: str, words: str) -> Path:
        files.append((name, words))
        return folder / name

    content = csv_text(modes).encode()
    write_atomic(wrote("modes.csv", "the table above, with every digit"), lambda stream: stream.write(content))
    write_figure(plots.modes(system), wrote("modes.png", "natural frequencies and damping ratios"))
    force = plots.bode(system, "x", "Fx")
    write_figure(force, wrote("bode-force.png", "Bode plot, force on the platform to its displacement"))
    base = plots.bode(system, "platform.ax", "ax")
    write_figure(base, wrote("bode-base.png", "Bode plot, acceleration of the base to that of the platform"))
    write_figure(plots.step(system, "x", "Fx"), wrote("step.png", "response to a step of that force"))
    save(model, wrote("stewart.yaml", "the model: bodies, joints, springs, inputs, outputs; edit and try again"))
    to_npz(system, wrote("stewart.npz", "M C K B, state space, names and units for numpy"))
    to_json(system, wrote("stewart.json", "the same for any language"))

    shell.say("")
    shown_folder = shell.shown(folder)
    tables.show(shell.console(), f"Written to {shown_folder}", [("file", "left"), ("what is in it", "left")], files)
    example = str(Path(shown_folder) / "stewart.yaml")
    shell.say("Next: " + _line("", f"modes {example}") + "\n")
    rows = [(words, _line(extra, command)) for extra, words, command in EXTRAS]
    tables.show(shell.console(), "What needs an extra", [("what", "left"), ("command", "left")], rows)


def _line(extra: str, command: str) -> str:
    """Return what to type for a command that needs an extra, or none: by uv where uv has run this one."""
    if "UV" in os.environ:
        needed = f"--extra {extra} " if extra else ""
        return f"uv run --no-dev {needed}mbsvib {command}"
    needed = f'pip install "mbsvib[{extra}]" && ' if extra else ""
    return f"{needed}mbsvib {command}"
