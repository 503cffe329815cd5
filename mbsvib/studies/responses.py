"""Quantities of frequency responses: gains, peaks over a band, root mean squares under noise."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import band_of
from mbsvib.errors import ResponseError
from mbsvib.feedback.loop_rounding import response as norm_response
from mbsvib.random.mean_squares import Random
from mbsvib.random.sources import Sources, sources
from mbsvib.responses import extrema
from mbsvib.responses.densities import density
from mbsvib.responses.frequency_grid import span
from mbsvib.responses.norms import growth
from mbsvib.studies.evaluation import DesignPoint, Dual, stacked, steady_response
from mbsvib.studies.quantities import Largest, Leaf, Quantity

Names = str | Iterable[str] | None
Weighted = Names | Mapping[str, float]
Band = tuple[float, float]

SEEDS = 24  # points distributed over a band, in addition to those at the modes
LOWER = 0.1  # local maxima below this share of the largest are not bounded yet


class PortResponses:
    """Responses from ``inputs`` to ``outputs`` as one number: the Frobenius norm, of the weight of each output times
    the response times the weight of each input, where ports have weights by name.
    """

    def __init__(self, outputs: Weighted, inputs: Weighted, label: str | None = None) -> None:
        self.outputs, self.inputs = _names(outputs, "outputs"), _names(inputs, "inputs")
        self.label = label or f"{_listed(self.outputs, 'all outputs')} over {_listed(self.inputs, 'all inputs')}"
        self._weights = [dict(ports) if isinstance(ports, Mapping) else None for ports in (outputs, inputs)]

    def of(self, system: System) -> tuple[list[str], list[str]]:
        """Return the names of outputs and inputs; None stands for all of the system."""
        return (_known(system.outputs, self.outputs, "output", system.name),
                _known(system.inputs, self.inputs, "input", system.name))  # fmt: skip

    def _weighted(self, g: Complex, names: tuple[list[str], list[str]]) -> Complex:
        """Responses (..., outputs, inputs, n) times the weights of ports."""
        left, right = (np.array([1.0 if own is None else own[name] for name in of_side])
                       for own, of_side in zip(self._weights, names, strict=True))  # fmt: skip
        return g * np.outer(left, right)[:, :, None]

    def magnitude(self, system: System, w: Array) -> Array:
        """Return the norm at angular frequencies."""
        names = self.of(system)
        of = norm_response if isinstance(system, System) else steady_response
        return np.asarray(np.sqrt((np.abs(self._weighted(of(system, w, *names), names)) ** 2).sum(axis=(0, 1))))

    def size(self, point: DesignPoint, w: Array) -> Dual:
        """Return the norm at angular frequencies, with derivatives."""
        names = self.of(point.system)
        g, slope = (self._weighted(part, names) for part in point.response(w, names[1], names[0]))
        value = np.sqrt((np.abs(g) ** 2).sum(axis=(0, 1)))
        change = (g.conj() * slope).real.sum(axis=(1, 2))
        return point.dual(value, np.divide(change, value, out=np.zeros_like(change), where=value > 0.0).T)


class Peak(Largest):
    """The peak of a response over a band; a search bounds it at a set of frequencies, which its maxima extend."""

    def __init__(self, ports: PortResponses, band: Band | None) -> None:
        where = "" if band is None else f" from {band[0]:g} to {band[1]:g} Hz"
        super().__init__(f"peak of {ports.label}{where}", (), stacked)
        self.ports, self.band = ports, band

    def true(self, point: DesignPoint) -> Dual:
        w, size = self.tops(point)
        return self.members(point, w[[int(size.argmax())]])

    def members(self, point: DesignPoint, active: Array | None) -> Dual:
        if active is None:
            return self.true(point)
        self._check_stable(point.system)  # a search is to go back from where no response is steady
        return self.ports.size(point, active)

    def _check_stable(self, system: Any) -> None:
        if words := growth(system):
            raise ResponseError(f"{self.label}: '{system.name}' is not stable: {words} grows, so that no steady "
                                f"vibration has a peak; give values at which it is held.")  # fmt: skip

    def seeds(self, point: DesignPoint) -> Array:
        low, high = self._band(point.system)
        poles = np.unique(np.abs(point.system.poles()))
        inside = poles[(poles > 2.0 * np.pi * low) & (poles < 2.0 * np.pi * high)][:SEEDS]
        return np.unique(np.concatenate((2.0 * np.pi * np.geomspace(low, high, SEEDS), inside, self.tops(point)[0])))

    def tops(self, point: DesignPoint) -> tuple[Array, Array]:
        system = point.system
        low, high = (2.0 * np.pi * f for f in self._band(system))
        poles = system.poles()
        self._check_stable(system)
        grows = extrema.excited(lambda w: self.ports.magnitude(system, w), poles, low, high)
        if len(grows):
            raise ResponseError(f"{self.label}: the mode of '{system.name}' at {grows[0] / (2.0 * np.pi):.6g} Hz is "
                                f"not damped, and is excited without bound; give the mechanism damping, or a band "
                                f"without it.")  # fmt: skip
        band = extrema.Band(lambda w: self.ports.magnitude(system, w) ** 2, extrema.panels(poles, low, high))
        where, square = band.maxima(np.asarray, LOWER**2)
        return where, np.sqrt(square)

    def _band(self, system: System) -> Band:
        return self.band or span(system.poles(), None, None)


def rms(outputs: Names, spectra: Mapping[str, Any], band: Band | None = None) -> Quantity:
    """Return the root mean square of outputs under independent noise.

    Parameters
    ----------
    outputs : str or iterable of str
        Names; of several, the square root of the sum of all mean squares.
    spectra : mapping of str to float, array-like or noise
        One-sided density of each input that is driven [input unit^2/Hz]: a number is white noise, pairs (frequency
        [Hz], density) a table, straight on log-log axes; ``isolation.shaped`` makes a filter's.
    band : (float, float), optional
        First and last frequency [Hz]; default: all of them.

    Returns
    -------
    Quantity
        Root mean square [output unit].

    Raises
    ------
    ResponseError
        If a spectrum is refused or the band does not ascend.
    """
    if not isinstance(spectra, Mapping) or not spectra:
        raise ResponseError(f"rms: spectra = {check.shown(spectra)}; expected a density for each input, such as "
                            f"{{'floor.x': 1e-6}}.")  # fmt: skip
    known = {name: density(value, f"noise at '{name}'") for name, value in spectra.items()}
    ports, span_ = PortResponses(outputs, list(known)), band_of(band, "rms")
    where = "" if band is None else f" from {band[0]:g} to {band[1]:g} Hz"
    return Leaf(f"rms of {_listed(ports.outputs, 'all outputs')}{where}",
                partial(_rms, ports=ports, spectra=known, band=span_))  # fmt: skip


def _rms(point: DesignPoint, ports: PortResponses, spectra: Mapping[str, Any], band: Band | None) -> Dual:
    system = point.system
    outputs, _ = ports.of(system)
    if getattr(system, "period", None) is not None:  # of which sampling folds noise to other frequencies
        value = _root(system, outputs, spectra, band)
        return point.dual(value, point.by_differences(lambda asked: _root(asked, outputs, spectra, band)))
    known = sources(spectra, system.inputs, system.input_units, system.name)
    squares, slopes = mean_squares(system, outputs, known, band, lambda w: point.response(w, known.names, outputs))
    root, change = np.sqrt(squares.sum()), slopes.sum(axis=0)
    return point.dual(np.array([root]), (0.5 * change / root if root else 0.0 * change)[None])


def _root(system: Any, outputs: list[str], spectra: Mapping[str, Any], band: Band | None) -> Array:
    values = np.array(list(system.rms(outputs, spectra, band).values()))
    return np.asarray(np.sqrt((values**2).sum(keepdims=True)))


def mean_squares(
    system: System, outputs: list[str], known: Sources, band: Band | None,
    response: Callable[[Array], tuple[Complex, Complex]],
) -> tuple[Array, Array]:  # fmt: skip
    """Return the mean squares (k,) of outputs under noise over a band, exact to rounding, and their derivatives (k,
    variables). One that is infinite is refused.

    ``band``: first and last frequency [Hz]; None: all. ``response``: from angular frequencies (n,) to the responses (k,
    sources, n) and their derivatives (variables, k, sources, n).
    """
    part = system.with_ports(outputs, list(known.names))
    under = Random(part, known, (None,) * len(part.outputs), band)
    under.check_finite()
    f, weight = under.rule().nodes()
    g, slope = response(2.0 * np.pi * f)
    # (G S) of each output, conjugated: the other half of the square
    half = np.einsum("oin,nij,n->ojn", g, known.matrix(f), weight, optimize=True).conj()
    value = np.einsum("ojn,ojn->o", half, g).real
    return value, 2.0 * np.einsum("ojn,pojn->po", half, slope, optimize=True).real.T


def _names(ports: Any, field: str) -> list[str] | None:
    if ports is None:
        return None
    names = [ports] if isinstance(ports, str) else list(ports)
    if not names or not all(isinstance(name, str) for name in names):
        raise check.refuse("quantity", field, ports, "names of ports")
    return names


def _known(known: tuple[str, ...], selected: list[str] | None, kind: str, name: str) -> list[str]:
    """Names in the system's order."""
    for port in selected or ():
        check.known(port, known, f"'{name}' has no {kind} '{port}'", error=ResponseError)
    result = [port for port in known if selected is None or port in selected]
    if not result:
        raise ResponseError(f"'{name}' has no {kind}; add one by add_{kind}.")
    return result


def _listed(names: list[str] | None, every: str) -> str:
    if names is None:
        return every
    return ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
