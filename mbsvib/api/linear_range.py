"""How far the linear model holds, as users ask for it and read it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.common.expected import real
from mbsvib.errors import MbsvibError, ModelError, ResponseError

if TYPE_CHECKING:
    from mbsvib.api.modes import Modes
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations

# Displacements that reach less than this [m, rad] before the linear model is off are worth a sentence.
SMALL = 1e-4
LENGTHS = ("m", "rad")
# With more coordinates second derivatives take seconds, and are made only where they are asked for.
QUICK = 12


@dataclass(frozen=True, repr=False, eq=False)
class LinearRange(Displayed):
    """Amplitudes of outputs in free vibration at which the second-order part reaches a ``share`` of the first-order part.

    ``values`` (modes, outputs) are in the ``units`` of the outputs: inf where there is no second-order part, 0 where
    there is nothing else, NaN for outputs without second derivatives (forces in joints, strains). ``frequencies``
    (modes,) [Hz] are those of the modes.
    """

    name: str
    share: float
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    frequencies: Array
    values: Array

    def table(self) -> dict[str, Any]:
        """Return the table of amplitudes as arguments of ``mbsvib.common.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns and rows.
        """
        headers = [f"{name} [{unit}]" for name, unit in zip(self.outputs, self.units, strict=True)]
        rows = [(str(k + 1), f"{frequency:.6g}", *(f"{value:.3g}" for value in own))
                for k, (frequency, own) in enumerate(zip(self.frequencies, self.values, strict=True))]  # fmt: skip
        return {"title": f"Linear range of {self.name}: amplitude at which the second-order part is {self.share:.3g}",
                "columns": [(header, "right") for header in ("mode", "natural [Hz]", *headers)], "rows": rows}  # fmt: skip

    def sentences(self, below: float = SMALL) -> tuple[str, ...]:
        """Return a sentence for each displacement whose range is small, for reports.

        Parameters
        ----------
        below : float
            Amplitude [m, rad] below which a range is small.

        Returns
        -------
        tuple of str
            The output, its smallest range and the mode; outputs that a mode moves by second-order parts only are left
            out.
        """
        result = []
        for name, unit, own in zip(self.outputs, self.units, self.values.T, strict=True):
            usable = np.where(own > 0.0, own, np.inf)
            k = int(np.argmin(np.nan_to_num(usable, nan=np.inf))) if len(usable) else 0
            if unit in LENGTHS and len(usable) and usable[k] < below:
                result.append(f"output '{name}': the second-order part reaches {self.share:.0%} of the linear one at an "
                              f"amplitude of {usable[k]:.3g} {unit} in mode {k + 1} ({self.frequencies[k]:.4g} Hz); "
                              f"use model.simulate beyond.")  # fmt: skip
        return tuple(result)


def explained(system: Equations, modes: Modes) -> list[str]:
    """Return lines on outputs of small range for a description of a system; none where that is not known at once."""
    if not system.outputs or system.dof > QUICK or find_spec("casadi") is None:
        return []
    try:
        told = linear_range(system, modes, 0.1).sentences()
    except MbsvibError:  # whether there is a range is not what was asked
        return []
    return ["linear range", *(f"  {text}" for text in told)] if told else []


def linear_range(system: Equations, modes: Modes, share: float) -> LinearRange:
    """Return how far the linear equations of a mechanism hold; see ``System.linear_range``.

    Parameters
    ----------
    system : Equations
        The equations.
    modes : Modes
        Their modes.
    share : float
        Share of the second-order part.

    Returns
    -------
    LinearRange
        Amplitudes by mode and output.

    Raises
    ------
    ResponseError
        If the share is not positive.
    ModelError
        If the equations are not those of a mechanism as described, or CasADi is not installed.
    """
    number = real(share, "linear_range", "share", "a positive share such as 0.1")
    if not 0.0 < number < np.inf:
        raise ResponseError(f"linear_range: share = {number:g}; expected a positive share such as 0.1.")
    if find_spec("casadi") is None:
        raise ModelError("linear_range: needs CasADi for second derivatives; pip install mbsvib[casadi]", field="share")
    from mbsvib.simulation.linear_range import linear_range as computed

    outputs, values = computed(system, modes, number)
    values.setflags(write=False)
    return LinearRange(system.name, number, outputs, tuple(system.output_units), modes.frequencies, values)
