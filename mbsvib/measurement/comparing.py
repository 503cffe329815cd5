"""Models, systems and measurements compared: modes paired by their shapes, responses over common lines, parts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.common.columnar import Columnar, by_name
from mbsvib.common.display import Displayed
from mbsvib.common.expected import kind_of
from mbsvib.errors import ResponseError, an, counted
from mbsvib.linalg.matching import NEXT, mac, subspace_mac
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.differences import Difference, differences
from mbsvib.measurement.matching import ORDERS, Matching, matching_of
from mbsvib.measurement.modes import MeasuredModes
from mbsvib.responses.frequency_grid import resonant_grid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.plots._sheet import Given

# Lines of two measurements that differ by less, relative, are the same.
SAME_LINE = 1e-6
# Share of the largest response of the same units below which one is zero by symmetry, but for rounding.
NEGLIGIBLE = 1e-10
# A shape at the outputs that is smaller by this against that of the most visible mode is not seen: it is rounding.
UNSEEN = 1e-6
# What a factor e between the frequencies of a pair counts against its MAC: it decides where shapes are the same.
TIE = 0.02
FARTHEST = 5.0  # factors e beyond which all count alike: rigid modes are at 0 Hz
MOST_LINES = 1000  # of those that resolve the resonances of two models; more do not change the FRAC by much
POOR = 0.5  # pairs with a lower MAC are marked
LIMITS = (0.01, np.pi / 18)  # of places that are the same [m, rad], as of ``Measurement.matched``
NOTES = 12  # differences that the table shows
NO_LINES = "No common lines: responses were not compared."


@dataclass(frozen=True, slots=True)
class Pair:
    """Mode ``a`` of the one and ``b`` of the other, counted from 1, with frequencies [Hz], damping ratios and words."""

    a: int
    b: int
    mac: float
    frequencies: tuple[float, float]
    damping_ratios: tuple[float, float]
    motion: str

    @property
    def difference(self) -> float:
        """Relative difference of the frequencies, f_b / f_a - 1."""
        first, second = self.frequencies
        return second / first - 1.0 if first else (0.0 if second == first else np.inf)


@dataclass(frozen=True, repr=False, eq=False)
class Comparison(Columnar, Displayed):
    """How far two models or measurements agree, printed as a table.

    ``mac`` (modes of a, modes of b) is |a^H b|^2 / (a^H a b^H b) over ``shape_outputs``. ``pairs`` are modes assigned
    to each other by it, or, where modes have one frequency, by the share in their subspace. ``frac`` (outputs, inputs)
    is |sum a b*|^2 / (sum |a|^2 sum |b|^2) of the ``responses`` over ``omega`` [rad/s], and ``ratio`` the root mean
    square of b over that of a. ``differences`` are those of the parts.
    """

    _engine = "record shape_outputs"

    names: tuple[str, str]
    """Names of a and b."""
    mac: Array
    pairs: tuple[Pair, ...]
    shape_outputs: tuple[str, ...]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    frac: Array
    ratio: Array
    omega: Array
    differences: tuple[Difference, ...]
    responses: tuple[Complex, Complex] = field(repr=False)
    remarks: tuple[str, ...] = ()
    """What could not be compared, in words."""

    def columns(self) -> dict[str, Any]:
        """Return the pairs of modes as columns (pairs,) by name: ``mode_a``, ``mode_b``, ``mac``, ``frequency_a_hz``,
        ``frequency_b_hz``, ``damping_ratio_a``, ``damping_ratio_b``, ``largest_motion``.
        """
        names = ("mode_a", "mode_b", "mac", "frequency_a_hz", "frequency_b_hz", "damping_ratio_a", "damping_ratio_b",
                 "largest_motion")  # fmt: skip
        return by_name(names, [(p.a, p.b, p.mac, *p.frequencies, *p.damping_ratios, p.motion) for p in self.pairs])

    def table(self) -> dict[str, Any]:
        """Return title, columns, rows and notes of the table that ``print`` shows."""
        rows = [(p.a, p.b, f"{p.mac:.3f}", *(f"{f:.6g}" for f in p.frequencies),
                 f"{round(100 * p.difference, 2) + 0.0:+.2f}",  # no minus zero
                 *("" if np.isnan(z) else f"{100 * z:.3g}" for z in p.damping_ratios),
                 p.motion + (" (poor)" if p.mac < POOR else "")) for p in self.pairs]  # fmt: skip
        headers = ("mode", "mode", "MAC", "f [Hz]", "f [Hz]", "difference [%]", "damping [%]", "damping [%]")
        notes = [*self.remarks]
        worst = [divmod(int(k), len(self.inputs)) for k in np.argsort(np.round(self.frac, 4), axis=None, kind="stable")
                 if not np.isnan(self.frac.flat[k])]  # fmt: skip
        notes += [f"{difference}" for difference in self.differences[:NOTES]]
        more = len(self.differences) - NOTES
        notes += [f"and {counted(more, 'other difference')}: .differences"] if more > 0 else []
        for o, i in worst[:NOTES]:
            zero = {0.0: "zero in the second", np.inf: "zero in the first"}.get(float(self.ratio[o, i]))
            told = zero or f"FRAC {self.frac[o, i]:.4f}, rms ratio {self.ratio[o, i]:.4g}"
            notes.append(f"{self.outputs[o]} / {self.inputs[i]}: {told}")
        more = len(worst) - NOTES
        notes += [f"and {counted(more, 'other response')} with FRAC as high or higher"] if more > 0 else []
        return {"title": f"{self.names[0]} and {self.names[1]}",
                "columns": [*((header, "right") for header in headers), ("largest motion", "left")],
                "rows": rows, "notes": notes}  # fmt: skip

    def record(self) -> dict[str, Any]:
        """Return all numbers as what JSON can hold: names, pairs, MAC, FRAC and differences."""
        return {
            "names": list(self.names), "outputs": list(self.outputs), "inputs": list(self.inputs),
            "pairs": [{"a": p.a, "b": p.b, "mac": p.mac, "frequencies": list(p.frequencies), "motion": p.motion}
                      for p in self.pairs], "mac": self.mac.tolist(),
            "frac": [[None if np.isnan(x) else x for x in row] for row in self.frac.tolist()],
            "differences": [{"part": d.part, "quantity": d.quantity, "values": list(d.values), "unit": d.unit}
                            for d in self.differences],
        }  # fmt: skip

    def plot(self, *, ax: Given | None = None) -> Figure | Given:
        """Return a figure: the MAC as a matrix, and the differences of the paired frequencies.

        Parameters
        ----------
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            With modes counted from 1.
        """
        from mbsvib.plots.modes import comparison

        return comparison(self, ax=ax)


@dataclass(frozen=True, slots=True, eq=False)
class _Modes:
    frequencies: Array
    ratios: Array
    shapes: Array | Complex
    outputs: tuple[str, ...]
    turns: Bools  # which outputs are rotations
    words: tuple[str, ...]


def compare(a: Any, b: Any) -> Comparison:
    """Compare two models, systems or measurements: modes, responses and numbers of the parts.

    MAC = |a^H b|^2 / (a^H a b^H b),  FRAC = |sum a b*|^2 / (sum |a|^2 sum |b|^2)

    Modes are paired by the MAC over displacements of common outputs, not by frequency; modes within 0.1 % of each other
    as one subspace. A measured channel is that of a model by name, then by place and direction.

    Parameters
    ----------
    a, b : Model, System, StateSpace, ClosedLoop, Measurement or MeasuredModes
        What is compared; of measurements, the modes and the responses that they have.

    Returns
    -------
    Comparison
        Printed as a table; ``.mac``, ``.pairs`` (counted from 1), ``.frac``, ``.differences``, ``.plot()``.

    Raises
    ------
    ResponseError
        If there is no common output, or an argument is none of these.

    Source
    ------
    Allemang, R. J. (2003), The modal assurance criterion, Sound and Vibration 37(8), 14; Heylen, W., Lammens, S.
    (1996), FRAC: a consistent way of comparing frequency response functions.
    """
    sides = [_linear(value, name) for value, name in ((a, "a"), (b, "b"))]
    names = tuple(getattr(value, "name", "measurement") for value in sides)
    remarks: list[str] = []
    frac, ratio, omega, outputs, inputs, responses, refused = _responses(*sides)
    modes = [_modes(side) for side in sides]
    remarks += [text for text in refused if "has no partner" not in text]  # the others are of one side alone
    bare = dict.fromkeys(name for name, known in zip(names, modes, strict=True) if known is None)
    remarks += [f"Without shapes of modes of {' and '.join(bare)}, modes were not compared."] if bare else []
    pairs: tuple[Pair, ...] = ()
    table, shared = np.zeros((0, 0)), tuple[str, ...]()
    if modes[0] is not None and modes[1] is not None:
        shared, rows, radius = _shared_shapes(sides, modes)
        if shared:
            pairs, table, told = _paired(modes, rows)
            remarks += told
            remarks += [f"Rotations are multiplied by {radius:.3g} m for the MAC."] if radius else []
    if not shared and not outputs:
        listed = "; ".join(f"{name}: {', '.join(getattr(side, 'outputs', ())) or 'none'}"
                           for name, side in zip(names, sides, strict=True))  # fmt: skip
        what = "lines" if NO_LINES in refused else "output"
        raise ResponseError(f"compare: no common {what} ({listed}); expected the same names, or measured points at "
                            f"outputs of the model, and of measurements the same frequencies."
                            f"{''.join(f' {text[:1].upper()}{text[1:]}' for text in remarks[:2])}")  # fmt: skip
    return Comparison((names[0], names[1]), table, pairs, shared, outputs, inputs, frac, ratio, omega,
                      differences(a, b), responses, tuple(remarks))  # fmt: skip


def _linear(value: Any, name: str) -> Any:
    kind = kind_of(value)
    if isinstance(value, (Measurement, MeasuredModes)) or kind in ("system", "closed loop", "state space"):
        return value
    if kind == "model":
        return value.linearize()
    hint = " Take a part of its modes, system.reduced(20)." if kind == "sparse system" else ""
    raise ResponseError(f"compare: {name} is {an(kind or type(value).__name__)}; expected a Model, System, "
                        f"StateSpace, ClosedLoop, Measurement or MeasuredModes.{hint}")  # fmt: skip


def _is_measured(side: Any) -> bool:
    return isinstance(side, (Measurement, MeasuredModes))


def _matched(a: Any, b: Any, inputs: bool) -> tuple[Matching, bool]:
    """Return the partners in b of the channels of a, or in a of those of b, which is True for the second."""
    back = _is_measured(b) and not _is_measured(a)
    first, second = (b, a) if back else (a, b)
    kinds = ("output", "input") if inputs else ("output",)
    return matching_of(first, second, {}, LIMITS, kinds, partial=True), back


def _modes(side: Any) -> _Modes | None:
    """Modes with their displacements at the outputs."""
    if isinstance(side, Measurement):
        side = MeasuredModes.from_measurement(side) if side.modes else None
    if side is None or isinstance(side, MeasuredModes):
        if side is None or side.shapes is None:
            return None
        count = len(side.frequencies)
        ratios = np.full(count, np.nan) if side.damping_ratios is None else side.damping_ratios
        turns = np.array([abs(point.direction) > 3 for point in side.output_points], dtype=bool)
        return _Modes(side.frequencies, ratios, side.shapes, side.outputs, turns, ("",) * count)
    order = np.array([ORDERS[unit][1] if unit in ORDERS else -1 for unit in side.output_units])
    moves = np.flatnonzero(order >= 0)
    outputs = tuple(side.outputs[k] for k in moves)
    turns = np.array([side.output_units[k].startswith("rad") for k in moves], dtype=bool)
    if kind_of(side) == "system":
        found = side.modes()
        rows = (side.Cq + side.Cv + side.Ca)[moves]  # of each output, one of these is not zero
        words = tuple(f"{body} {'about' if axis[0][0] == 'r' else 'along'} {axis[0].lstrip('r')}" if axis else body
                      for body, *axis in found.strongest())  # fmt: skip
        return _Modes(found.frequencies, found.damping_ratios, rows @ found.shapes, outputs, turns, words)
    space = side.state_space()
    values, vectors = np.linalg.eig(space.A)
    kept = np.flatnonzero(values.imag > 0.0)
    kept = kept[np.argsort(np.abs(values[kept]))]
    values = values[kept]
    shapes = (space.C @ vectors[:, kept])[moves] / values ** order[moves, None]
    size = np.abs(values)
    return _Modes(size / (2 * np.pi), -values.real / size, shapes, outputs, turns, ("",) * len(size))


def _shared_shapes(sides: list[Any], modes: list[Any]) -> tuple[tuple[str, ...], list[Any], float]:
    """Names and rows of the common outputs of two sets of modes, in directions of the first.

    Rotations are multiplied by a radius [m], that at which they move as much as translations do over the modes of a
    model, normalised by mass: a radius of gyration. So units do not change the MAC. It is 0 without both kinds.
    """
    held = [MeasuredModes.from_measurement(side) if isinstance(side, Measurement) else side for side in sides]
    matching, back = _matched(held[0], held[1], inputs=False)
    first, second = (modes[1], modes[0]) if back else (modes[0], modes[1])
    partners = [p for p in matching.outputs if p.measured in first.outputs and p.name in second.outputs]
    one = first.shapes[[first.outputs.index(p.measured) for p in partners]]
    other = second.shapes[[second.outputs.index(p.name) for p in partners]]
    one = np.array([p.sign for p in partners])[:, None] * one if partners else one
    known = ~np.isnan(one).any(axis=1) & ~np.isnan(other).any(axis=1)
    names = tuple(p.name if back else p.measured for p, is_known in zip(partners, known, strict=True) if is_known)
    turns = np.array([second.turns[second.outputs.index(p.name)] or first.turns[first.outputs.index(p.measured)]
                      for p in partners], dtype=bool)[known]  # fmt: skip
    one, other = one[known], other[known]
    radius = 0.0
    if turns.any() and not turns.all():
        moved, turned = (np.linalg.norm(other[rows]) for rows in (~turns, turns))
        radius = float(moved / turned) if turned else 0.0
        one, other = (np.where(turns[:, None], radius, 1.0) * rows for rows in (one, other))
    return names, [other, one] if back else [one, other], radius


def _paired(modes: list[Any], rows: list[Any]) -> tuple[tuple[Pair, ...], Array, list[str]]:
    first, second = modes
    sizes = [np.linalg.norm(shapes, axis=0) for shapes in rows]  # of modes that no output shows, 0
    a, b = (shapes * (size > UNSEEN * size.max(initial=0.0)) for shapes, size in zip(rows, sizes, strict=True))
    table = mac(a, b)
    alike = np.maximum(subspace_mac(a, first.frequencies, b), subspace_mac(b, second.frequencies, a).T)
    alike *= np.multiply.outer(a.any(axis=0), b.any(axis=0))  # what no output shows has no partner
    logs = [np.log(np.maximum(one.frequencies, np.finfo(float).tiny)) for one in modes]
    apart = np.minimum(np.abs(np.subtract.outer(*logs)), FARTHEST)
    at = np.array(linear_sum_assignment(TIE * (apart - table) - alike))
    at = at[:, alike[at[0], at[1]] > 0.0]
    remarks: list[str] = []
    if max(table.shape) > len(a):
        remarks.append(f"{counted(max(table.shape), 'mode')} over {counted(len(a), 'common output')}: shapes do not "
                       f"tell all modes apart, frequencies decide; compare more outputs.")  # fmt: skip
    spaces = [str(i + 1) for i, k in at.T.tolist() if alike[i, k] > table[i, k] + NEXT]
    if spaces:
        remarks.append(f"Modes {', '.join(spaces)} of the first: MAC with all modes of one frequency, as a subspace.")
    pairs = [Pair(i + 1, k + 1, float(alike[i, k]), (float(first.frequencies[i]), float(second.frequencies[k])),
                  (float(first.ratios[i]), float(second.ratios[k])), first.words[i] or second.words[k])
             for i, k in at.T.tolist()]  # fmt: skip
    for label, size, used in zip(("first", "second"), table.shape, at, strict=True):
        alone = [str(k + 1) for k in range(size) if k not in used]
        if alone:
            remarks.append(f"{counted(len(alone), 'mode')} of the {label} without partner: {', '.join(alone[:NOTES])}.")
    return tuple(pairs), table, remarks


def _responses(a: Any, b: Any) -> tuple[Any, ...]:
    """FRAC, ratio, lines, outputs and inputs that both have, their responses, and why others were left out."""
    nothing: tuple[Any, ...] = np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0), (), (), (np.zeros((0, 0, 0)),) * 2, ()
    if isinstance(a, MeasuredModes) or isinstance(b, MeasuredModes):
        return nothing
    matching, back = _matched(a, b, inputs=True)
    if not (matching.outputs and matching.inputs):
        return *nothing[:-1], matching.refused
    named = [([getattr(p, end) for p in matching.outputs], [getattr(p, end) for p in matching.inputs])
             for end in (("name", "measured") if back else ("measured", "name"))]  # fmt: skip
    measured = [side.omega for side in (a, b) if isinstance(side, Measurement)]
    if len(measured) == 2:
        near = np.abs(measured[1][:, None] - measured[0]).argmin(axis=0)
        omega = measured[0][np.abs(measured[1][near] - measured[0]) <= SAME_LINE * measured[0]]
    else:
        grid = measured[0] if measured else resonant_grid(np.concatenate([a.poles(), b.poles()]))
        omega = grid if measured else grid[:: -(-len(grid) // MOST_LINES)]
    if not len(omega):
        return *nothing[:-1], (*matching.refused, NO_LINES)
    values = [_values(side, names, omega) for side, names in zip((a, b), named, strict=True)]
    factor = matching.factor(omega)
    values[0 if back else 1] = values[0 if back else 1] * factor
    both = np.isfinite(values[0]) & np.isfinite(values[1])
    first, second = (_without_rounding(np.where(both, value, 0.0), matching) for value in values)
    powers = [np.sum(np.abs(value) ** 2, axis=2) for value in (first, second)]
    with np.errstate(invalid="ignore", divide="ignore"):
        frac = np.abs(np.sum(first * second.conj(), axis=2)) ** 2 / (powers[0] * powers[1])
        ratio = np.sqrt(powers[1] / powers[0])
    frac[(powers[0] == 0.0) != (powers[1] == 0.0)] = 0.0
    return frac, ratio, omega, tuple(named[0][0]), tuple(named[0][1]), (values[0], values[1]), matching.refused


def _without_rounding(values: Complex, matching: Matching) -> Complex:
    """Responses with those set to 0 that are rounding beside others of the same units."""
    units = [[p.unit for p in partners] for partners in (matching.outputs, matching.inputs)]
    height = np.abs(values).max(axis=2)
    for output in set(units[0]):
        for source in set(units[1]):
            alike = np.ix_([unit == output for unit in units[0]], [unit == source for unit in units[1]])
            values[alike] *= (height[alike] > NEGLIGIBLE * height[alike].max())[:, :, None]
    return values


def _values(side: Any, names: tuple[list[str], list[str]], omega: Array) -> Complex:
    rows, columns = ([getattr(side, kind).index(name) for name in listed]
                     for kind, listed in zip(("outputs", "inputs"), names, strict=True))  # fmt: skip
    if not isinstance(side, Measurement):
        return np.asarray(side.frequency_response(omega)[np.ix_(rows, columns)])
    lines = np.abs(side.omega[:, None] - omega).argmin(axis=0)
    return np.asarray(side.responses[np.ix_(rows, columns, lines)])
