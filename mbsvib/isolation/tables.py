"""Figures of isolation as a table, and over frequency as comma-separated values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.csv_columns import write_columns
from mbsvib.isolation.study_scene import DIRECTIONS

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from mbsvib.isolation.figures import Figures


KILO = 1e4  # [Hz], from where frequencies are written in kHz


def isolation_table(study: Figures) -> dict[str, Any]:
    """Return the figures of a study as arguments of ``mbsvib.common.tables.text`` and ``show``."""
    f = study.frequencies
    static = study.compliance_values[:, 0]
    rows = [
        ("resonance", hertz(study.resonance)),
        ("amplification at resonance", f"{study.amplification:.4g} ({decibel(study.amplification)})"),
        ("isolation starts at (crossover)", f"{'below ' if study.crossover == f[0] else ''}{hertz(study.crossover)}"),
        ("index one decade above crossover",
         f"{study.decade:.3g} ({decibel(study.decade)})" if study.decade > 0.0 else "-"),
        ("roll-off", _roll_off(study)),
        (f"index at {f[-1]:.4g} Hz", f"{study.index[-1]:.3g} ({decibel(study.index[-1])})"),
        (f"compliance at {f[0]:.4g} Hz, minimum and maximum", f"{static[-1]:.3g}, {static[0]:.3g} m/N"),
    ]
    if len(study.undamped):
        rows[1] = ("amplification at resonance", "infinite: undamped")
    directions = study.scene.base_directions
    notes = [f"Index ||T||_F/sqrt({len(directions)}) of accelerations at {_point(study)}, rotations times "
             f"{study.scene.length:.4g} m; base motion along {' '.join(directions)}.", *study.scene.notes]  # fmt: skip
    title = f"Isolation of {study.scene.body} from {study.scene.base}: {study.name}"
    return {"title": title, "columns": [("figure", "left"), ("value", "right")], "rows": rows, "notes": notes}


def isolation_csv(study: Figures, path: str | os.PathLike[str]) -> Path:
    """Write the figures over frequency; returns the path."""
    scene = study.scene
    columns = {"frequency_hz": study.frequencies, "index": study.index}
    columns |= {f"singular_value_{i}": values for i, values in enumerate(study.singular_values, 1)}
    for symbol, table, sources in (("T", study.transmissibility, scene.base_directions),
                                 ("C", study.compliance, DIRECTIONS)):  # fmt: skip
        for i, direction in enumerate(DIRECTIONS):
            for j, source in enumerate(sources):
                columns[f"{symbol}_{direction}_{source}_re"] = table[i, j].real
                columns[f"{symbol}_{direction}_{source}_im"] = table[i, j].imag
    return write_columns(path, columns)


def _roll_off(study: Figures) -> str:
    if study.sampled and not study.plateau:
        return "none: the controller is sampled"
    if study.plateau:
        return f"none: levels off at {study.plateau:.3g} ({decibel(study.plateau)})"
    if not np.isfinite(study.roll_off):
        return "too steep: the response is below rounding"
    return f"{study.roll_off:.0f} dB/decade above {hertz(study.roll_off_from)}"


def hertz(value: float) -> str:
    """Return a frequency in words."""
    if not np.isfinite(value):
        return "not in this band"
    return f"{value:.4g} Hz" if value < KILO else f"{1e-3 * value:.4g} kHz"


def decibel(value: float) -> str:
    """Return a ratio in decibel."""
    return f"{20.0 * np.log10(value):+.1f} dB" if value > 0.0 else "none"


def _point(study: Figures) -> str:
    return f"({', '.join(f'{x:g}' for x in study.scene.point)}) m"
