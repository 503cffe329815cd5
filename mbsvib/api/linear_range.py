"""How far the linear model holds, as users ask for it and read it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import real
from mbsvib.equations.equations import Equations, Provenance
from mbsvib.errors import MbsvibError, ModelError, ResponseError
from mbsvib.modes.result import Modes
from mbsvib.responses.basis import Basis

# A linear model that is off where no coordinate has moved by this much [rad, mechanism sizes] is worth a sentence.
SMALL = 0.01
# Share of the largest motion of an output by a mode, at equal travel, below which another mode hardly moves it.
HARDLY = 1e-2
# Degrees of freedom up to which it is worth the time to say so in explanations, and with each table of modes (some 50
# ms); the share that is then meant.
FEW, FEW_IN_TABLES, USUAL = 6, 3, 0.1
# Modes whose frequencies differ by less than this share coincide.
TOGETHER = 1e-6
# Terms of third and higher order make the second-order part larger by its share times this: at most 4.4 in nonlinear
# runs of 100 random chains.
MARGIN = 5.0


@dataclass(frozen=True, repr=False, eq=False)
class LinearRange(Columnar, Displayed):
    """Estimated amplitudes of outputs in free vibration where the second-order part reaches a ``share`` of the linear
    one; ``conservative`` ones leave a margin for terms of higher order.

    ``values`` (modes, outputs) are in the ``units`` of the outputs: inf where there is no second-order part, 0 where
    there is nothing else, NaN for outputs without second derivatives (forces in joints, strains). ``travel``
    (modes, outputs) is how far the coordinate of largest motion has moved there [rad, mechanism sizes]. ``frequencies``
    (modes,) [Hz] are those of the modes.
    """

    name: str
    """Name of the model."""
    share: float
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    frequencies: Array
    values: Array
    travel: Array
    conservative: bool = False

    def columns(self) -> dict[str, Any]:
        """Return a row for each mode: its number, natural frequency [Hz], and the amplitude of each output."""
        return {"mode": np.arange(1, len(self.frequencies) + 1), "frequency_hz": self.frequencies,
                **dict(zip(self.outputs, self.values.T, strict=True))}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the table of amplitudes, and notes on what is no finite one, as arguments of
        ``mbsvib.common.tables.show``.
        """
        notes = ["With a margin for terms of third and higher order, which are left out; it is not a proven bound."
                 if self.conservative else "Estimates, no lower bounds: terms of third and higher order are left out; "
                 "conservative=True leaves a margin for them."]  # fmt: skip
        notes += [note for note, some in (
            ("inf: no second-order part; parts of third order, as of pendulums, are not counted.", np.isinf),
            ("nan: outputs without second derivatives, such as forces in joints.", np.isnan),
        ) if some(self.values).any()]  # fmt: skip
        headers = [f"{name} [{unit}]" for name, unit in zip(self.outputs, self.units, strict=True)]
        rows = [(str(k + 1), f"{frequency:.6g}", *(f"{value:.3g}" for value in limits))
                for k, (frequency, limits) in enumerate(zip(self.frequencies, self.values, strict=True))]  # fmt: skip
        kind = "conservative" if self.conservative else "estimated"
        return {"title": f"Linear range of {self.name}: {kind} amplitude at which the second-order part is "
                         f"{self.share:.3g}",
                "columns": [(header, "right") for header in ("mode", "natural [Hz]", *headers)],
                "rows": rows, "notes": notes}  # fmt: skip

    def sentences(self, below: float = SMALL) -> tuple[str, ...]:
        """Return a sentence for each output whose ``travel`` [rad, mechanism sizes] is small, for reports.

        It names the output, its smallest range and the mode. Rigid-body modes, and outputs that a mode hardly moves to
        first order, are left out. Of modes that coincide the one with the largest range counts, because there is always
        a combination of them that hardly moves the output.
        """
        result = []
        travel = participating(self)
        for together in np.split(np.arange(len(travel)), 1 + np.flatnonzero(~self._coincide())):
            largest = np.where(np.isfinite(travel[together]), travel[together], -np.inf).max(axis=0, initial=-np.inf)
            travel[together] = np.where(travel[together] < largest, np.inf, travel[together])
        for j, name in enumerate(self.outputs if len(travel) else ()):
            k = int(np.argmin(travel[:, j]))
            if travel[k, j] < below:
                result.append(
                    f"output '{name}': the second-order part reaches {self.share:.0%} of the linear one at an "
                    f"estimated amplitude of {self.values[k, j]:.3g} {self.units[j]} in mode {k + 1} "
                    f"({self.frequencies[k]:.4g} Hz); beyond it, only a nonlinear simulation is accurate."
                )
        return tuple(result)

    def _coincide(self) -> NDArray[np.bool_]:
        """Whether each mode but the last has the frequency of the next."""
        return np.asarray(np.diff(self.frequencies) <= TOGETHER * self.frequencies[1:])


def participating(known: LinearRange) -> NDArray[Any]:
    """Return ``travel`` (modes, outputs), infinite where a mode hardly moves an output to first order, or has 0 Hz.

    Hardly: by less than the share ``HARDLY`` of what the mode that moves this output most does at the same travel.
    """
    counts = np.isfinite(known.values) & (known.values > 0.0) & (known.frequencies > 0.0)[:, None]
    moves = np.divide(known.values, known.travel, out=np.zeros(known.values.shape),
                      where=counts & np.isfinite(known.travel) & (known.travel > 0.0))  # fmt: skip
    return np.where(counts & (moves >= HARDLY * moves.max(axis=0, initial=0.0)), known.travel, np.inf)


def linear_range(system: Equations, modes: Modes, share: float, conservative: bool = False) -> LinearRange:
    """Return how far the linear equations of a mechanism hold; see ``System.linear_range``.

    ``conservative``: whether to leave a margin for terms of higher order.
    """
    number = real(share, "linear_range", "share", "a positive share such as 0.1")
    if not 0.0 < number < np.inf:
        raise ResponseError(f"linear_range: share = {number:g}; expected a positive share such as 0.1.")
    if find_spec("casadi") is None:
        raise ModelError('linear_range: needs CasADi for second derivatives; pip install "mbsvib[casadi]"',
                         field="share")  # fmt: skip
    from mbsvib.simulation.linear_range import linear_range as computed

    none = np.zeros((0, len(system.outputs)))
    requested = number / (1.0 + MARGIN * number) if conservative else number
    values, travel = computed(system, modes, requested) if system.dof else (none, none.copy())
    for array in (values, travel):
        array.setflags(write=False)
    return LinearRange(system.name, number, system.outputs, tuple(system.output_units), modes.frequencies, values,
                       travel, conservative)  # fmt: skip


def with_modes(modes: Modes, provenance: Provenance | None) -> tuple[str, ...]:
    """Return sentences on outputs whose range is small, for the table of the modes of a small mechanism.

    ``provenance``: where its equations come from.
    """
    from mbsvib.equations.assembly import linearized

    count = len(modes.coordinates)
    if provenance is None or provenance.origin is None or provenance.closed_loop or find_spec("casadi") is None or not (
            0 < count <= FEW_IN_TABLES and len(modes) == count):  # fmt: skip
        return ()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # these were given when the system was made
            system: Equations = linearized(provenance.origin)
        if system.coordinates != modes.coordinates or not system.outputs:
            return ()
        return tuple([text[0].upper() + text[1:] for text in linear_range(system, modes, USUAL).sentences()])
    except MbsvibError:
        return ()


def explained(system: Equations) -> list[str]:
    """Return lines on outputs whose range is small; none of larger systems, and of those that have no range."""
    if not 0 < system.dof <= FEW or not system.outputs or find_spec("casadi") is None:
        return []
    try:
        # modes of its own: those of the system are not computed unless they are asked for
        sentences = linear_range(system, Basis(system, Modes).modes, USUAL).sentences()
    except MbsvibError:
        return []
    return ["linear range", *(f"  {text}" for text in sentences)] if sentences else []
