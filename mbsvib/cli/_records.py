"""Modes as records for scripts: CSV and JSON with every digit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from mbsvib.modes import Modes


def records(modes: Modes) -> list[dict[str, Any]]:
    """Return one record a mode: number, frequencies [Hz], damping ratio, both eigenvalues [1/s], what moves most.

    A mode of first order has one eigenvalue, and no second one.
    """
    values, errors = modes.pairs, modes.pair_errors
    single = np.zeros(len(modes), dtype=bool) if modes.first_order is None else modes.first_order
    return [
        {
            "mode": i + 1,
            "natural_hz": float(modes.frequencies[i]),
            "damped_hz": float(modes.damped_frequencies[i]),
            "damping_ratio": float(modes.damping_ratios[i]),
            "real_1": float(values[i, 0].real),
            "imag_1": float(values[i, 0].imag),
            "real_2": None if single[i] else float(values[i, 1].real),
            "imag_2": None if single[i] else float(values[i, 1].imag),
            "relative_error": float(errors[i].max()),
            "moves_most": name,
        }
        for i, name in enumerate(map(" ".join, modes.strongest()))
    ]


def csv_text(modes: Modes) -> str:
    """Return the records of modes as CSV with a header, lines ended by a line feed."""
    import csv
    from io import StringIO

    stream = StringIO()
    fields = ["mode", "natural_hz", "damped_hz", "damping_ratio", "real_1", "imag_1", "real_2", "imag_2",
              "relative_error", "moves_most"]  # fmt: skip
    writer = csv.DictWriter(stream, fields, lineterminator="\n")
    writer.writeheader()
    writer.writerows(records(modes))
    return stream.getvalue()


def json_text(modes: Modes) -> str:
    """Return the records of modes as JSON; infinite values (the damping ratio of a damped rigid body) become null."""
    import json

    rows = [
        {key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in row.items()}
        for row in records(modes)
    ]
    return json.dumps({"name": modes.name, "dof": len(modes), "modes": rows}, indent=1, allow_nan=False)
