"""The command that writes systems and models for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mbsvib.cli import _shell as shell
from mbsvib.cli._lookup import ModelArgument, model_of
from mbsvib.errors import nearest

if TYPE_CHECKING:
    from collections.abc import Callable

KINDS = {
    ".json": "the linear system with names and units as JSON",
    ".npz": "the linear system with names and units as numpy arrays",
    ".mat": "the linear system for MATLAB and Octave, and a script that loads it",
    ".h5": "the linear system with names and units as HDF5",
    ".uff": "frequency responses and geometry as universal file",
    ".op4": "M, C, K and the other matrices for Nastran",
    ".pch": "M, C, K as DMIG cards for Nastran",
    ".fmu": "an FMU (FMI 3.0), for model exchange and co-simulation",
    ".mo": "the state space as a model in Modelica",
    ".c": "the discrete-time state space as C source, with header and test program beside it",
    ".yaml": "the model itself, to be edited",
}


def export(
    model: ModelArgument,
    file: Annotated[Path, typer.Option("--file", "-o", metavar="FILE", help=f"Where to: {', '.join(KINDS)}.")],
    realization: Annotated[
        str | None,
        typer.Option("--realization", metavar="KIND", help="States: physical (of .c: modal), modal or balanced."),
    ] = None,
    step: Annotated[
        float | None, typer.Option("--step", metavar="SECONDS", help="Time between samples, for .c.")
    ] = None,
    fmi: Annotated[str, typer.Option("--fmi", metavar="VERSION", help="Of an FMU: 2.0 or 3.0.")] = "3.0",
    platforms: Annotated[
        str | None, typer.Option("--platforms", metavar="NAMES", help="Of an FMU: all, or names with commas between.")
    ] = None,
) -> None:
    """Write the linear system, frequency responses or the model (.yaml), by the suffix of the file."""
    suffix = file.suffix.lower()
    if suffix not in KINDS:
        known = "; ".join(f"{kind}: {words}" for kind, words in KINDS.items())
        hint = nearest(suffix, KINDS)
        raise shell.UsageProblem(f"'{file}': no format goes by the suffix '{suffix}'.{hint} Known: {known}.")
    if step is not None and suffix != ".c":
        raise shell.UsageProblem(f"--step {step:g}: '{file}' is continuous in time; give --step with a file that ends "
                                 f"in .c.")  # fmt: skip
    if suffix != ".fmu" and (fmi != "3.0" or platforms is not None):
        raise shell.UsageProblem(f"--fmi and --platforms: '{file}' is no FMU; give them with a file that ends in .fmu.")
    source = model_of(model)
    if file.exists() and Path(model).exists() and file.samefile(model):
        raise shell.UsageProblem(f"'{file}' is the model itself, which would be overwritten; give another file by -o.")
    content = KINDS[suffix]
    if suffix == ".yaml":
        from mbsvib.files import save

        save(source, file)
    else:
        import mbsvib_export as mx

        system = source.linearize()
        with_states: dict[str, Callable[..., object]] = {
            ".json": mx.to_json, ".npz": mx.to_npz, ".mat": mx.to_mat, ".h5": mx.to_hdf5, ".mo": mx.to_modelica,
        }  # fmt: skip
        states = {} if realization is None else {"realization": realization}
        if suffix == ".c":
            mx.to_c(system, file.parent, name=file.stem, **states, **({} if step is None else {"step": step}))  # type: ignore[arg-type]
        elif suffix == ".fmu":
            asked = platforms if platforms in (None, "all") else tuple(platforms.split(","))
            written = mx.to_fmu(system, file, fmi, platforms=asked, **states)
            content = f"an FMU (FMI {fmi}) that runs on {', '.join(written.platforms)}"
            if written.other_platforms:
                content += "; others by --platforms all"
        elif suffix in with_states:
            with_states[suffix](system, file, **states)
        else:
            exporters: dict[str, Callable[..., object]] = {".uff": mx.to_uff, ".op4": mx.to_op4, ".pch": mx.to_dmig}
            exporters[suffix](system, file)
    shell.say(f"Written: {shell.shown(file)} ({content})")
