"""Modes as they were measured: frequencies, damping ratios and shapes at the outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.common.selection import signal_names
from mbsvib.errors import ResponseError
from mbsvib.measurement.matching import Matched
from mbsvib.measurement.points import label_of, nodes_of, points_of

if TYPE_CHECKING:
    from mbsvib.measurement.data import Measurement

WHO = "MeasuredModes"


@dataclass(frozen=True, repr=False, eq=False)
class MeasuredModes(Matched, Columnar, Displayed):
    """Modes that were measured, in any order; a model's modes are paired with them by their shapes.

    Parameters
    ----------
    frequencies : array-like, shape (modes,)
        Undamped natural frequencies [Hz].
    damping_ratios : array-like, shape (modes,), optional
        Damping ratios [1], below 1; 0, as normal modes in files have, is not fitted.
    shapes : array-like, shape (outputs, modes), optional
        Displacements of the outputs in each mode, real or complex, to any factor; NaN where not measured.
    outputs : sequence of str, optional
        Names of the rows of ``shapes``; labels such as ``"101X+"`` are read as nodes and directions.
    sd : float or array-like, shape (modes,), optional
        Standard deviation of the frequencies [Hz].
    output_points, nodes : sequence, optional
        Where the outputs are, as of a ``Measurement``.

    Raises
    ------
    ResponseError
        If shapes do not match, a number is not finite or not positive, or a damping ratio is 1 or more.
    """

    _kinds = ("output",)

    frequencies: Array
    damping_ratios: Array | None = None
    shapes: Array | Complex | None = None
    outputs: tuple[str, ...] = ()
    sd: Array | None = None
    output_points: Any = None
    nodes: Any = ()

    def __post_init__(self) -> None:
        values: dict[str, Any] = {
            "frequencies": _numbers(self.frequencies, None, "frequencies", "positive numbers [Hz]")}
        count = len(values["frequencies"])
        expected_of = {"damping_ratios": "ratios from 0 to 1, not per cent", "sd": "positive numbers [Hz]"}
        for field, expected in expected_of.items():
            given = getattr(self, field)
            values[field] = None if given is None else _numbers(given, count, field, expected)
        try:
            shapes = None if self.shapes is None else np.array(self.shapes)
        except ValueError as error:
            raise ResponseError(f"{WHO}: shapes has rows of different lengths; expected a row of all modes for each "
                                f"output, NaN where not measured.") from error  # fmt: skip
        if (shapes is None) != (not self.outputs):
            raise ResponseError(f"{WHO}: shapes and outputs are given together, or neither.")
        if shapes is not None and (shapes.shape != (len(self.outputs), count) or shapes.dtype.kind not in "iufc"
                                   or np.isinf(shapes).any()):  # fmt: skip
            raise ResponseError(f"{WHO}: shapes has shape {shapes.shape}; expected {(len(self.outputs), count)}, "
                                f"finite numbers of outputs and modes.")  # fmt: skip
        outputs = signal_names(self.outputs, len(self.outputs), "outputs", WHO)
        points, nodes = points_of(self.output_points, outputs, nodes_of(self.nodes), WHO)
        values |= {"shapes": shapes, "outputs": outputs, "output_points": tuple(points), "nodes": tuple(nodes)}
        for field, value in values.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, field, value)

    @classmethod
    def from_measurement(cls, data: Measurement) -> MeasuredModes:
        """Return the modes that a measurement has, such as those of a universal file.

        Parameters
        ----------
        data : Measurement
            With ``modes`` at its ``nodes``.

        Returns
        -------
        MeasuredModes
            Outputs are labels of nodes and directions, ``"101X+"``; what a mode does not have is NaN.

        Raises
        ------
        ResponseError
            If it has no modes.
        """
        if not data.modes:
            raise ResponseError(f"{WHO}: the measurement has no modes.")
        numbers = sorted({number for mode in data.modes for number in mode.nodes})
        shapes = np.full((len(numbers), 6, len(data.modes)), np.nan, dtype=complex)
        for k, mode in enumerate(data.modes):
            shapes[[numbers.index(number) for number in mode.nodes], :, k] = mode.shape
        flat = shapes.reshape(-1, len(data.modes))
        flat = flat if any(np.iscomplexobj(mode.shape) for mode in data.modes) else flat.real
        labels = [label_of(number, axis) for number in numbers for axis in range(6)]
        known = ~np.isnan(flat).all(axis=1)
        world = [replace(node, axes=None) for node in data.nodes]  # shapes are in world axes
        outputs = tuple(label for label, is_known in zip(labels, known, strict=True) if is_known)
        frequencies, ratios = (np.array([getattr(mode, field) for mode in data.modes])
                               for field in ("frequency", "damping_ratio"))  # fmt: skip
        return cls(frequencies, ratios, flat[known], outputs, nodes=world)

    _index = "mode"

    def columns(self) -> dict[str, Any]:
        """Return number, frequencies [Hz], damping ratios and standard deviations [Hz] as columns (m,) by name:
        ``mode``, ``frequency_hz``, ``damping_ratio``, ``sd_hz``; not a number where they were not given.
        """
        unknown = np.full(len(self.frequencies), np.nan)
        return {"mode": np.arange(1, len(self.frequencies) + 1), "frequency_hz": self.frequencies,
                "damping_ratio": unknown if self.damping_ratios is None else self.damping_ratios,
                "sd_hz": unknown if self.sd is None else self.sd}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return title, columns and rows of the table that ``print`` shows."""
        ratios = [""] * len(self.frequencies) if self.damping_ratios is None else \
            [f"{100 * ratio:.3g}" for ratio in self.damping_ratios]  # fmt: skip
        sd = [""] * len(self.frequencies) if self.sd is None else [f"{value:.2g}" for value in self.sd]
        rows = [(k + 1, f"{f:.6g}", ratios[k], sd[k]) for k, f in enumerate(self.frequencies)]
        names = ("mode", "frequency [Hz]", "damping ratio [%]", "standard deviation [Hz]")
        return {"title": "Measured modes", "columns": [(name, "right") for name in names], "rows": rows}


def _numbers(value: Any, count: int | None, field: str, expected: str) -> Array:
    array = np.array(reals(value, WHO, field, expected))
    if array.ndim == 0 and count is not None:
        array = np.full(count, float(array))
    least_ok = (array >= 0.0) & (array < 1.0) if field == "damping_ratios" else (array > 0.0)
    if array.ndim != 1 or (count is not None and len(array) != count) or not (np.isfinite(array) & least_ok).all():
        raise ResponseError(f"{WHO}: {field} = {array.tolist() if array.size < 9 else array.shape}; expected {expected}"
                            f"{'' if count is None else f', one of each of {count} modes'}.")  # fmt: skip
    return array
