"""Two systems, or a system and what was measured: modes in pairs, differences in words, measured responses.

Modes of two systems are paired by their shapes where both have the same bodies, else by their frequencies.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mbsvib.common import units
from mbsvib.errors import ResponseError
from mbsvib.linalg.matching import subspace_mac
from mbsvib.measurement.comparing import compare
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.modes import MeasuredModes
from mbsvib.plots import _scene

# Of pairs that are alike to this the nearer in number is taken.
ORDER = 1e-9


def compared_modes(first: Any, second: Any) -> dict[str, Any]:
    """Return the modes of two systems in pairs, such that the sum of their MAC is largest.

    MAC = |a^H b|^2 / (a^H a b^H b) of displacements, and rotations times a length, of the bodies that both have. Where
    frequencies coincide, as in symmetric platforms, shapes span a plane: the MAC is then the share of b in that plane,
    or that of a in the plane of b, whichever is larger.

    Returns ``by``: "shape" or "frequency"; ``rows``: numbers of the modes from 0 or None, MAC or None.
    """
    a, b = first.modes(), second.modes()
    n, k = len(a), len(b)
    shapes = _shared(first, second)
    if shapes is None:
        with np.errstate(divide="ignore"):
            x, y = np.log(a.frequencies), np.log(b.frequencies)
        both_rest = np.isneginf(x)[:, None] & np.isneginf(y)[None, :]
        with np.errstate(invalid="ignore"):
            alike = np.where(both_rest, 1.0, -np.minimum(np.abs(x[:, None] - y[None, :]), 1e3))
    else:
        alike = np.maximum(subspace_mac(shapes[0], a.frequencies, shapes[1]),
                           subspace_mac(shapes[1], b.frequencies, shapes[0]).T)  # fmt: skip
    in_order = ORDER * np.abs(np.arange(n)[:, None] - np.arange(k))
    left, right = linear_sum_assignment(alike - in_order, maximize=True) if n and k else (np.zeros(0, int),) * 2
    other = dict(zip(left.tolist(), right.tolist(), strict=True))
    rows: list[list[Any]] = []
    for i in range(n):
        j = other.get(i)
        rows.append([i, j, None if j is None or shapes is None else round(float(alike[i, j]), 6)])
    rows += [[None, j, None] for j in range(k) if j not in set(other.values())]
    return {"by": "frequency" if shapes is None else "shape", "rows": rows}


def noted_differences(first: Any, second: Any) -> list[str]:
    """Return the differences of parts and responses of two systems in words; none where no outputs are the same."""
    try:
        result = compare(first, second)
    except ResponseError:
        return []
    notes: list[str] = result.table()["notes"]
    return notes[len(result.remarks) :]  # the remarks are on other pairs of modes


def measured_against(system: Any, data: Measurement | MeasuredModes) -> dict[str, Any]:
    """Return modes and responses of a measurement beside those of a system, as numbers for JSON."""
    result = compare(system, data)
    held = MeasuredModes.from_measurement(data) if isinstance(data, Measurement) and data.modes else data
    count = len(held.frequencies) if isinstance(held, MeasuredModes) else 0
    pairs = [[pair.a - 1, pair.b - 1, round(pair.mac, 6)] for pair in result.pairs]
    paired = [{row[k] for row in pairs} for k in (0, 1)]
    rows = sorted(pairs + [[i, None, None] for i in range(len(system.modes()) if pairs else 0) if i not in paired[0]])
    rows += [[None, k, None] for k in range(count) if pairs and k not in paired[1]]
    ratios = getattr(held, "damping_ratios", None)
    modes = [{"natural": float(held.frequencies[k]), "ratio": None if ratios is None else float(ratios[k])}
             for k in range(count if pairs else 0)]  # fmt: skip
    return {"pairs": {"by": "shape", "rows": rows}, "modes": modes, "responses": None,
            "notes": result.table()["notes"], "measured": _curves(result, data)}  # fmt: skip


def _curves(result: Any, data: Any) -> dict[str, Any]:
    """Magnitudes and phases [deg] of all compared responses at the measured lines [Hz], None where not measured."""
    curves = []
    known = {} if isinstance(data, MeasuredModes) else \
        dict(zip((*data.outputs, *data.inputs), (*data.output_units, *data.input_units), strict=True))  # fmt: skip
    for i, output in enumerate(result.outputs):
        for j, source in enumerate(result.inputs):
            ends = [np.where(values[i, j] == 0.0, np.nan, values[i, j]) for values in result.responses]
            over, under = known.get(output), known.get(source)
            unit = units.pretty(units.ratio(over, under)) if over and under else ""
            curves.append({"name": f"{source} → {output}", "unit": unit, "curves": [
                {"size": _listed(np.abs(values)), "phase": _listed(np.degrees(np.angle(values)))} for values in ends]})
    return {"frequencies": _listed(result.omega / (2 * np.pi)), "pairs": curves}


def _listed(values: Any) -> list[float | None]:
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values.tolist()]


def _shared(first: Any, second: Any) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Shapes at the bodies that both have, rotations times the size of the mechanism."""
    if not (has_geometry(first) and has_geometry(second)):
        return None
    names = [name for name in first.bodies if name in set(second.bodies)]
    size = _scene.of_system(first.name, first.provenance).size
    if not names:
        return None
    weights = np.tile([1.0, 1.0, 1.0, size, size, size], len(names))[:, None]
    shapes = []
    for system in (first, second):
        motion = system.modes().body_shapes
        shapes.append(weights * np.concatenate([motion[name] for name in names]))
    return shapes[0], shapes[1]


def has_geometry(system: Any) -> bool:
    """Tell whether a system has bodies to draw.

    False for state spaces, loops with controllers that have states, and systems from matrices.
    """
    provenance = getattr(system, "provenance", None)
    return provenance is not None and not provenance.from_matrices
