"""First-order tolerance analysis: deviations, worst cases and shares from derivatives, close modes treated together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array
from mbsvib.errors import ModelError
from mbsvib.studies.evaluation import DesignPoint
from mbsvib.studies.measures import Modal, together
from mbsvib.studies.quantities import Quantity

CHUNK = 1000  # samples


@dataclass(frozen=True)
class FirstOrder:
    """First-order values of k numbers, those of each quantity in turn (``counts``).

    ``nominal``, ``deviation`` and ``worst`` change (k,); ``shares`` of the variables in the variance (k, v); ``linear``
    (n, k): values of the samples; ``close_modes`` (k,): mask of numbers of close modes.
    """

    nominal: Array
    counts: tuple[int, ...]
    deviation: Array
    worst: Array
    shares: Array
    linear: Array
    close_modes: NDArray[np.bool_]


def first_order(
    point: DesignPoint, quantities: Mapping[str, Quantity], off: Array, sizes: Array, deviation: float
) -> FirstOrder:
    """Return the first-order effect of scatter.

    ``off`` (n, variables): deviation of each variable from its nominal value in each sample. ``sizes`` (variables,):
    tolerances. ``deviation``: standard deviation of each variable in parts of its tolerance.
    """
    try:
        duals = [quantity.at(point) for quantity in quantities.values()]
    except ModelError as error:
        error.add_note("tolerances(..., derivatives=False) does without derivatives, by random samples only.")
        raise
    width = len(sizes)
    slope = np.concatenate([np.broadcast_to(dual.slope, (len(dual.value), width)) for dual in duals])
    names = list(point.rates)
    bad = np.flatnonzero(~np.isfinite(slope).all(axis=0))
    if len(bad):
        name = names[bad[0]]
        raise ModelError(f"tolerances: there is no derivative to '{name}': changed alone it takes degrees of freedom "
                         f"away, or modes meet. Leave it out, or tie it to what moves along.", element=name,
                         field="tolerances")  # fmt: skip
    nominal = np.concatenate([dual.value for dual in duals])
    size = np.abs(slope)
    linear = nominal + off @ slope.T
    root = np.sqrt(((size * sizes) ** 2).sum(axis=1)) * deviation
    counts = tuple([len(dual.value) for dual in duals])
    worst, close_modes = size @ sizes, np.zeros(len(nominal), dtype=bool)
    for at, values, bound, length in _close_modes(point, quantities, counts, off, sizes * deviation):
        linear[:, at] = nominal[at] + values
        root[at], worst[at], size[at], close_modes[at] = values.std(ddof=1), bound @ sizes, length, True
    variance = (size * sizes) ** 2
    total = variance.sum(axis=1, keepdims=True)
    shares = np.divide(variance, total, out=np.zeros_like(variance), where=total > 0.0)
    return FirstOrder(nominal, counts, root, worst, shares, linear, close_modes)


def no_order(point: DesignPoint, quantities: Mapping[str, Quantity], off: Array) -> FirstOrder:
    """Return the nominal values alone; first-order results are NaN.

    ``off`` (n, variables): deviation of each variable from its nominal value in each sample.
    """
    values = [np.atleast_1d(np.asarray(quantity(point.system), dtype=float)) for quantity in quantities.values()]
    nominal = np.concatenate(values)
    missing = np.full(len(nominal), np.nan)
    shares, linear = np.full((len(nominal), off.shape[1]), np.nan), np.full((len(off), len(nominal)), np.nan)
    counts = tuple([len(quantity) for quantity in values])
    return FirstOrder(nominal, counts, missing, missing, shares, linear, np.zeros(len(nominal), dtype=bool))


def _close_modes(
    point: DesignPoint, quantities: Mapping[str, Quantity], counts: tuple[int, ...], off: Array, deviation: Array
) -> list[tuple[int, Array, Array, Array]]:
    """Index of each number whose mode is near to others, its changes in the samples, and the largest and the root mean
    square change that each variable can make.
    """
    starts = np.concatenate(([0], np.cumsum(counts)))
    modal = [(int(start), quantity, quantity.of(point.modes))
             for start, quantity in zip(starts[:-1], quantities.values(), strict=True)
             if isinstance(quantity, Modal)]  # fmt: skip
    if not modal:
        return []
    values, slopes = point.pairs
    scatter = np.sqrt(((np.abs(slopes[:, :, 0]) * deviation[:, None]) ** 2).sum(axis=0))
    result = []
    for group in together(values[:, 0], scatter):
        if not any(set(group) & set(numbers) for _, _, numbers in modal):
            continue
        forms = point.derivatives.close_modes(point.modes, group)
        if forms is None:
            continue
        start, slope = forms
        known = values[group, 0]
        found = np.concatenate([np.linalg.eigvals(start + np.tensordot(off[i : i + CHUNK], slope, axes=1))
                                for i in range(0, len(off), CHUNK)])  # fmt: skip
        # in ascending size, as modes are
        changes = np.take_along_axis(found, np.argsort(np.abs(found), axis=1), axis=1) - known[
            np.argsort(np.abs(known), kind="stable")]
        for first, quantity, numbers in modal:
            for k, mode in enumerate(np.array(group)[np.argsort(np.abs(known), kind="stable")].tolist()):
                if mode not in numbers:
                    continue
                rate = quantity.rate(complex(values[mode, 0]))
                # the real part of an eigenvalue is bounded by the Hermitian part of its matrix
                rotated = rate * slope
                half = 0.5 * (rotated + rotated.conj().transpose(0, 2, 1))
                result.append((first + numbers.index(mode), np.asarray((rate * changes[:, k]).real),
                               np.linalg.norm(half, 2, axis=(1, 2)), np.linalg.norm(half, axis=(1, 2))))  # fmt: skip
    return result
