"""Figures of studies, drawn from plain arrays: sweeps, root loci, tolerances."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, in_rows, sheet
from mbsvib.plots.studies import MOST_LINES, bins

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array, Complex

MOST_DOTS = 60  # points of a sweep that are marked one by one on its lines


def root_locus(
    eigenvalues: Complex, modes: Sequence[str], variables: Iterable[str], name: str, *, samples: bool,
    ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the eigenvalues of the first 12 modes over the points of a sweep, in the upper half of the complex plane.

    ``eigenvalues`` (n, modes): those without negative imaginary parts [1/s]. ``samples``: whether neighbours in the
    array are not neighbours in the variables, so that no line joins them.
    """
    with sheet("root_locus", ax) as paper:
        axes = paper.panels[0]
        for i, (mode, track) in enumerate(zip(modes, eigenvalues.T[:MOST_LINES], strict=False)):
            line = style.line(i)
            dots: dict[str, Any] = {"marker": ".", "markersize": 3.0} if samples or len(track) <= MOST_DOTS else {}
            if samples:
                dots["linestyle"] = "none"
            axes.plot(track.real, track.imag, label=mode, **(line | dots))
            if not samples:
                good = np.flatnonzero(np.isfinite(track))
                for at, marker in ((good[0], "o"), (good[-1], "s")):
                    axes.plot(track[at].real, track[at].imag, marker, color=line["color"], markersize=4.5, mfc="white")
        axes.axvline(0.0, color=style.MARK, linewidth=0.8, zorder=0)
        axes.set_ylim(bottom=0.0)
        axes.set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]")
        axes.legend(title="mode")
        axes.set_title("Eigenvalues")
        paper.name([f"{name}, {', '.join(variables)}"])
        paper.left_out(min(len(modes), MOST_LINES), len(modes), "modes", "choose by modes=")
    return paper.result


def tolerances(
    labels: Sequence[str], sampled: Array, linear: Array, nominal: Array, name: str, ax: Given | None = None
) -> Figure | Given:
    """Draw histograms of a tolerance analysis: samples as areas, first-order values as lines, nominal values dashed.

    ``sampled``, ``linear`` (n, k): numbers of the samples, and their first-order values. ``nominal`` (k,): numbers of
    the nominal model.
    """
    with in_rows("plot", ax, len(labels), min(3, len(labels)), (4.0, 2.3)) as paper:
        for i, (axes, label) in enumerate(zip(paper.panels, labels, strict=True)):
            shown, first = (table[np.isfinite(table[:, i]), i] for table in (sampled, linear))
            low, high = np.quantile(np.concatenate((shown, first)), (0.0005, 0.9995))
            edges = np.linspace(low, high, bins(len(shown)) + 1)
            axes.hist(shown, bins=edges, color=style.COLOURS[5], label="samples")
            if len(first):
                axes.hist(first, bins=edges, histtype="step", color=style.COLOURS[1], label="first order")
            axes.axvline(nominal[i], color=style.INK, linewidth=0.9, linestyle="--", label="nominal")
            axes.set(xlabel=label, ylabel="number of samples")
            axes.locator_params(axis="x", nbins=4)
        paper.legend()
        paper.head(f"Tolerances of {name}")
    return paper.result
