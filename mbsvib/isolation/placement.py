"""Places of sensors and actuators: sets of candidates, ranked by what they see and do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import hertz
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError
from mbsvib.isolation.placement_problems import Candidates, by_modes, by_parameters, by_rms, evaluation, score_of
from mbsvib.isolation.placement_search import search
from mbsvib.linalg.rank import SAME_FIGURE
from mbsvib.plots._sheet import Given
from mbsvib.plots.studies import placement_figure

COLUMNS = 4  # values that have columns of their own in tables


@dataclass(frozen=True, repr=False)
class PlacedSet(Displayed):
    """Some ``sensors`` and ``actuators``: their ``score``, and ``values`` {name: number}.

    By modes or parameters the score is the share of the information of all candidates that is left, from 0 to 1, and
    ``values`` are the shares of each. By root mean squares it is the root of the cost, and ``values`` are the root mean
    squares [unit] of outputs and of chosen actuators.
    """

    sensors: tuple[str, ...]
    actuators: tuple[str, ...]
    score: float
    values: Mapping[str, float]


@dataclass(frozen=True, repr=False, eq=False)
class Placement(Columnar, Displayed):
    """Ranked ``sets``, the best first; ``everything`` is the set of all candidates.

    ``bound``: no set has a better score, of an ``exhaustive`` search that of the best set; ``count`` sets there are,
    ``tried`` of them were compared. Sets of equal scores are in the order in which candidates were named.
    """

    name: str
    """Name of the model."""
    criterion: str
    """Name of the criterion."""
    larger: bool
    """Whether a larger score is better."""
    sets: tuple[PlacedSet, ...]
    everything: PlacedSet
    bound: float
    count: int
    tried: int
    targets: tuple[str, ...] = field(default=(), repr=False)
    """Labels of the values of each set; none: as its ``values`` name them."""

    @property
    def best(self) -> PlacedSet:
        """The first set."""
        return self.sets[0]

    @property
    def exhaustive(self) -> bool:
        """Whether all sets were compared."""
        return self.tried == self.count

    @property
    def gap(self) -> float:
        """By which share a set that was not tried may be better than the best one, at most."""
        ratio = self.bound / self.best.score if self.best.score else np.inf
        return max(0.0, ratio - 1.0 if self.larger else 1.0 - ratio)

    def columns(self) -> dict[str, Any]:
        """Return a row for each set, the best first: its sensors and actuators, its score, and the values by name."""
        names = {side: np.array([", ".join(getattr(one, side)) for one in self.sets]) for side in
                 ("sensors", "actuators")}  # fmt: skip
        return {**names, "score": np.array([one.score for one in self.sets]),
                **{name: np.array([one.values[name] for one in self.sets]) for name in self.best.values}}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the sets as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        shown = [*self.sets, self.everything]
        sides = [side for side in ("sensors", "actuators") if any(getattr(one, side) for one in self.sets)]
        values = list(self.targets) if self.targets else list(self.best.values)
        columns: list[tuple[str, Any]] = [("rank", "right"), *[(side, "left") for side in sides],
                                          ("share" if self.larger else "cost", "right")]  # fmt: skip
        few = len(values) <= COLUMNS
        columns += [(name, "right") for name in values] if few else [("least", "left")]
        rows = []
        for rank, one in zip([*self._ranks(), "all"], shown, strict=True):
            names = [", ".join(getattr(one, side)) if one is not self.everything else "all" for side in sides]
            least = min(one.values, key=lambda name: np.nan_to_num(one.values[name]), default="")
            cells = [_number(one.values[name]) for name in values] if few else [
                f"{least}: {_number(one.values[least])}"]  # fmt: skip
            rows.append((rank, *names, _number(one.score), *cells))
        side = "above" if self.larger else "below"
        note = f"All {self.count} sets were compared." if self.exhaustive else (
            f"{self.tried} of {self.count:.3g} sets were compared, by exchanges from a greedy choice. No set is "
            f"more than {100 * self.gap + 0.05:.1f} % {side} the best of them.")  # fmt: skip
        return {"title": f"Placement in {self.name}, by {self.criterion}", "columns": columns, "rows": rows,
                "notes": [note]}  # fmt: skip

    def _ranks(self) -> list[str]:
        """Ranks in which sets of equal scores share one."""
        ranks: list[str] = []
        first = 0
        for k, one in enumerate(self.sets):
            if abs(one.score - (score := self.sets[first].score)) > SAME_FIGURE * score:
                first = k
            ranks.append(str(first + 1))
        return ranks

    def plot(self, *, ax: Given | None = None) -> Figure | Given:
        """Draw the scores of the sets, with which candidates each has.

        Parameters
        ----------
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            The figure.
        """
        sets = [(*one.sensors, *one.actuators) for one in self.sets]
        label = "share of the information [1]" if self.larger else "root of the cost [1]"
        return placement_figure(self.name, f"by {self.criterion}", sets, [one.score for one in self.sets], self.bound,
                                label, (*self.everything.sensors, *self.everything.actuators), ax)  # fmt: skip


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.4g}"


def placement(
    system: Any, candidates: Names, sensors: int = 0, actuators: int = 0, *,
    modes: int | Iterable[int] | str | None = None, rms: Mapping[str, float] | None = None,
    parameters: Any = None, floor: Mapping[str, Any] | None = None, frequencies: ArrayLike | None = None,
    noise: Mapping[str, float] | None = None, ranges: Mapping[str, float] | None = None,
    best: int = 10, most: int = 2000,
) -> Placement:  # fmt: skip
    """Return the best sets of sensors and actuators among candidates, ranked.

    By ``modes``: the Gramians of the modes, W = sum over the set of W_k, the score is (det W / det W_all)^(1/2n);
    by ``parameters``: the same of the information F = sum over lines of Re(dG^H dG) range^2 / noise;
    by ``rms``: the least of J = sum of (rms z / allowed)^2 + sum of (rms u / range)^2 under any controller (LQG), of
    sensors alone the error with which z is estimated. The score is its root. No unit changes a rank.

    Parameters
    ----------
    system : System, StateSpace or ClosedLoop
        The plant, with all candidates as outputs and inputs.
    candidates : str or sequence of str
        Outputs that may be measured and inputs that may be driven, names or patterns.
    sensors, actuators : int
        How many are chosen; 0: that side is left out. For parameters, 0 actuators: all inputs excite, one at a time.
    modes : int, iterable of int or str, optional
        Numbers of modes from 1, as tables print them, or "*" for all. Of modes of one frequency, all are named.
        Damping ratios below 1e-6 count as equal.
    rms : mapping of str to float, optional
        Allowed root mean square [unit] of each output to keep small, by name or pattern.
    parameters : str or sequence of str, optional
        Parameters to identify, by name or pattern.
    floor : mapping of str to density, optional
        With ``rms``: noise that acts on the plant, as of ``rms`` of systems, filtered white noise.
    frequencies : array-like, shape (n,), optional
        With ``parameters``: lines [Hz] at which responses are measured.
    noise : mapping of str to float, optional
        Density of the noise of each sensor [unit^2/Hz], by name or pattern. With ``rms`` it is needed, else where
        sensors have several units.
    ranges : mapping of str to float, optional
        What each actuator can do, as root mean square or amplitude [unit]; needed as ``noise`` is.
    best : int
        Number of sets that are returned.
    most : int
        Number of sets up to which all are compared; of more, a greedy choice is improved by exchanges.

    Returns
    -------
    Placement
        The ranked sets, with a bound that no other set can beat.

    Raises
    ------
    ResponseError
        If a name is unknown, a unit makes candidates incomparable, or a mode or parameter is not seen by any candidate.

    Source: Gawronski, Advanced Structural Dynamics and Active Control of Structures (2004), chapter 7.
    """
    scene = Candidates.of(system, candidates, (sensors, actuators), noise, ranges)
    tasks = {"modes": modes, "rms": rms, "parameters": parameters}
    given = [name for name, value in tasks.items() if value is not None]
    if len(given) != 1:
        raise ResponseError(f"placement: {' and '.join(given) or 'no criterion'}; expected one of modes=, rms= and "
                            f"parameters=.")  # fmt: skip
    for name, value, owner in (("floor", floor, "rms"), ("frequencies", frequencies, "parameters")):
        if (value is not None) != (given == [owner]):
            raise ResponseError(f"placement: {name} {'is missing' if value is None else 'is given'}; expected it with "
                                f"{owner}=, and with that only.")  # fmt: skip
    best, most = check.count(best, "placement", "best", 1), check.count(most, "placement", "most", 1)
    larger = rms is None
    targets: tuple[str, ...] = ()
    criterion: Any
    if modes is not None:
        criterion, words = by_modes(scene, modes)
    elif parameters is not None:
        criterion, words = by_parameters(scene, parameters, hertz(frequencies))
    else:
        criterion, targets, words = by_rms(scene, rms, floor)
    evaluate = evaluation(scene, criterion, targets)
    sides = scene.outputs, scene.inputs

    def placed(numbers: tuple[Sequence[int], Sequence[int]]) -> PlacedSet:
        weights = [np.ones(len(side)) if not count else np.isin(np.arange(len(side)), own).astype(float)
                   for side, own, count in zip(sides, numbers, scene.chosen, strict=True)]  # fmt: skip
        score, values = evaluate(*weights)
        names = [tuple([side[k] for k in own]) if count else ()
                 for side, own, count in zip(sides, numbers, scene.chosen, strict=True)]  # fmt: skip
        return PlacedSet(names[0], names[1], score, values)

    everything = placed((range(len(sides[0])), range(len(sides[1]))))
    if not 0.0 < everything.score < np.inf:
        raise ResponseError("placement: not even all candidates together give a figure that is finite; a motion that "
                            "does not decay is out of their reach, or no noise acts on the outputs.")  # fmt: skip
    found = search(criterion, (len(sides[0]), len(sides[1])), scene.chosen, best, most)
    if not np.isfinite(found.losses[0]):
        what = " and ".join(f"{n} {kind}" for n, kind in zip(scene.chosen, ("sensors", "actuators"), strict=True) if n)
        reason = "makes the cost finite" if rms is not None else f"distinguishes {', '.join(everything.values)}"
        raise ResponseError(f"placement: no set of {what} {reason}; allow more of them, or require less.")  # fmt: skip
    bound = score_of(max(found.bound, 0.0) if not larger else found.bound, larger)
    return Placement(system.name, words, larger, tuple(map(placed, found.sets)), everything, bound, found.number,
                     found.tried, targets)  # fmt: skip
