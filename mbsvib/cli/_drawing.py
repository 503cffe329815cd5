"""Commands that draw curves and mechanisms: bode, nyquist, sigma, step, draw and animate; how figures are written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import pi
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
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from mbsvib.api.system import System

    # names of a column, alone and in JSON, its points (n,), and responses (outputs, inputs, n)
    Computed = tuple[tuple[str, str], NDArray[Any], NDArray[Any]]

Names = list[str] | None
Limit = float | None


FORMATS, TABLE = (".png", ".pdf", ".svg"), ".csv"


def write_figure(figure: Figure, path: Path) -> Path:
    """Write a figure in the format of the path's suffix, completely or not at all."""
    from mbsvib.common.atomic_file import write_atomic

    check_format(path)
    return write_atomic(path, lambda stream: figure.savefig(stream, format=path.suffix[1:].lower()))


def deliver(
    path: Path | None, as_json: bool, figure: Callable[[], Figure],
    columns: Callable[[], Mapping[str, Any]] | None = None, remark: str = "",
) -> None:  # fmt: skip
    """Write a figure or, where the path is that of a table, columns as comma-separated values; none without a path.

    Where standard output does not have numbers it says so, below a ``remark`` on the figure.
    """
    if path is None:
        return
    if columns is not None and is_table(path):
        from mbsvib.common.columnar import write_csv

        write_csv(path, columns())
        remark = ""
    else:
        write_figure(figure(), path)
    if not as_json:
        shell.say("\n".join(filter(None, [remark, f"Written: {shell.shown(path)}"])))


def plotted(name: str, *arguments: Any, **options: Any) -> Callable[[], Figure]:
    """Return a function that draws by a function of ``plots``, which is imported when a figure is asked for."""
    def draw() -> Figure:
        from mbsvib import plots

        figure: Figure = getattr(plots, name)(*arguments, **options)
        return figure

    return draw


def is_table(path: Path | None) -> bool:
    """Whether a path is that of a table."""
    return path is not None and path.suffix.lower() == TABLE


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
    options = {"span": (first, last), "decibels": decibels}
    _curves("bode", options, partial(_over_frequency, first, last), model, inputs, outputs, file, as_json)


def nyquist(
    model: ModelFile, inputs: Names = None, outputs: Names = None, first: Limit = None, last: Limit = None,
    file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Draw frequency responses in the complex plane into a file (default: NAME-nyquist.png)."""
    options = {"span": (first, last)}
    _curves("nyquist", options, partial(_over_frequency, first, last), model, inputs, outputs, file, as_json)


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
    if file is not None or not as_json:
        deliver(file or default_path(system.name, "sigma.png"), as_json,
                plotted("singular_values", system, outputs, inputs, span=(first, last)),
                lambda: {"frequency_hz": omega / (2.0 * np.pi)} | {
                    f"singular_value_{k}_{group['unit']}": row for group in groups
                    for k, row in enumerate(group["singular_values"], 1)})  # fmt: skip


def step(
    model: ModelFile, inputs: Names = None, outputs: Names = None, duration: Limit = None, file: Path | None = None,
    as_json: bool = False,
) -> None:  # fmt: skip
    """Draw responses to unit steps into a file (default: NAME-step.png)."""
    _curves("step", {"duration": duration}, partial(_over_time, duration), model, inputs, outputs, file, as_json)


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


def _curves(
    name: str, options: dict[str, Any], compute: Callable[[System], Computed], model: ModelFile, inputs: Names,
    outputs: Names, file: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Draw responses by a function of ``plots`` with ``options``, or print them."""
    check_format(file, table=True)
    system = system_of(model)
    if as_json or is_table(file):
        from mbsvib.common.columnar import by_pair

        part = system.with_ports(outputs, inputs)
        (column, plural), points, responses = compute(part)
        if as_json:
            shell.say_json({**_signals(part), plural: points.tolist(), "responses": {
                output: {source: _numbers(responses[i, j]) for j, source in enumerate(part.inputs)}
                for i, output in enumerate(part.outputs)}})  # fmt: skip
    if is_table(file):
        deliver(file, as_json, plotted(name), lambda: {column: points} | by_pair(part.outputs, part.inputs, responses))
    elif file is not None or not as_json:
        sources, results, remark = ports(system, inputs, outputs)
        deliver(file or default_path(system.name, f"{name}.png"), as_json,
                plotted(name, system, results, sources, **options), remark=remark)  # fmt: skip


def _over_frequency(first: Limit, last: Limit, part: System) -> Computed:
    omega = part.frequency_grid(f_min=first, f_max=last)
    return ("frequency_hz", "frequencies_hz"), omega / (2.0 * pi), part.frequency_response(omega)


def _over_time(duration: Limit, part: System) -> Computed:
    """Responses to unit steps."""
    import numpy as np

    from mbsvib.plots import time_grid

    t = time_grid(part, duration)
    responses = [part.time_response(t, np.outer(unit, np.ones_like(t))) for unit in np.eye(len(part.inputs))]
    return ("time_s", "times_s"), t, np.stack(responses, axis=1)


def _signals(system: System) -> dict[str, Any]:
    return {"name": system.name, "inputs": system.inputs, "input_units": system.input_units,
            "outputs": system.outputs, "output_units": system.output_units}  # fmt: skip


def _numbers(values: NDArray[Any]) -> Any:
    """Values as JSON has them."""
    return {"real": values.real.tolist(), "imag": values.imag.tolist()} if values.dtype.kind == "c" else values.tolist()


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
