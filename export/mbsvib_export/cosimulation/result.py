"""What a check of a co-simulation found, as numbers, as a table and as a figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import tables
from mbsvib.common.columnar import Columnar, by_name
from mbsvib.common.display import Displayed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.plots._sheet import Given

LIMIT = 1e-9  # of the difference between FMUs and the reference, the same steps in numpy
_NOTHING = 1e-11  # errors below are rounding, from which no order comes


@dataclass(frozen=True, slots=True, repr=False)
class MasterCheck(Displayed):
    """Results of one co-simulation master.

    ``steps`` [s] and ``errors`` against the closed loop as one system, relative to each output's largest value; output
    ``worst`` has the largest error. ``order`` comes from the last two steps. ``difference`` is that of the FMUs from
    the reference, the same steps in numpy. ``radius`` is the spectral radius of a step of the first size;
    ``largest_stable_step`` [s] and all shorter ones are stable, and ``stable`` tells whether the first size is one of
    these. ``energy`` is the energy that the coupling generates, relative to
    the energy transferred by it; NaN without ``bonds``.
    """

    method: str
    steps: tuple[float, ...]
    errors: tuple[float, ...]
    worst: str
    difference: float
    radius: float
    stable: bool
    largest_stable_step: float
    energy: float = float("nan")

    @property
    def order(self) -> float:
        """Order of the error in the step, from the two smallest steps; NaN where they are exact."""
        a, b = self.errors[-2:]
        if not (b > _NOTHING and np.isfinite(a)):
            return float("nan")
        return float(np.log(a / b) / np.log(self.steps[-2] / self.steps[-1]))

    @property
    def passed(self) -> bool:
        """Whether the FMUs agree with the reference at this step, and the loop is stable."""
        return self.stable and self.difference <= LIMIT


@dataclass(frozen=True, slots=True, repr=False)
class CosimulationCheck(Columnar, Displayed):
    """What ``check_cosimulation`` found; printed as a table, drawn by ``plot()``.

    ``connections`` and ``excitation`` tell what was simulated over ``duration`` [s]; ``growth`` is the largest real
    part of the closed loop's poles [1/s]; ``masters`` are by the names of ``mbsvib_export.cosimulation.masters``.
    """

    plant: str
    controller: str
    step: float
    duration: float
    connections: tuple[str, ...]
    excitation: dict[str, float]
    growth: float
    masters: tuple[MasterCheck, ...]
    remarks: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all masters asked for passed."""
        return all(master.passed for master in self.masters)

    def columns(self) -> dict[str, Any]:
        """Return a row for each master and step as columns by name.

        Returns
        -------
        dict of str to array, shape (masters * steps,)
            ``master``, ``step_s``, ``error``, ``order``, ``difference``, ``largest_stable_step_s``, ``passed``.
        """
        names = ("master", "step_s", "error", "order", "difference", "largest_stable_step_s", "passed")
        return by_name(names, [
            (one.method, step, error, one.order, one.difference, one.largest_stable_step, one.passed)
            for one in self.masters for step, error in zip(one.steps, one.errors, strict=True)])  # fmt: skip

    def __getitem__(self, method: str) -> MasterCheck:
        """Return the results of one master."""
        for master in self.masters:
            if master.method == method:
                return master
        raise KeyError(method)

    def __str__(self) -> str:
        divisors = [round(self.step / h) for h in self.masters[0].steps] if self.masters else []
        columns: list[tuple[str, tables.Justify]] = [("master", "left")]
        columns += [(f"error at {'H' if k == 1 else f'H/{k}'}", "right") for k in divisors]
        columns += [("order", "right"), ("FMU against reference", "right"), ("largest stable H", "right"),
                    ("passed", "right")]  # fmt: skip
        rows = []
        for master in self.masters:
            largest = master.largest_stable_step
            rows.append((
                master.method, *(f"{error:.1e}" for error in master.errors),
                "-" if np.isnan(master.order) else f"{master.order:.2f}", f"{master.difference:.1e}",
                f"> {self.step * 100:.2g} s" if np.isinf(largest) else f"{largest:.3g} s",
                "yes" if master.passed else "NO, unstable" if not master.stable else "NO",
            ))  # fmt: skip
        notes = ["Connected: " + "; ".join(self.connections) + ".",
                 "Error: largest difference of an output from the closed loop as one system, relative to the largest "
                 "value of this output; it comes from exchanging signals at steps only, and does not count for passed.",
                 "Passed: steps up to H are stable, and each FMU agrees with its reference."]  # fmt: skip
        if any(master.method == "slopes" for master in self.masters):
            notes.append("slopes: the master extrapolates inputs linearly over a step.")
        notes += self.remarks
        title = f"Co-simulation of {self.plant} and {self.controller}, H = {self.step:g} s, over {self.duration:.3g} s"
        return tables.text(title, columns, rows, notes)

    def plot(self, *, ax: Given | None = None) -> Figure | Given:
        """Return a figure of the error against the step, with the largest stable step of each master.

        Parameters
        ----------
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            Save it by ``figure.savefig("cosimulation.png")``.
        """
        from mbsvib.plots import _style as style
        from mbsvib.plots._sheet import sheet

        with sheet("plot", ax) as paper:
            axes = paper.panels[0]
            for master, colour in zip(self.masters, style.COLOURS, strict=False):
                order = "" if np.isnan(master.order) else f", order {master.order:.2f}"
                axes.plot(master.steps, master.errors, "o-", color=colour, label=f"{master.method}{order}")
                if 0 < master.largest_stable_step < 100 * self.step:
                    axes.axvline(master.largest_stable_step, color=colour, linestyle=":")
            axes.set(xlabel="step [s]", ylabel="relative error [1]", title="Error of co-simulation")
            paper.name([f"{self.plant}, {self.controller}"])
            style.logarithmic(axes.xaxis, axes.yaxis)
            paper.legend(title="dotted: largest stable step")
        return paper.result
