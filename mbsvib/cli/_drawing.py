"""Commands that draw curves and mechanisms: bode, nyquist, sigma, step, draw and animate; how figures are written."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import (
    FIRST,
    INPUTS,
    JSON,
    LAST,
    MODEL,
    OUTPUTS,
    Command,
    ModelFile,
    file_argument,
    flag,
    number,
    option,
    whole_number,
)
from mbsvib.cli._lookup import model_of, ports, system_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from mbsvib.api.system import System

    Names = list[str] | None
    Limit = float | None


FORMATS, TABLE = (".png", ".pdf", ".svg"), ".csv"


def write_figure(figure: Figure, path: Path) -> Path:
    """Write a figure in the format of the path's suffix, completely or not at all."""
    from mbsvib.common.atomic_file import write_atomic

    check_format(path)
    return write_atomic(path, lambda stream: figure.savefig(stream, format=path.suffix[1:].lower()))


def deliver(figure: Figure, path: Path, as_json: bool, remark: str = "") -> None:
    """Write a figure, and say so below a ``remark`` where standard output does not have numbers."""
    write_figure(figure, path)
    if not as_json:
        shell.say("\n".join(filter(None, [remark, f"Written: {shell.shown(path)}"])))


def is_table(path: Path | None) -> bool:
    """Whether a path is that of a table."""
    return path is not None and path.suffix.lower() == TABLE


def deliver_table(columns: Mapping[str, Any], path: Path, as_json: bool) -> None:
    """Write columns as comma-separated values, and say so where standard output does not have numbers."""
    from mbsvib.common.columnar import write_csv

    write_csv(path, columns)
    if not as_json:
        shell.say(f"Written: {shell.shown(path)}")


def check_format(path: Path | None, *, table: bool = False) -> None:
    """Refuse a ``path`` whose suffix figures do not have; None passes, and with ``table`` that of a table."""
    if path is not None and path.suffix.lower() not in FORMATS and not (table and is_table(path)):
        more = f", tables in {TABLE}" if table else ""
        raise shell.UsageProblem(f"'{path}': figures end in {', '.join(FORMATS)}{more}.")


def default_path(name: str, figure: str) -> Path:
    """Return where a figure goes if no file is named."""
    return Path(f"{name}-{figure}".replace("/", "_"))


MOTIONS = (".gif", ".mp4", ".html")


def bode(
    model: ModelFile, inputs: Names = None, outputs: Names = None, first: Limit = None, last: Limit = None,
    decibels: bool = False, file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Draw a Bode plot into a file (default: NAME-bode.png)."""
    from mbsvib import plots

    plot = partial(plots.bode, decibels=decibels)
    _frequency_curves("bode", plot, model, inputs, outputs, (first, last), file, as_json)


def nyquist(
    model: ModelFile, inputs: Names = None, outputs: Names = None, first: Limit = None, last: Limit = None,
    file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Draw frequency responses in the complex plane into a file (default: NAME-nyquist.png)."""
    from mbsvib import plots

    _frequency_curves("nyquist", plots.nyquist, model, inputs, outputs, (first, last), file, as_json)


def sigma(
    model: ModelFile, inputs: Names = None, outputs: Names = None, first: Limit = None, last: Limit = None,
    file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Draw the singular values of the frequency response into a file (default: NAME-sigma.png)."""
    check_format(file, table=True)
    system = system_of(model)
    if as_json or is_table(file):
        import numpy as np

        from mbsvib.plots._curves import curves
        from mbsvib.plots.singular_values import of_curves, unit_groups

        part = system.with_ports(outputs, inputs)
        omega = part.frequency_grid(f_min=first, f_max=last)
        groups = []
        for group in unit_groups(part, None, None):  # singular values of mixed units mean nothing
            pairs = [(output, source) for output in group.outputs for source in group.inputs]
            sigma = of_curves(curves(part, pairs, omega / (2.0 * np.pi)), len(group.outputs))
            groups.append({**group._asdict(), "singular_values": sigma.tolist()})
        if as_json:
            shell.say_json({"name": part.name, "frequencies_hz": (omega / (2.0 * np.pi)).tolist(), "groups": groups})
    if file is not None and is_table(file):
        values = {f"singular_value_{k}_{group['unit']}": row for group in groups
                  for k, row in enumerate(group["singular_values"], 1)}  # fmt: skip
        deliver_table({"frequency_hz": omega / (2.0 * np.pi), **values}, file, as_json)
    elif file is not None or not as_json:
        from mbsvib import plots

        figure = plots.singular_values(system, outputs, inputs, span=(first, last))
        deliver(figure, file or default_path(system.name, "sigma.png"), as_json)


def step(
    model: ModelFile, inputs: Names = None, outputs: Names = None, duration: Limit = None, file: Path | None = None,
    as_json: bool = False,
) -> None:  # fmt: skip
    """Draw responses to unit steps into a file (default: NAME-step.png)."""
    check_format(file, table=True)
    system = system_of(model)
    if as_json or is_table(file):
        import numpy as np

        from mbsvib.common.columnar import by_pair
        from mbsvib.plots import time_grid

        part = system.with_ports(outputs, inputs)
        t = time_grid(part, duration)
        units = np.eye(len(part.inputs))
        responses = np.stack([part.time_response(t, np.outer(unit, np.ones_like(t))) for unit in units], axis=1)
        if as_json:
            shell.say_json({**_signals(part), "times_s": t.tolist(), "responses": _by_names(part, responses, _real)})
    if file is not None and is_table(file):
        deliver_table({"time_s": t, **by_pair(part.outputs, part.inputs, responses)}, file, as_json)
    elif file is not None or not as_json:
        from mbsvib import plots

        sources, results, remark = ports(system, inputs, outputs)
        figure = plots.step(system, results, sources, duration)
        deliver(figure, file or default_path(system.name, "step.png"), as_json, remark)


def draw(model: ModelFile, view: str = "3-D", file: Path | None = None, as_json: bool = False) -> None:
    """Draw the mechanism into a file (default: NAME-mechanism.png)."""
    check_format(file)
    source = model_of(model)
    from mbsvib import plots

    path = write_figure(plots.mechanism(source, view), file or default_path(source.name, "mechanism.png"))
    shell.say_written(path, as_json)


def animate(
    model: ModelFile, mode: int = 1, view: str = "3-D", file: Path | None = None, as_json: bool = False
) -> None:
    """Write a mode in motion into a file (default: NAME-modeN.gif)."""
    if file is not None and file.suffix.lower() not in MOTIONS:
        raise shell.UsageProblem(f"'{file}': motions end in {', '.join(MOTIONS)}.")
    system = system_of(model)
    path = file if file is not None else default_path(system.name, f"mode{mode}.gif")
    motion = system.modes().animate(mode, path, view=view)
    if not as_json:
        shell.say(motion.title)
    shell.say_written(path, as_json, title=motion.title)


def _frequency_curves(
    name: str, plot: Callable[..., Figure], model: ModelFile, inputs: Names, outputs: Names, span: tuple[Limit, Limit],
    file: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Draw responses over frequency, or print them."""
    check_format(file, table=True)
    system = system_of(model)
    if as_json or is_table(file):
        import numpy as np

        from mbsvib.common.columnar import by_pair

        part = system.with_ports(outputs, inputs)
        omega = part.frequency_grid(f_min=span[0], f_max=span[1])
        response = part.frequency_response(omega)
        if as_json:
            shell.say_json({**_signals(part), "frequencies_hz": (omega / (2.0 * np.pi)).tolist(),
                            "responses": _by_names(part, response, _complex)})  # fmt: skip
    if file is not None and is_table(file):
        pairs = by_pair(part.outputs, part.inputs, response)
        deliver_table({"frequency_hz": omega / (2.0 * np.pi), **pairs}, file, as_json)
    elif file is not None or not as_json:
        sources, results, remark = ports(system, inputs, outputs)
        figure = plot(system, results, sources, span=span)
        deliver(figure, file or default_path(system.name, f"{name}.png"), as_json, remark)


def _signals(system: System) -> dict[str, Any]:
    return {"name": system.name, "inputs": system.inputs, "input_units": system.input_units,
            "outputs": system.outputs, "output_units": system.output_units}  # fmt: skip


def _real(values: NDArray[Any]) -> list[float]:
    numbers: list[float] = values.tolist()
    return numbers


def _complex(values: NDArray[Any]) -> dict[str, list[float]]:
    return {"real": values.real.tolist(), "imag": values.imag.tolist()}


def _by_names(system: System, values: NDArray[Any], record: Callable[[Any], Any]) -> dict[str, dict[str, Any]]:
    """{output: {input: values}} of an array (outputs, inputs, n)."""
    return {output: {source: record(values[i, j]) for j, source in enumerate(system.inputs)}
            for i, output in enumerate(system.outputs)}  # fmt: skip


VIEW = option("--view", to="view", metavar="VIEW", default="3-D", completes=("3-D", "x", "y", "z"),
              words="From where: 3-D, x, y or z. Default: 3-D.")
PICTURE = file_argument(f"Where to: {', '.join(FORMATS)}.")
DECIBELS = flag("--decibels", "decibels", "Magnitude in dB, 20 log10 of the value in SI units.")
CURVE = file_argument(f"A figure ({', '.join(FORMATS)}) or a table (.csv).")
CURVES = (MODEL, INPUTS, OUTPUTS, FIRST, LAST, CURVE, JSON)
DURATION = option("--duration", to="duration", metavar="SECONDS", type=number, words="Time shown.")
MODE = option("--mode", "-m", to="mode", metavar="N", type=whole_number, default=1,
              words="The mode's number in the table, from 1. Default: 1.")  # fmt: skip
COMMANDS = {
    "bode": Command(bode, (*CURVES[:-2], DECIBELS, *CURVES[-2:])),
    "nyquist": Command(nyquist, CURVES),
    "sigma": Command(sigma, CURVES),
    "step": Command(step, (MODEL, INPUTS, OUTPUTS, DURATION, CURVE, JSON)),
    "draw": Command(draw, (MODEL, VIEW, PICTURE, JSON)),
    "animate": Command(animate, (MODEL, MODE, VIEW, file_argument("Where to: .gif, .mp4 or .html."), JSON)),
}
