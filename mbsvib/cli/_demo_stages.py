"""The stages of the demonstration, in order; each takes from ``Work`` what those before it made."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsvib.cli import _shell as shell
from mbsvib.cli._drawing import write_figure
from mbsvib.common import tables
from mbsvib.errors import ExportError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAYLOAD = "platform"
GAIN = 60.0  # of integral force feedback [1/s]: near the most damping that all six modes can have together
LEAK = 2.0 * np.pi * 0.1  # corner of the integrators [rad/s], two decades below the modes
RATE = 1e3  # of the controller in discrete time [Hz]
GAINS = np.linspace(0.0, 90.0, 60)  # the first poles meet on the real axis above
DIGITS = 1e-9  # python-control's answers differ by less, relative to the largest


class Work:
    """What the stages make: objects by name, the files in ``folder``, figures in numbers, and missing extras."""

    def __init__(self, folder: Path, quiet: bool) -> None:
        """Begin with an empty folder."""
        self.folder, self.quiet = folder, quiet
        self.objects: dict[str, Any] = {}
        self.files: list[tuple[str, str]] = []
        self.results: dict[str, Any] = {}
        self.missing: list[tuple[str, str, str]] = []  # (extra, what it is for, the command that needs it)

    def say(self, words: str) -> None:
        """Print a line."""
        if not self.quiet:
            shell.say(words)

    def table(self, source: Any) -> None:
        """Print the table of a result."""
        if not self.quiet:
            tables.show(**source.table())

    def path(self, name: str, words: str) -> Path:
        """Return the path of a file, and list it."""
        self.files.append((name, words))
        return self.folder / name

    def draw(self, figure: Figure, name: str, words: str) -> None:
        """Write a figure."""
        write_figure(figure, self.path(name, words))

    def lacks(self, extra: str, package: str, words: str, command: str) -> bool:
        """Whether the package of an extra is missing; if so, note what to install."""
        if find_spec(package) is not None:
            return False
        self.missing.append((extra, words, command))
        self.say(f'Skipped: {words} needs an extra, pip install "mbsvib[{extra}]".')
        return True


def model_and_modes(work: Work) -> None:
    """Build the platform, linearize it, and show its modes."""
    from mbsvib import library, plots
    from mbsvib.files import save

    model = library.stewart_isolator(ports=("platform", "base"))
    system = model.linearize()
    modes = system.modes()
    work.objects.update(model=model, system=system)
    work.results["natural_hz"] = modes.frequencies.tolist()
    work.say(f"{len(model.bodies)} bodies on a base, {len(model.joints)} joints, {len(model.springs)} spring-dampers; "
             f"{len(system.cut_joints)} loops are closed.")  # fmt: skip
    work.table(modes)
    save(model, work.path("isolator.yaml", "the model: bodies, joints, springs, inputs, outputs; edit and try again"))
    modes.to_csv(work.path("modes.csv", "the table of modes, with every digit"))
    work.draw(plots.mechanism(model), "mechanism.png", "the mechanism: a platform on six legs with flexures")
    work.draw(plots.modes(system), "modes.png", "natural frequencies and damping ratios")
    work.draw(plots.mode_strips(system), "mode-shapes.png", "the shape of each mode: which body moves how")


def responses(work: Work) -> None:
    """Hand the plant to python-control, and compare its answers with those of mbsvib."""
    import control

    import mbsvib_export as mx
    from mbsvib import plots

    system = work.objects["system"]
    plant = mx.to_control(system, realization="modal")
    omega = system.frequency_grid("platform.az", "az")
    response = control.frequency_response(plant["platform:az", "az"], omega).frdata[0, 0]
    t = plots.time_grid(system)
    step = control.step_response(plant["z", "Fz"], t).outputs
    own = system.frequency_response(omega, "platform.az", "az")[0, 0]
    own_step = system.time_response(t, np.ones((1, t.size)), outputs="z", inputs="Fz")[0]
    difference = max(np.abs(response - own).max() / np.abs(own).max(), np.abs(step - own_step).max() / own_step.max())
    if difference > DIGITS:
        raise ExportError(f"demo: python-control differs from mbsvib by {difference:.1e} of the largest response.")
    work.results["python_control_difference"] = float(difference)
    work.say(f"control.StateSpace: {plant.nstates} states, {plant.ninputs} inputs, {plant.noutputs} outputs, all named."
             f"\nBode plot and step response by python-control and by mbsvib differ by {difference:.0e}.")  # fmt: skip
    work.draw(plots.bode(system, "platform.az", "az"), "bode.png",
              "Bode plot, acceleration of the base to that of the platform")  # fmt: skip
    work.draw(plots.step(system, "z", "Fz"), "step.png", "response to a step of the force on the platform")
    mx.to_mat(system, work.path("isolator.mat", "ss and mechss of MATLAB, by load_isolator.m"))
    work.path("load_isolator.m", "loads it, with all names")


def passive_isolation(work: Work) -> None:
    """Study how well the platform is isolated as it is."""
    from mbsvib import isolation

    study = isolation.study(work.objects["model"], PAYLOAD)
    work.objects["study"] = study
    work.results["amplification"] = study.amplification
    work.table(study)


def active_damping(work: Work) -> None:
    """Close integral force feedback around all six legs, and show the margins."""
    from mbsvib import isolation, plots

    plant = isolation.actuated(work.objects["model"], PAYLOAD)
    law = isolation.force_feedback(plant, GAIN, LEAK)
    loop = plant.with_gains(law)
    margins, closed = loop.margins(), loop.isolation()
    work.objects.update(plant=plant, law=law, loop=loop)
    work.table(loop)
    work.table(margins)
    work.say(f"Amplification at resonance: {work.objects['study'].amplification:.2f} open, {closed.amplification:.2f} "
             f"closed.")  # fmt: skip
    work.results["closed_loop"] = {"damping_ratios": loop.damping_ratios.tolist(),
                                   "phase_margin_deg": margins.all_phases,
                                   "amplification": closed.amplification}  # fmt: skip
    locus = isolation.root_locus(plant, lambda gain: isolation.force_feedback(plant, gain, LEAK), GAINS)
    work.draw(plots.root_locus(locus, real=(-18.0, 1.0), imaginary=(0.0, 20.0)), "root-locus.png",
              "poles of the closed loop over the gain")  # fmt: skip
    work.draw(plots.loop_gain(loop, loop.actuators[0]), "loop-gain.png",
              "loop gain of one leg with its margins; the six are alike")  # fmt: skip
    work.draw(plots.sensitivity(loop), "sensitivity.png", "sensitivity and complementary sensitivity of the loop")
    labels = ["open loop", "force feedback"]
    work.draw(plots.bode([plant.system, loop], "acceleration.z", "base.z", labels=labels), "open-closed.png",
              "Bode plot, base to platform, open against closed loop")  # fmt: skip
    work.draw(plots.isolation([work.objects["study"], closed], labels), "isolation.png",
              "transmissibility and compliance, open against closed loop")  # fmt: skip


def sampled_controller(work: Work) -> None:
    """Sample the controller; run plant and controller as two FMUs."""
    import mbsvib_export as mx
    from mbsvib_export.fmu_.binaries import this_platform  # compiling for others takes a while, once

    plant, law, loop = (work.objects[name] for name in ("plant", "law", "loop"))
    sampled = loop.sampled(RATE, delay=0.5 / RATE)
    work.results["sampled"] = {"rate_hz": RATE, "stable": sampled.stable, "damping_ratio": min(sampled.damping_ratios)}
    verdict = "stable" if sampled.stable else "UNSTABLE"
    work.say(f"Sampled at {RATE:g} Hz, half a period late: {verdict}, least damped mode "
             f"{100.0 * min(sampled.damping_ratios):.1f} %.")  # fmt: skip
    mx.to_c(law, work.folder, 1.0 / RATE, name="controller")
    for suffix, words in ((".c", f"the controller for a computer at {RATE:g} Hz"), (".h", "its interface"),
                          ("_test.c", "a program that tests it")):  # fmt: skip
        work.path(f"controller{suffix}", words)
    ports = [*law.inputs, "acceleration.z"], [*law.outputs, "base.z"]
    try:
        files = [mx.to_fmu(source, work.folder / name, platforms=this_platform())
                 for source, name in ((plant.system[ports], "plant.fmu"), (law, "controller.fmu"))]  # fmt: skip
    except ExportError as error:  # neither binaries, nor a compiler
        work.missing.append(("fmu", "plant and controller as FMUs", "demo"))
        work.say(f"Skipped: {error}")
        return
    work.path("plant.fmu", f"the plant as FMU (FMI 3.0) for {files[0].platforms[0]}")
    work.path("controller.fmu", "the controller as FMU")
    if work.lacks("fmu", "fmpy", "co-simulation of the two FMUs", "demo"):
        return
    check = mx.check_cosimulation(files[0], files[1], 1.0 / RATE)
    work.results["co_simulation"] = {master.method: {"steps": master.steps, "errors": master.errors}
                                     for master in check.masters}  # fmt: skip
    work.say(str(check))
    work.draw(check.plot(), "co-simulation.png", "error of co-simulation against step")


def page(work: Work) -> None:
    """Write the report."""
    if work.lacks("report", "plotly", "report.html, a page for any browser with the modes in motion",
                  "report stewart_isolator"):  # fmt: skip
        return
    from mbsvib.report import write

    path = work.path("report.html", "a page for any browser: modes in motion, any Bode plot")
    write(work.objects["model"], path)
    work.say(f"{path.stat().st_size / 1e6:.1f} MB, needs no network.")


class Stage(NamedTuple):
    """A stage: what it is about, and what does it."""

    title: str
    run: Callable[[Work], None]


STAGES = (
    Stage("Model and modes", model_and_modes),
    Stage("Bode plot and step response in python-control", responses),
    Stage("Isolation of the platform from the floor", passive_isolation),
    Stage("Integral force feedback in the legs: damping, margins, open against closed loop", active_damping),
    Stage("Discrete-time control: the controller sampled, as C, as FMU beside the plant", sampled_controller),
    Stage("Report", page),
)
