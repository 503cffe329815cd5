"""Figures of isolation in words: tables and comma-separated values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.isolation.octaves import VC
from mbsvib.isolation.study_scene import DIRECTIONS

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    from mbsvib.common.arrays import Array
    from mbsvib.isolation.figures import Isolation
    from mbsvib.isolation.vibration import Vibration


KILO = 1e4  # [Hz], from where frequencies are written in kHz


def isolation_table(study: Isolation) -> dict[str, Any]:
    """Return the figures of a study as arguments of ``mbsvib.common.tables.text`` and ``show``."""
    f = study.frequencies
    static = study.compliance_values[:, 0]
    rows = [
        ("resonance", hertz(study.resonance)),
        ("amplification there", f"{study.amplification:.4g} ({decibel(study.amplification)})"),
        ("isolation starts at (crossover)", f"{'below ' if study.crossover == f[0] else ''}{hertz(study.crossover)}"),
        ("index a decade above", f"{study.decade:.3g} ({decibel(study.decade)})" if study.decade > 0.0 else "-"),
        ("roll-off", _roll_off(study)),
        (f"index at {f[-1]:.4g} Hz", f"{study.index[-1]:.3g} ({decibel(study.index[-1])})"),
        (f"compliance at {f[0]:.4g} Hz, minimum and maximum", f"{static[-1]:.3g}, {static[0]:.3g} m/N"),
    ]
    if len(study._undamped):
        rows[1] = ("amplification there", "infinite: undamped")
    moved = study.scene.moved
    notes = [f"Index ||T||_F/sqrt({len(moved)}) of accelerations at {_point(study)}, rotations times "
             f"{study.scene.length:.4g} m; base shaken along {' '.join(moved)}.", *study.scene.notes]  # fmt: skip
    title = f"Isolation of {study.scene.body} from {study.scene.base}: {study.name}"
    return {"title": title, "columns": [("figure", "left"), ("value", "right")], "rows": rows, "notes": notes}


def vibration_table(result: Vibration) -> dict[str, Any]:
    """Return root mean squares as arguments of ``mbsvib.common.tables.text`` and ``show``."""
    rows = [(f"{result.study.scene.body} {direction}", f"{value:.4g}",
             "m/s^2" if len(direction) == 1 else "rad/s^2", "", "")
            for direction, value in zip(DIRECTIONS, result.acceleration, strict=True)]  # fmt: skip
    rows += [(name, "", "", f"{1e6 * result.stroke[name]:.4g}", f"{result.force[name]:.4g}") for name in result.stroke]
    columns: list[tuple[str, Any]] = [("rms", "left"), ("acceleration", "right"), ("", "left"),
                                      ("stroke [um]", "right"), ("force [N]", "right")]  # fmt: skip
    band = "all frequencies" if result.band is None else f"{result.band[0]:g} to {result.band[1]:g} Hz"
    notes = [f"Base shaken along {' '.join(result.noise.directions)}, {band}."]
    if np.isinf(result.acceleration).any():
        notes.append("Infinite: noise of unlimited frequency comes through the mechanism's masses; give a band.")
    (low, high), kept = result.judged, result.criterion
    if low < high:
        words = f"Keeps {kept}" if kept else f"Keeps no vibration criterion, not even {min(VC)},"
        notes.append(f"{words} from {low:g} to {high:g} Hz.")
    else:
        notes.append("Vibration criteria are for 1 to 80 Hz, which is not in the band.")
    return {"title": f"Vibration of {result.study.name}", "columns": columns, "rows": rows, "notes": notes}


def isolation_csv(study: Isolation, path: str | os.PathLike[str]) -> Path:
    """Write the figures over frequency; returns the path."""
    scene = study.scene
    names, columns = ["frequency_hz", "index"], [study.frequencies, study.index]
    for i, values in enumerate(study.singular_values):
        names.append(f"singular_value_{i + 1}")
        columns.append(values)
    for what, table, sources in (("T", study.transmissibility, scene.moved), ("C", study.compliance, DIRECTIONS)):
        for i, direction in enumerate(DIRECTIONS):
            for j, source in enumerate(sources):
                names += [f"{what}_{direction}_{source}_re", f"{what}_{direction}_{source}_im"]
                columns += [table[i, j].real, table[i, j].imag]
    return _write(path, names, columns)


def vibration_csv(result: Vibration, path: str | os.PathLike[str]) -> Path:
    """Write density and cumulative root mean square; returns the path."""
    f = result.study.frequencies
    units = ["m/s2" if len(direction) == 1 else "rad/s2" for direction in DIRECTIONS]
    names = ["frequency_hz", *(f"density_{d}_({u})2/hz" for d, u in zip(DIRECTIONS, units, strict=True)),
             *(f"cumulative_rms_{d}_{u}" for d, u in zip(DIRECTIONS, units, strict=True))]  # fmt: skip
    return _write(path, names, [f, *result.density(f), *result.cumulative(f)])


def _write(path: str | os.PathLike[str], names: Sequence[str], columns: Sequence[Array]) -> Path:
    from mbsvib.common.atomic_file import write_whole

    lines = [",".join(names), *(",".join(map(repr, row)) for row in np.stack(columns, axis=1).tolist())]
    return write_whole(path, lambda stream: stream.write(("\n".join(lines) + "\n").encode()))


def _roll_off(study: Isolation) -> str:
    if study.sampled and not study.plateau:
        return "none: the controller is sampled"
    if study.plateau:
        return f"none: levels off at {study.plateau:.3g} ({decibel(study.plateau)})"
    if not np.isfinite(study.roll_off):
        return "too steep to be told from rounding"
    return f"{study.roll_off:.0f} dB/decade above {hertz(study.roll_off_from)}"


def hertz(value: float) -> str:
    """Return a frequency in words."""
    if not np.isfinite(value):
        return "not in this band"
    return f"{value:.4g} Hz" if value < KILO else f"{1e-3 * value:.4g} kHz"


def decibel(value: float) -> str:
    """Return a ratio in decibel."""
    return f"{20.0 * np.log10(value):+.1f} dB" if value > 0.0 else "none"


def _point(study: Isolation) -> str:
    return f"({', '.join(f'{x:g}' for x in study.scene.point)}) m"
