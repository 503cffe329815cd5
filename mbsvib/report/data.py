"""Contents of a report, as plain lists and numbers for JSON."""

from __future__ import annotations

from base64 import b64encode
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.explain.dense import skipped
from mbsvib.plots import _scene
from mbsvib.plots import _tree_layout as layout
from mbsvib.plots import _units as units
from mbsvib.plots._choice import pick
from mbsvib.plots._curves import curves
from mbsvib.plots.energy import largest, shares
from mbsvib.responses.frequency_grid import placed, roots, span
from mbsvib.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.api.system import System
    from mbsvib.modes import Modes
    from mbsvib.plots._choice import Names

MOST_MODES = 60  # with animation and energy shares; the table contains all modes
MOST_SAMPLES = 75_000  # of all curves together: 0.8 megabytes of the page
MOST_ZEROS = 5e7  # DOF cubed times pairs up to which zeros of each curve are computed: a second


def collect(system: System, outputs: Names = None, inputs: Names = None) -> dict[str, Any]:
    """Return everything that a report shows.

    Parameters
    ----------
    system : System
        The equations of motion.
    outputs, inputs : str or sequence of str, optional
        Names of those to show; default: all.

    Returns
    -------
    dict
        Lists, texts and numbers.
    """
    modes = system.modes()
    responses = _responses(system, outputs, inputs)  # before `skipped`, which describes their computation
    topology = system.provenance.topology
    return {
        "name": system.name,
        "version": __version__,
        "facts": _facts(system),
        "scene": _picture(system),
        "modes": _modes(system, modes),
        "responses": responses,
        "shares": _shares(system, modes),
        "topology": layout.graph(topology, system.provenance.parts),
        "loops": _loops(system),
        "floating": [topology.bodies[i] for i in topology.floating],
        "redundant": list(system.redundant),
        "cut": list(system.cut_joints),
        "skipped": skipped(system),
        "explained": system.explain(),
    }


def finite(value: float) -> float | None:
    """Return a number, or None for values that JSON does not support."""
    return float(value) if np.isfinite(value) else None


def packed(values: NDArray[Any]) -> str:
    """Return an array as base64 of 32-bit floats, little-endian."""
    return b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def _facts(system: System) -> list[list[Any]]:
    topology = system.provenance.topology
    counts = [("degrees of freedom", system.dof), ("bodies", len(topology.bodies)), ("joints", len(topology.joints)),
              ("springs and dampers", len(system.provenance.springs)), ("loops cut", len(topology.cut)),
              ("redundant constraints", len(system.redundant)), ("inputs", len(system.inputs)),
              ("outputs", len(system.outputs))]  # fmt: skip
    return [[what, count] for what, count in counts]


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


def _modes(system: System, modes: Modes) -> dict[str, Any]:
    shown = min(len(modes), MOST_MODES)
    strongest = [" ".join(most) for most in modes.strongest()] or [""] * len(modes)
    rows = [
        {"natural": finite(f), "damped": finite(d), "ratio": finite(z), "error": finite(e.max()), "most": most,
         "values": [[finite(value.real), finite(value.imag)] for value in pair]}
        for f, d, z, e, most, pair in zip(modes.frequencies, modes.damped_frequencies, modes.damping_ratios,
                                          modes.pair_errors, strongest, modes.pairs, strict=True)
    ]  # fmt: skip
    motion = system.body_motion @ modes.shapes[:, :shown]
    both = np.stack((motion.real, np.imag(motion)), axis=-1)  # bodies, 6, modes, 2
    return {"rows": rows, "shown": shown, "bodies": len(system.bodies), "remarks": list(modes.remarks()),
            "motion": packed(np.moveaxis(both, 2, 0))}  # fmt: skip


def _responses(system: System, outputs: Names, inputs: Names) -> dict[str, Any] | None:
    """Magnitude and phase over frequency of as many pairs as fit into the page, and which ones these are."""
    if not (system.inputs and system.outputs and system.dof):
        return None
    sources, results = pick(system, "input", inputs), pick(system, "output", outputs)
    totals = len(sources), len(results)
    poles = system.poles()
    grid = placed(poles, poles, *span(poles, None, None))
    sources, results = _fitting(sources, results, len(grid))
    if system.dof**3 * len(sources) * len(results) <= MOST_ZEROS:
        places = roots(system.basis, results, sources)
        grid = placed(places, poles, *span(poles, None, None))
        sources, results = _fitting(sources, results, len(grid))
    pairs = [(result, source) for source in sources for result in results]
    drawn_curves = curves(system, pairs, grid)
    return {
        "inputs": [[name, units.pretty(_unit(system.inputs, system.input_units, name))] for name in sources],
        "outputs": [[name, units.pretty(_unit(system.outputs, system.output_units, name))] for name in results],
        "left": [totals[0] - len(sources), totals[1] - len(results)],
        "frequencies": grid.tolist(),
        "units": [units.pretty(units.ratio(curve.output_unit, curve.source_unit)) for curve in drawn_curves],
        "negligible": [curve.negligible for curve in drawn_curves],
        "magnitude": packed(np.array([np.abs(curve.values) for curve in drawn_curves])),
        "phase": packed(np.array([curve.phase() for curve in drawn_curves])),
    }


def _fitting(sources: list[str], results: list[str], points: int) -> tuple[list[str], list[str]]:
    """Leave out the last of the inputs or outputs, whichever are more, until all curves fit into the page."""
    inputs, outputs = len(sources), len(results)
    while inputs * outputs > 1 and inputs * outputs * points > MOST_SAMPLES:
        inputs, outputs = (inputs - 1, outputs) if inputs > outputs else (inputs, outputs - 1)
    return sources[:inputs], results[:outputs]


def _unit(names: Sequence[str], known: Sequence[str], name: str) -> str:
    return known[names.index(name)]


def _shares(system: System, modes: Modes) -> dict[str, Any]:
    shown = min(len(modes), MOST_MODES)
    if system.provenance.from_matrices:
        return {"strain": [], "kinetic": []}
    return {kind: [[name, _percent(values[:shown])] for name, values in largest(*shares(system, modes, kind))]
            for kind in ("strain", "kinetic")}  # fmt: skip


def _percent(values: NDArray[np.float64]) -> list[float | None]:
    return [finite(round(100.0 * float(value), 4)) for value in values]


def _loops(system: System) -> list[dict[str, Any]]:
    return [
        {"joints": list(group.joints), "rank": int(group.rank), "rows": len(group.rows), "kept": finite(group.kept),
         "dropped": finite(group.dropped), "length": finite(group.length), "redundant": list(group.redundant)}
        for group in system.provenance.reduction.groups
    ]  # fmt: skip
