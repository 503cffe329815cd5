"""Contents of a report, as plain lists and numbers for JSON, and the order in which signals are shown."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.api.system import System
from mbsvib.common import units
from mbsvib.common.selection import Names
from mbsvib.explain.dense import skipped
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.modes import MeasuredModes
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.modes import Modes
from mbsvib.modes.pairs import damping_ratios, without_rounding
from mbsvib.plots import _scene
from mbsvib.plots._curves import NEGLIGIBLE, curves, pick
from mbsvib.plots.modes import largest, shares
from mbsvib.plots.topology import laid_out
from mbsvib.report.comparison import compared_modes, has_geometry, measured_against, noted_differences
from mbsvib.report.form import COMPARED, form_of
from mbsvib.responses.frequency_grid import resolving_frequencies, span
from mbsvib.version import __version__


def inputs_in_order(system: Any, names: Sequence[str]) -> list[str]:
    """Return inputs, motions of the ground before forces."""
    return sorted(names, key=lambda name: system.input_units[system.inputs.index(name)] not in _motions(system))


def outputs_in_order(system: Any, names: Sequence[str]) -> list[str]:
    """Return outputs, those of the unit of a ground's motion first, and among these the payload's first.

    The payload is the body with most connections between it and the ground, on the shortest way.
    """
    away, ports = _distances(system), {port.name: port for port in getattr(_provenance(system), "ports", ())}

    def key(name: str) -> tuple[bool, int]:
        body = getattr(ports.get(name), "body", None)
        return system.output_units[system.outputs.index(name)] not in _motions(system), -away.get(body, 0)

    return sorted(names, key=key)


def _motions(system: Any) -> set[str]:
    """The units of inputs that are motions."""
    return {unit for unit in system.input_units if unit.startswith(("m", "rad"))}


def _provenance(system: Any) -> Any:
    return getattr(system, "provenance", None)


def _distances(system: Any) -> dict[str | None, int]:
    """Connections between each body and the ground, on the shortest way."""
    links = [(part.first, part.second) for part in getattr(_provenance(system), "parts", ()) if hasattr(part, "second")]
    away: dict[str | None, int] = {GROUND: 0}
    front = [GROUND]
    while front:
        reached = dict.fromkeys(there for pair in links for here, there in (pair, pair[::-1])
                                if here in front and there not in away)  # fmt: skip
        away |= dict.fromkeys(reached, away[front[0]] + 1)
        front = list(reached)
    return away


MOST_MODES = 60  # in motion at least; more are in the page up to MOST_MOTIONS numbers
MOST_MOTIONS = 60_000
_LISTS = "loops", "floating", "redundant", "cut", "skipped"
LABELS, MEASURED_LABELS = ("before", "after"), ("model", "measurement")


def collect(
    system: Any, outputs: Names = None, inputs: Names = None, other: Any = None, labels: tuple[str, str] = LABELS
) -> dict[str, Any]:
    """Return everything that a report shows; None for parts that need bodies where there are none.

    ``outputs``, ``inputs``: names of those to show; default: all. ``other``: equations or measurement to compare with.
    ``labels``: names of both on the page.
    """
    modes = system.modes()
    curves_of_pairs = responses(system, outputs, inputs)  # before `skipped`, which describes their computation
    has_scene = has_geometry(system)
    structure: dict[str, Any] = {"topology": None, **{name: [] for name in _LISTS}}
    if has_scene:
        topology = system.provenance.topology
        structure = {
            "topology": laid_out(topology, system.provenance.parts),
            "loops": _loops(system),
            "floating": [topology.bodies[i] for i in topology.floating],
            "redundant": list(system.redundant),
            "cut": list(system.cut_joints),
            "skipped": skipped(system, system.basis),
        }
    return {
        "name": system.name,
        "version": __version__,
        "facts": _facts(system, has_scene),
        "scene": _picture(system) if has_scene else None,
        "modes": _modes(system, modes, has_scene),
        "responses": curves_of_pairs,
        "motions": _parts_of_motions(system.inputs),
        "shares": _shares(system, modes) if has_scene else {"strain": [], "kinetic": []},
        **structure,
        "explained": system.explain() if has_scene else None,
        "compared": None if other is None else {"labels": list(labels)} | (
            measured_against(system, other) if isinstance(other, (Measurement, MeasuredModes))
            else _compared(system, other, (outputs, inputs))),
    }


def _parts_of_motions(inputs: Sequence[str]) -> dict[str, str]:
    """What the page says of inputs that are parts of the motion of one end: each curve is that of its part alone."""
    result: dict[str, str] = {}
    for name in inputs:
        stem = name.removesuffix(".displacement")
        rates = [f"{stem}.{rate}" for rate in ("velocity", "acceleration") if f"{stem}.{rate}" in inputs]
        if stem != name and rates:
            factors = zip(("iω", "(iω)²"), rates, strict=False)
            more = ", plus ".join(f"{factor} times that to {rate}" for factor, rate in factors)
            words = f"This is a part: the response to the displacement {stem} is that to {name}, plus {more}."
            result |= dict.fromkeys((name, *rates), words)
    return result


def _compared(system: Any, other: Any, names: tuple[Names, Names]) -> dict[str, Any]:
    """The modes of the other system, their pairs with those of this one, its responses, and differences in words."""
    outputs, inputs = (_common(names[0], other.outputs), _common(names[1], other.inputs))
    return {"pairs": compared_modes(system, other), "modes": _rows(other.modes()),
            "responses": responses(other, outputs, inputs), "notes": noted_differences(system, other),
            "measured": None}  # fmt: skip


def _common(names: Names, known: Sequence[str]) -> Names:
    """Of names that are given for the first system those that the second one has too; a pattern stays."""
    if names is None:
        return None
    requested = [names] if isinstance(names, str) else list(names)
    return [name for name in requested if name in known] or None


def finite(value: float) -> float | None:
    """Return a number, or None for values that JSON does not support."""
    return float(value) if np.isfinite(value) else None


def packed(values: NDArray[Any]) -> str:
    """Return an array as base64 of 32-bit floats, little-endian."""
    return b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def _facts(system: Any, has_scene: bool) -> list[list[Any]]:
    ports: list[list[Any]] = [["inputs", len(system.inputs)], ["outputs", len(system.outputs)]]
    if not has_scene:
        size = ["degrees of freedom", system.dof] if hasattr(system, "dof") else ["states", len(system.state_space().A)]
        return [size, *ports]
    topology = system.provenance.topology
    return [["degrees of freedom", system.dof], ["bodies", len(topology.bodies)], ["joints", len(topology.joints)],
            ["springs and dampers", len(system.provenance.springs)], ["loops cut", len(topology.cut)],
            ["redundant constraints", len(system.redundant)], *ports]  # fmt: skip


def _picture(system: System) -> dict[str, Any]:
    scene = _scene.of_system(system.name, system.provenance)
    return {
        "size": scene.size,
        "points": packed(scene.points),
        "first": scene.first.tolist(),
        "second": scene.second.tolist(),
        "share": np.round(scene.share, 5).tolist(),
        "firstArm": packed(scene.start - scene.position[scene.first]),
        "secondArm": packed(scene.end - scene.position[scene.second]),
        "lines": [[line.kind, line.name, line.first, line.last] for line in scene.lines],
        "marks": [[mark.kind, mark.name, mark.point, mark.words] for mark in scene.marks],
        "faces": scene.faces.tolist(),
    }


def _modes(system: Any, modes: Any, has_scene: bool) -> dict[str, Any]:
    bodies = len(system.bodies) if has_scene else 0
    shown = min(len(modes), max(MOST_MODES, MOST_MOTIONS // max(1, 12 * bodies))) if has_scene else 0
    result = {"rows": _rows(modes), "shown": shown, "bodies": bodies, "remarks": list(modes.remarks()), "motion": ""}
    if has_scene:
        motion = system.body_motion @ modes.shapes[:, :shown]
        both = np.stack((motion.real, np.imag(motion)), axis=-1)  # bodies, 6, modes, 2
        result["motion"] = packed(np.moveaxis(both, 2, 0))
    return result


def _rows(modes: Any) -> list[dict[str, Any]]:
    strongest = [" ".join(most) for most in modes.strongest()] or [""] * len(modes)
    pairs = without_rounding(modes.pairs, modes.pair_errors)
    return [
        {"natural": finite(f), "damped": finite(d), "ratio": finite(z), "error": finite(e.max()), "most": most,
         "values": [[finite(value.real), finite(value.imag)] for value in pair]}
        for f, d, z, e, most, pair in zip(modes.frequencies, modes.damped_frequencies, damping_ratios(pairs),
                                          modes.pair_errors, strongest, pairs, strict=True)
    ]  # fmt: skip


def responses(system: Any, outputs: Names, inputs: Names) -> dict[str, Any] | None:
    """Return the ports and the form from which the page computes all curves; None if there is no response.

    ``outputs``, ``inputs``: names of those to show; default: all.
    """
    poles = system.poles()
    if not (system.inputs and system.outputs and len(poles)):
        return None
    sources = inputs_in_order(system, pick(system, "input", inputs))
    results = outputs_in_order(system, pick(system, "output", outputs))
    low, high = span(poles, None, None)
    grid = _some(resolving_frequencies(poles, poles, low, high))
    pairs = [(result, source) for source in sources for result in results]
    drawn = curves(system, pairs, grid)
    values = np.array([curve.values for curve in drawn]).reshape(len(sources), len(results), -1).swapaxes(0, 1)
    numbers = [system.outputs.index(name) for name in results], [system.inputs.index(name) for name in sources]
    alike = np.array([curve.negligible for curve in drawn]).reshape(len(sources), len(results)).T
    zero = alike | _vanishing(np.abs(values).max(axis=2, initial=0.0))
    return {
        "inputs": [[name, units.pretty(_unit(system.inputs, system.input_units, name))] for name in sources],
        "outputs": [[name, units.pretty(_unit(system.outputs, system.output_units, name))] for name in results],
        "span": [low, high],
        "poles": [[value.real, value.imag] for value in poles[poles.imag >= 0.0].tolist()],
        "units": [units.pretty(units.ratio(curve.output_unit, curve.source_unit)) for curve in drawn],
        "negligible": zero.T.ravel().tolist(),
        "form": form_of(system, numbers, 2.0 * np.pi * grid, values, ~zero).packed(),
    }


def _vanishing(height: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether largest values (outputs, inputs) are rounding, inputs and then outputs scaled to 1 at most."""
    for axis in (0, 1):
        largest = height.max(axis=axis, keepdims=True, initial=0.0)
        height = np.divide(height, largest, out=np.zeros_like(height), where=largest > 0.0)
    return height <= NEGLIGIBLE


def _some(grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evenly chosen frequencies of a grid: they judge which responses are zero, and the form."""
    return grid[np.unique(np.linspace(0, len(grid) - 1, min(len(grid), COMPARED)).astype(int))] if len(grid) else grid


def _unit(names: Sequence[str], known: Sequence[str], name: str) -> str:
    return known[names.index(name)]


def _shares(system: System, modes: Modes) -> dict[str, Any]:
    return {kind: [[name, _percent(values)] for name, values in largest(*shares(system, modes, kind))]
            for kind in ("strain", "kinetic")}  # fmt: skip


def _percent(values: NDArray[np.float64]) -> list[float | None]:
    return [finite(round(100.0 * float(value), 4)) for value in values]


def _loops(system: System) -> list[dict[str, Any]]:
    return [
        {"joints": list(group.joints), "rank": int(group.rank), "rows": len(group.rows), "kept": finite(group.retained),
         "dropped": finite(group.dropped), "length": finite(group.length), "redundant": list(group.redundant)}
        for group in system.provenance.reduction.groups
    ]  # fmt: skip
