"""What is certain of uncertain plants: robust stability, the worst gain, the worst root mean square."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.common.selection import Names
from mbsvib.common.units import ratio
from mbsvib.errors import ResponseError
from mbsvib.feedback.closing import Matrices, closed_space, regular, transfer
from mbsvib.linalg.balancing import scaled
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.rank import ZERO_RATE
from mbsvib.linalg.spectrum import mean_size
from mbsvib.random.budget import random
from mbsvib.random.moments import Equations, moments
from mbsvib.random.slopes import mean_square_gradient
from mbsvib.responses.norms import pole_words
from mbsvib.uncertain.blocks import OFF_POLES
from mbsvib.uncertain.moment_bound import affine, moment_bound
from mbsvib.uncertain.results import RobustStability, WorstGain, WorstRms
from mbsvib.uncertain.rms_bound import behind_filters, energy_bound, mean_square_bound
from mbsvib.uncertain.scalings import Channels, Scalings, cover
from mbsvib.uncertain.search import Perturbed, gain, halved, peak_of, perturbed, values_at

LEAST, LARGEST = 0.05, 100.0  # factors on limits from and up to which destabilizing values are sought
WITHIN = 1.01  # the largest such factor of polynomials, which hold within the limits
STATIC = 1e-9  # share of the fastest pole below which a peak is static
HIGHEST = 1e3  # times the gain that is reached, up to which a bound is sought
SHARES = (0.2, 0.5, 0.8, 0.95, 0.99)  # of the factor that is reached, at which stability is to be proven in turn
MOST, FEW = 100, 40  # frequencies at which scalings are sought for a proof, and for one of its boxes
CLOSE = 0.02  # share above what is reached, up to which a bound of a root mean square is not sought in another way
HALVINGS = 2  # of the way between what is proven and what is not


@dataclass(frozen=True, eq=False)
class Proof:
    """Equations whose first ``r`` inputs and outputs are those of changes delta, in units of time of the mean pole, 1 /
    ``unit`` [s]; a gain is that between all others. ``sizes``: repetitions of each parameter.
    """

    space: Matrices
    sizes: tuple[int, ...]
    unit: float

    @property
    def r(self) -> int:
        """Number of channels of parameters."""
        return sum(self.sizes)

    def channels(self, box: Array, g: float) -> Channels | None:
        """Return channels from -1 to 1 within a box (parameters, 2) of changes, and the gain over g; None if the
        equations in the middle of the box are not stable.
        """
        middle, half = (np.repeat(part, self.sizes) for part in (box.mean(axis=1), 0.5 * np.diff(box, axis=1)[:, 0]))
        a, b, c, d = self.space
        r = self.r
        law = np.zeros((0, 0)), np.zeros((0, r)), np.zeros((r, 0)), np.diag(middle)
        if not regular(d[:r, :r] @ law[3]):
            return None
        a, b, c, d, *_ = closed_space(self.space, law, list(range(r)), list(range(r)))
        if len(a) and np.linalg.eigvals(a).real.max() >= 0.0:
            return None
        left = np.append(half, np.ones(len(c) - r))[:, None]
        return Channels(*scaled(a, b, left * c), left * d, self.sizes, b.shape[1] - r).over(g)

    def holds(self, limits: Array, starts: list[float], g: float = 1.0, most: int = MOST) -> bool:
        """Return whether the equations are proven stable, and the gain below g, everywhere within limits.

        Where scalings do not prove it for a box, the box is halved along the parameter that does most there.
        """
        boxes, budget = [limits], most
        while boxes:
            box = boxes.pop()
            channels = self.channels(box, g)
            if channels is None or budget <= 0:
                return False
            known: list[Scalings] = []
            w = cover(channels, known, starts, min(budget, FEW))
            budget -= len(known) + 1
            if w is not None:
                k = self._most(channels, w)
                boxes += [box.copy(), box.copy()]
                boxes[-2][k, 1] = boxes[-1][k, 0] = box[k].mean()
        return True

    def _most(self, channels: Channels, w: float) -> int:
        """The parameter that does most to the others at a frequency."""
        size = np.abs(channels.at(np.array([w]))[0])
        both = size[: self.r].sum(axis=1) * size[:, : self.r].sum(axis=0)
        owner = np.repeat(np.arange(len(self.sizes)), self.sizes)
        return int(np.bincount(owner, weights=np.sqrt(both)).argmax())


def _proof(plant: Any, problem: Perturbed, velocities: bool = True) -> Proof:
    r, (space, unit) = len(problem.owner), _decaying(plant, problem)
    at = np.flatnonzero(np.repeat([block.inertial for block in plant.parameters], list(plant.blocks.values())))
    space = even_gain(by_velocities(space, at, r) if velocities else space, r)
    return Proof(space, tuple(plant.blocks.values()), unit)


def _decaying(plant: Any, problem: Perturbed) -> tuple[Matrices, float]:
    """The equations without motions that last but that no output shows, in units of time of the mean pole, and 1 / the
    unit.
    """
    r = len(problem.owner)
    a, b, c, d = problem.space
    rows, columns = [*range(r), *problem.shown], [*range(r), *problem.sources]
    b, c, d = b[:, columns], c[rows], d[np.ix_(rows, columns)]
    parts = separated(a, b, c)
    for group in parts.lasting:
        if group.shown.any() or (group.part.poles.real > group.part.errors[0]).any():
            raise ResponseError(f"uncertain '{plant.name}': {pole_words(group.pole)} does not decay at the nominal "
                                f"values, so that there is no margin. Give it damping, or change the controller."
                                )  # fmt: skip
    rest = parts.decaying
    unit = mean_size(rest.poles)
    return (*scaled(rest.a / unit, rest.b / unit, rest.c), d), unit


def even_gain(space: Matrices, r: int) -> Matrices:
    """Equations in units of the gain's signals in which parameters and gain do as much to each other."""
    a, b, c, d = space
    size = np.abs(transfer(space, 1j * OFF_POLES)).max(axis=0)
    to, of = np.linalg.norm(size[:r, r:]), np.linalg.norm(size[r:, :r])
    unit = np.sqrt(to / of) if to and of else 1.0
    rows, columns = (np.where(np.arange(count) < r, 1.0, unit) for count in d.shape)
    return a, b / columns, rows[:, None] * c, rows[:, None] * d / columns


def by_velocities(space: Matrices, at: Index, r: int) -> Matrices:
    """Equations in which inertial channels have velocities as z and impulses as w: T^-1 M T with T = s there.

    Real parameters commute with s, so that T changes nothing of what is true. Constant scalings G of opposite sign
    prove now that masses and springs exchange energy and no more; in accelerations these would depend on frequency.
    Gains of accelerations have T = s too. Where a signal would become improper, the equations stay as they are.
    """
    a, b, c, d = space
    for rows, columns in ((at, at), (np.concatenate((at, np.arange(r, len(c)))),
                                     np.concatenate((at, np.arange(r, b.shape[1]))))):  # fmt: skip
        if not len(a) or not len(at):
            break
        both, wanted = np.concatenate((a, b), axis=1), np.concatenate((c[rows], d[rows]), axis=1)
        x = np.linalg.lstsq(both.T, wanted.T, rcond=None)[0].T
        others = np.delete(d, rows, axis=0)[:, columns]
        if np.abs(x @ both - wanted).max() > ZERO_RATE * np.abs(wanted).max() or others.any():
            continue
        b, c, d = b.copy(), c.copy(), d.copy()
        c[rows], d[rows] = x, 0.0
        d[:, columns], b[:, columns] = c @ b[:, columns], a @ b[:, columns]
        return *scaled(a, b, c), d
    return space


def robust_stability(plant: Any, accuracy: float) -> RobustStability:
    """Return the factors of robust stability."""
    problem = perturbed(plant, [], [])
    proof = _proof(plant, problem)
    largest = WITHIN if plant.error else LARGEST
    found = problem.destabilizing(LEAST, largest)
    starts: list[float] = []
    upper, values, omega = np.inf, {}, np.nan
    if found is not None:
        upper, delta = found
        values = values_at(plant, delta)
        if (closed := problem.closure(delta)) is None:
            omega = np.inf
        else:  # of the rightmost pole
            omega = abs(float(max(np.linalg.eigvals(closed.closed[0]).tolist(), key=lambda pole: pole.real).imag))
        starts = [omega / proof.unit] if np.isfinite(omega) else []

    def proves(t: float) -> bool:
        return proof.holds(t * problem.limits, starts)

    lower, last = 0.0, min(upper, largest)
    for share in (*SHARES, 1.0 - accuracy):  # upwards: what is proven costs less than what is not
        if not proves(share * last):
            lower = halved(proves, lower, share * last, HALVINGS, 0.02 * last)[0]
            break
        lower = share * last
    return RobustStability(plant.name, lower, upper, values, omega, plant.parameters)


def worst_gain(plant: Any, outputs: Names, inputs: Names, accuracy: float) -> WorstGain:
    """Return bounds of the largest gain within the limits."""
    problem = perturbed(plant, outputs, inputs)
    proof = _proof(plant, problem)
    lower, delta = problem.highest(gain)
    values = values_at(plant, delta)
    part = plant.nominal.with_ports(outputs, inputs)
    alone = len(part.outputs) == len(part.inputs) == 1
    unit = ratio(part.output_units[0], part.input_units[0]) if alone else ""
    known = plant.parameters, tuple(part.outputs), tuple(part.inputs), unit
    if np.isinf(lower):
        return WorstGain(plant.name, np.inf, np.inf, values, np.nan, *known)
    closed = problem.closure(delta)
    assert closed is not None
    omega = float(peak_of(closed.closed).omega or 0.0)
    if omega <= STATIC * float(np.abs(np.linalg.eigvals(closed.closed[0])).max(initial=0.0)):
        omega = 0.0
    if lower == 0.0:
        return WorstGain(plant.name, 0.0, 0.0, values, 0.0, *known)

    def proves(g: float) -> bool:
        return proof.holds(problem.limits, [omega / proof.unit], g)

    below, share = lower, accuracy
    while share < HIGHEST:
        above = lower * (1.0 + share)
        if proves(above):
            upper = halved(proves, above, below, HALVINGS, lower * accuracy)[0]
            return WorstGain(plant.name, lower, upper, values, omega, *known)
        below, share = above, 6.0 * share
    return WorstGain(plant.name, lower, np.inf, values, omega, *known)


def worst_rms(plant: Any, outputs: Names, floor: Mapping[str, Any]) -> WorstRms:
    """Return bounds of the largest root mean squares within the limits."""
    under = random(plant.nominal, floor, outputs, None, None, None)
    if not under.exact:
        raise ResponseError(f"worst_rms of '{plant.name}': expected filtered white noise at all sources, whose mean "
                            f"squares are exact: a number, or isolation.shaped(...).")  # fmt: skip
    everywhere = list(range(len(under.sources.names)))
    result, places, upper = {}, {}, {}
    for name in under.outputs:
        single = replace(under, linear=under.linear.with_ports(name), weights=(None,))
        problem = perturbed(plant, name, list(under.sources.names))

        def square(space: Matrices, single: Any = single) -> tuple[float, Array]:
            one = Equations(*space)
            zero = np.zeros((len(one.a) + 1, len(one.a) + len(everywhere)))
            if len(one.a) and np.linalg.eigvals(one.a).real.max() >= 0.0:
                return np.inf, zero
            value = float(moments(single.behind_filters(everywhere, one).all, plant.name)[0].sum())
            return value, mean_square_gradient(single, one, everywhere) if 0.0 < value < np.inf else zero

        value, delta = problem.highest(square)
        places[name] = values_at(plant, delta)
        result[name] = float(np.sqrt(value))
        upper[name] = result[name] if value in {0.0, np.inf} else max(
            result[name], _rms_bound(plant, problem, single, result[name], name))
    return WorstRms(plant.name, result, places, upper)


def _rms_bound(plant: Any, problem: Perturbed, under: Any, reached: float, output: str) -> float:
    """A root mean square that no values exceed, infinite if none is proven."""
    filters = [part.filter for part in under.sources.densities]
    bound = float(np.sqrt(energy_bound(plant.linear, plant.parameters, output, under.sources.names, filters)))
    if bound <= (1.0 + CLOSE) * reached:
        return bound
    white = behind_filters(problem, filters)
    space, unit = _decaying(plant, white)
    equations = affine(space, white.owner, white.limits)
    if equations is not None:
        bound = min(bound, float(np.sqrt(unit * moment_bound(equations, reached**2 / unit))))
    if bound <= (1.0 + CLOSE) * reached:
        return bound
    forms = [_proof(plant, white, velocities).channels(white.limits, 1.0) for velocities in (True, False)]
    known = [form for form in forms if form is not None]
    beyond = [form for form in known if not form.d[:, form.count :].any()]
    return min(bound, float(np.sqrt(unit * mean_square_bound(known[0], beyond[0])))) if beyond else bound
