"""Transmissibility and compliance over frequency."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Protocol

from mbsvib.errors import ModelError
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array


class Bodies(Protocol):
    """The isolated body, and what is shaken."""

    @property
    def body(self) -> str:
        """Name of the isolated body."""

    @property
    def base(self) -> str:
        """Name of the base."""


class Named(Protocol):
    """The equations of a study."""

    @property
    def name(self) -> str:
        """Name of the model, and those of its controllers."""


class Isolation(Protocol):
    """Data of a study of isolation; ``mbsvib.isolation.study`` returns one."""

    @property
    def linear(self) -> Named:
        """The system, or the closed loop."""

    @property
    def scene(self) -> Bodies:
        """The isolated body, and what is shaken."""

    @property
    def frequencies(self) -> Array:
        """Frequencies [Hz], shape (n,)."""

    @property
    def index(self) -> Array:
        """Frobenius index of the transmissibility, shape (n,)."""

    @property
    def singular_values(self) -> Array:
        """Singular values of the transmissibility, in descending order, shape (base directions, n)."""

    @property
    def compliance_values(self) -> Array:
        """Singular values of the compliance [m/N], in descending order, shape (6, n)."""

    @property
    def crossover(self) -> float:
        """Frequency [Hz] above which the body is isolated."""


def isolation(studies: Isolation | Sequence[Isolation], labels: Sequence[str] | None = None) -> Figure:
    """Draw transmissibility and compliance over frequency.

    Parameters
    ----------
    studies : Isolation or sequence of Isolation
        What is compared, for one with the range of its singular values.
    labels : sequence of str, optional
        Names for the legend; default: those of the models, and of their controllers.

    Returns
    -------
    matplotlib.figure.Figure
        The Frobenius index above, the largest compliance below; circles mark where isolation begins.

    Raises
    ------
    ModelError
        If there are no studies, or not as many labels.
    """
    listed = list(studies) if isinstance(studies, Iterable) else [studies]
    names = [study.linear.name for study in listed] if labels is None else list(labels)
    if not listed or len(names) != len(listed):
        raise ModelError(f"isolation plot: {len(listed)} studies and {len(names)} labels; expected at least one study, "
                         f"and a label for each.", field="labels")  # fmt: skip
    with style.context():
        figure = style.new_figure(6.4, 5.6)
        top, below = figure.subplots(2, 1, sharex=True)
        ends = [float("inf"), 0.0]
        for number, (study, name) in enumerate(zip(listed, names, strict=True)):
            f, look = study.frequencies, style.line(number)
            if len(listed) == 1:
                values = study.singular_values
                top.fill_between(f, values[-1], values[0], color=look["color"], alpha=0.15, linewidth=0.0)
            top.loglog(f, study.index, label=name, **look)
            below.loglog(f, study.compliance_values[0], **look)
            ends = [min(ends[0], f[0]), max(ends[1], f[-1])]
            if f[0] < study.crossover < f[-1]:
                top.plot([study.crossover], [1.0], "o", color=look["color"], mfc="white", markersize=5.0, zorder=3)
        top.axhline(1.0, color=style.MARK, linewidth=0.8)
        top.set_ylabel("index of transmissibility [1]")
        below.set_ylabel("largest compliance [m/N]")
        style.frequency_axis(below, ends[0], ends[1])
        top.set_title(f"Isolation of {listed[0].scene.body} from {listed[0].scene.base}")
        style.name_systems(figure, names, top)
    return figure
