"""Quantities of responses whose ports have weights, and of noise that is correlated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.studies.responses import Ports, _nodes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.isolation.noise import BaseNoise
    from mbsvib.studies.place import Place
    from mbsvib.studies.quantities import Dual
    from mbsvib.system import System

    Array = NDArray[np.float64]


class Weighted(Ports):
    """Responses as one number, the Frobenius norm of weight of output x response x weight of input."""

    def __init__(self, label: str, outputs: Mapping[str, float], inputs: Mapping[str, float]) -> None:
        super().__init__(list(outputs), list(inputs))
        self._label, self._left, self._right = label, dict(outputs), dict(inputs)

    @property
    def label(self) -> str:
        """The response in words."""
        return self._label

    def _weights(self, system: System) -> Array:
        outputs, inputs = self.of(system)
        left, right = ([weight[name] for name in names] for weight, names in ((self._left, outputs),
                                                                              (self._right, inputs)))  # fmt: skip
        return np.outer(left, right)[:, :, None]

    def magnitude(self, system: System, w: Array) -> Array:
        """Return the norm at angular frequencies."""
        outputs, inputs = self.of(system)
        o, i = [system.outputs.index(name) for name in outputs], [system.inputs.index(name) for name in inputs]
        g = self._weights(system) * system.frequency_response(w)[np.ix_(o, i)]
        return np.asarray(np.sqrt((np.abs(g) ** 2).sum(axis=(0, 1))))

    def size(self, place: Place, w: Array) -> Dual:
        """Return the norm at angular frequencies, with derivatives."""
        outputs, inputs = self.of(place.system)
        weights = self._weights(place.system)
        g, slope = (weights * part for part in place.response(w, inputs, outputs))
        value = np.sqrt((np.abs(g) ** 2).sum(axis=(0, 1)))
        change = (g.conj() * slope).real.sum(axis=(1, 2))
        return place.dual(value, np.divide(change, value, out=np.zeros_like(change), where=value > 0.0).T)


def mean_squares(
    place: Place, outputs: Mapping[str, float], inputs: Sequence[str], noise: BaseNoise,
    band: tuple[float, float] | None,
) -> Dual:  # fmt: skip
    """Return weighted mean squares of outputs, each by itself, under noise on the inputs that may be correlated.

    Parameters
    ----------
    place : Place
        A system with the variables of a study.
    outputs : mapping of str to float
        Names and weights.
    inputs : sequence of str
        Where the noise enters, in its order.
    noise : BaseNoise
        Its densities.
    band : (float, float) or None
        First and last frequency [Hz].

    Returns
    -------
    Dual
        Mean squares in the order of the outputs, and their derivatives.
    """
    names = list(outputs)
    f, weight = _nodes(place.system, Ports(names, list(inputs)), noise, band)
    g, slope = place.response(2.0 * np.pi * f, inputs, names)
    # (G S) of each output, conjugated: the other half of the square
    half = np.einsum("oin,nij,n->ojn", g, noise.at(f), weight, optimize=True).conj()
    scale = np.array(list(outputs.values()))
    value = scale * np.einsum("ojn,ojn->o", half, g).real
    change = 2.0 * scale * np.einsum("ojn,pojn->po", half, slope, optimize=True).real
    return place.dual(value, change.T)
