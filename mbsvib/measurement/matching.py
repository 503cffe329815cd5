"""Which inputs and outputs of a model are those of a measurement: by name, then by place and direction."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from typing import Any, ClassVar

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar, by_name
from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError, an, nearest
from mbsvib.measurement.points import Place, Point, model_places, place_of, point_of

Candidate = tuple[str, str, Place | None]  # unit, quantity and place

# What a unit measures, and the number of its time derivatives.
ORDERS = {"m": ("length", 0), "m/s": ("length", 1), "m/s^2": ("length", 2), "rad": ("angle", 0),
          "rad/s": ("angle", 1), "rad/s^2": ("angle", 2)}  # fmt: skip
_QUANTITIES = {"displacement": 0, "velocity": 1, "acceleration": 2}
# Units of motions and forces that are not those of the model, such as mm, g, in/s and kgf.
_NOT_SI = re.compile(r"[pnu\u00b5mckMG]?(m|rad|N([ -]?[mc]?m)?|g|g_?n|g0|G|gf|in|inch|mil|ft|lbf?|deg|\u00b0)"
                     r"(/s(\^2)?)?|rpm")  # fmt: skip
# Other spellings of units.
_SPELLED = (("\u00b2", "^2"), ("**", "^"), ("*", " "), ("\u00b7", " "), ("\u03bc", "\u00b5"), ("/s/s", "/s^2"),
            ("/s2", "/s^2"), (" s^-2", "/s^2"), (" s^-1", "/s"), ("Nm", "N m"))  # fmt: skip
_KINDS = {**{unit: kind for unit, (kind, _) in ORDERS.items()}, "N": "force", "N m": "moment"}
# Another channel must be farther by this share of the limits than the nearest, or it may be meant as well.
CLEAR = 0.25
# Points [m] and directions [rad] of one place differ by no more, but for rounding.
SAME_POINT = 1e-9
# Candidates that a refusal lists.
_NEAREST = 3


def unit_of(given: str) -> str:
    """Return a unit as ``ORDERS`` spells it: m/s\u00b2, m/s2 and m/s/s are m/s^2."""
    unit = given.strip()
    for spelled, usual in _SPELLED:
        unit = unit.replace(spelled, usual)
    return unit


def is_si(unit: str) -> bool | None:
    """Return whether a unit is that of a model, or needs a factor, as mm and g do; None: others, such as V."""
    return True if unit in _KINDS else False if _NOT_SI.fullmatch(unit) else None


@dataclass(frozen=True, slots=True)
class Partner:
    """The channel ``name`` of a model that is the measured channel ``measured``.

    ``how``: "name" or "place". Measured is ``sign`` times the derivative of order ``derivatives`` in time of what the
    model has. ``distance`` [m] and ``angle`` [rad] of the places are None where these are not known.
    """

    measured: str
    name: str
    how: str
    sign: int
    derivatives: int
    measured_unit: str
    unit: str
    distance: float | None
    angle: float | None

    @property
    def scale_known(self) -> bool:
        """Whether the measured unit is an SI unit or not stated; volts and unknown units have any scale."""
        return self.unit not in _KINDS or not self.measured_unit or is_si(self.measured_unit) is True


@dataclass(frozen=True, repr=False)
class Matching(Columnar, Displayed):
    """The partner in a model of each output and input of a measurement, in the order of the measurement."""

    outputs: tuple[Partner, ...]
    """Partner of each output."""
    inputs: tuple[Partner, ...]
    """Partner of each input."""
    refused: tuple[str, ...] = ()  # why channels were left out, where that was allowed
    """Why channels were left out, where that was allowed."""

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs in the model."""
        return tuple(partner.name for partner in self.outputs)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs in the model."""
        return tuple(partner.name for partner in self.inputs)

    def factor(self, omega: Array) -> Complex:
        """Return the factors from responses of the model to measured responses.

        Parameters
        ----------
        omega : array, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (outputs, inputs, n)
            s_o s_i (i w)^(k_o - k_i); NaN at w = 0 where the power is negative.
        """
        (row_signs, row_powers), (signs, powers) = (
            (np.array([p.sign for p in partners]), np.array([p.derivatives for p in partners]))
            for partners in (self.outputs, self.inputs))  # fmt: skip
        power = np.subtract.outer(row_powers, powers)[:, :, None]
        w = np.asarray(omega, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            size = np.where((w == 0.0) & (power < 0), np.nan, w ** power.astype(float))
        turn = np.array([1, 1j, -1, -1j])[power % 4]
        return np.asarray(np.multiply.outer(row_signs, signs)[:, :, None] * turn * size)

    def columns(self) -> dict[str, Any]:
        """Return the channels as columns (outputs + inputs,) by name: ``kind`` ("output" or "input"), and the fields of
        ``Partner`` by their names; distances [m] and angles [rad] that are not known are not numbers.
        """
        rows = [(kind, *[np.nan if entry is None else entry for entry in astuple(partner)])
                for kind, partners in (("output", self.outputs), ("input", self.inputs)) for partner in partners]
        return by_name(("kind", *[field.name for field in fields(Partner)]), rows)

    def table(self) -> dict[str, Any]:
        """Return title, columns and rows of the table that ``print`` shows."""
        rows = []
        for kind, partners in (("output", self.outputs), ("input", self.inputs)):
            for p in partners:
                power = f"(iω)^{p.derivatives}" if p.derivatives else ""
                rows.append((kind, p.measured, p.name, p.how, "" if p.distance is None else f"{1e3 * p.distance:.3g}",
                             "" if p.angle is None else f"{np.degrees(p.angle):.3g}", "−" if p.sign < 0 else "+",
                             f"{p.measured_unit or '?'} / {p.unit or '?'}", power))  # fmt: skip
        names = ("", "measured", "model", "by", "distance [mm]", "angle [deg]", "sign", "unit", "factor")
        return {"title": "Channels of a measurement and of the model",
                "columns": [(name, "right" if "[" in name else "left") for name in names], "rows": rows}  # fmt: skip


class Matched:
    """Data with channels that a model has as well: those of ``_kinds``."""

    _kinds: ClassVar[tuple[str, ...]] = ("output", "input")

    def matched(
        self, linear: Any, names: Mapping[str, str] | None = None, distance: float = 0.01, angle: float = np.pi / 18
    ) -> Matching:
        """Return the outputs and inputs of a model that correspond to those of the data, by name, then by place.

        G_measured = s_o s_i (i w)^(k_o - k_i) G_model, with signs s, and k time derivatives between the quantities

        Parameters
        ----------
        linear : Model, System, ClosedLoop or StateSpace
            What has the inputs and outputs.
        names : dict of str to str, optional
            Names in the model of measured channels that have another name there.
        distance : float
            Largest distance [m] of places that are the same.
        angle : float
            Largest angle [rad] of directions that are the same, or opposite.

        Returns
        -------
        Matching
            A partner of each channel, printed as a table; ``.factor(omega)`` are the factors of the equation. Measured
            modes have outputs only.

        Raises
        ------
        ResponseError
            If a channel has no partner, or its unit, place or direction is another one.
        """
        return matching_of(self, linear, names or {}, (distance, angle), self._kinds)


def matching_of(
    measured: Any, linear: Any, names: Mapping[str, str], limits: tuple[float, float],
    kinds: Sequence[str] = ("output", "input"), partial: bool = False,
) -> Matching:  # fmt: skip
    """Return the partners of channels; ``limits``: largest distance [m] and angle [rad]; ``partial``: leave others out.
    """
    known = {node.number: node for node in getattr(measured, "nodes", ())}
    places = model_places(linear)
    every = [name for kind in kinds for name in getattr(measured, f"{kind}s")]
    unknown = [name for name in names if name not in every]
    if unknown:
        raise ResponseError(f"matched: names has {', '.join(map(repr, unknown))}, which the measurement has not. Its "
                            f"channels are {', '.join(every)}.")  # fmt: skip
    results: dict[str, tuple[Partner, ...]] = {}
    missing: list[str] = []
    for kind in kinds:
        candidates, partners = _candidates(linear, f"{kind}s", places), []
        for name, unit, quantity, point in _channels(measured, kind):
            channel = (name, unit, quantity, place_of(point, known))
            partner = _partner(channel, names.get(name), candidates, limits, kind)
            if isinstance(partner, str):
                missing.append(partner)
            else:
                partners.append(partner)
        results[kind] = tuple(partners)
    if missing and not partial:
        raise ResponseError(f"matched: {' '.join(missing)} Give names={{measured: name in the model}}, add the channel "
                            f"to the model, or leave it out: data[outputs, inputs].")  # fmt: skip
    return Matching(results["output"], results.get("input", ()), tuple(missing))


def _channels(side: Any, kind: str) -> Iterator[tuple[str, str, str, Point]]:
    """Name, unit, quantity and point of each; measured shapes are displacements, models say these by their units."""
    names = getattr(side, f"{kind}s")
    units = getattr(side, f"{kind}_units", ("",) * len(names))
    points = getattr(side, f"{kind}_points", (Point(0, 0),) * len(names))
    quantities = getattr(side, "quantity", ("displacement",) * len(names)) \
        if kind == "output" and hasattr(side, "output_points") else ("",) * len(names)  # fmt: skip
    return zip(names, units, quantities, points, strict=True)


def _candidates(linear: Any, kind: str, places: Mapping[tuple[str, str], Place]) -> dict[str, Candidate]:
    """Unit, quantity and place of each channel of the model by its name."""
    listed = getattr(linear, kind)
    units = ([port.unit for port in listed.values()] if hasattr(listed, "values")
             else getattr(linear, f"{kind[:-1]}_units", ("",) * len(listed)))  # fmt: skip
    quantities = linear.quantity if kind == "outputs" and hasattr(linear, "quantity") else ("",) * len(units)
    return {name: (unit, quantity, places.get((kind[:-1], name)))
            for name, unit, quantity in zip(listed, units, quantities, strict=True)}  # fmt: skip


def _partner(
    measured: tuple[str, str, str, Place | None], renamed: str | None,
    candidates: Mapping[str, Candidate], limits: tuple[float, float], kind: str,
) -> Partner | str:  # fmt: skip
    """Return the partner of a channel, or why it has none.

    ``measured``: name, unit, quantity and place.
    """
    name, unit, quantity, place = measured
    wanted = name if renamed is None else renamed
    if wanted in candidates:
        found, how = wanted, "name"
    else:
        near = {} if place is None or renamed is not None else {
            other: there for other, (_, _, there) in candidates.items() if there is not None}  # fmt: skip
        fits = [other for other, there in near.items() if _fits(place, there, limits)]
        fits = [other for other in fits if place and near[other].body == place.body] or fits
        if not fits:
            return f"the measured {kind} '{wanted}' has no partner.{_nearest(wanted, place, near, candidates)}"
        found, rivals = _clearest(measured, {other: near[other] for other in fits}, candidates, limits)
        how = "place"
        if rivals:
            return (f"the measured {kind} '{wanted}' may be each of several."
                    f"{_nearest(wanted, place, rivals, candidates)} Give a smaller distance=.")  # fmt: skip
    other_unit, other_quantity, there = candidates[found]
    distance = angle = None
    sign = 1
    if place is not None and there is not None:
        distance, angle = place.distance(there), _angle(place, there)
        sign = -1 if place.cosine(there) < 0.0 else 1
        if not _fits(place, there, limits):
            return (f"the measured {kind} '{name}' and '{found}' of the model have one name, but are "
                    f"{1e3 * distance:.3g} mm and {np.degrees(angle):.3g} deg apart (limits {1e3 * limits[0]:g} mm, "
                    f"{np.degrees(limits[1]):.3g} deg).")  # fmt: skip
    order = _derivatives(unit, quantity, other_unit, other_quantity)
    if order is None:
        return (f"the measured {kind} '{name}' has the unit {unit or 'of ' + an(quantity)}, and '{found}' of the model "
                f"{other_unit}.{'' if unit in _KINDS or not unit else ' Convert the data to SI units.'}")  # fmt: skip
    return Partner(name, found, how, sign, order, unit, other_unit, distance, angle)


def _clearest(
    measured: tuple[str, str, str, Place | None], fits: dict[str, Place],
    candidates: Mapping[str, Candidate], limits: tuple[float, float],
) -> tuple[str, dict[str, Place]]:  # fmt: skip
    """Return the nearest of the channels that fit, and all if others elsewhere are almost as near."""
    _, unit, quantity, place = measured
    assert place is not None
    off = {other: place.distance(there) / limits[0] + _angle(place, there) / limits[1] for other, there in fits.items()}
    best = min(off, key=lambda other: off[other])
    twins = [other for other, there in fits.items() if there.body == fits[best].body
             and there.distance(fits[best]) <= SAME_POINT and _angle(there, fits[best]) <= SAME_POINT]  # fmt: skip
    if any(off[other] < off[best] + CLEAR for other in off if other not in twins):
        return best, fits
    same = [other for other in twins if _derivatives(unit, quantity, *candidates[other][:2]) == 0]
    return (same or twins)[0], {}


def _angle(a: Place, b: Place) -> float:
    """Angle of two lines [rad], 0 to pi/2: pi/2 between a translation and a rotation."""
    cosine = abs(a.cosine(b))
    return float(np.arctan2(np.linalg.norm(a.direction - np.copysign(cosine, a.cosine(b)) * b.direction), cosine))


def _fits(a: Place | None, b: Place, limits: tuple[float, float]) -> bool:
    return a is not None and a.distance(b) <= limits[0] and _angle(a, b) <= limits[1]


def _derivatives(unit: str, quantity: str, other: str, other_quantity: str = "") -> int | None:
    """Time derivatives from the model's unit to what was measured; None where the two measure different things."""
    if other in _KINDS and (_KINDS[unit] != _KINDS[other] if unit in _KINDS else is_si(unit) is False):
        return None
    known = ORDERS[other][1] if other in ORDERS else _QUANTITIES.get(other_quantity)
    if known is None:
        return None if quantity and other in _KINDS else 0
    return (_QUANTITIES[quantity] if quantity else ORDERS[unit][1] if unit in ORDERS else known) - known


def _nearest(name: str, place: Place | None, near: Mapping[str, Place], candidates: Mapping[str, Any]) -> str:
    point = point_of(name)
    if place is None and point is not None:
        return f" Where node {point.node} is, is not known: give nodes={{{point.node}: (x, y, z)}}."
    if place is None or not near:
        return f"{nearest(name, candidates)} The model has {', '.join(candidates) or 'none'}."
    order = sorted(near, key=lambda other: place.distance(near[other]))[:_NEAREST]
    listed = [f"'{other}' ({1e3 * place.distance(near[other]):.3g} mm, "
              f"{np.degrees(_angle(place, near[other])):.3g} deg)" for other in order]  # fmt: skip
    return f" Nearest are {', '.join(listed)}."
