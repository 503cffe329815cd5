"""Variances of responses from few averages, which are noise themselves, and what neighbouring lines tell of them.

sigma^2 = s v,  with v = 1 or v = c + |H|^2 / median |H|^2 and a level s that changes slowly over the lines

Of the sample variances w with nu degrees of freedom and the level s about each line:

sigma^2 = (nu_0 s v + nu w) / (nu_0 + nu),  var(log w / (s v)) = psi'(nu) + psi'(nu_0)

Source: Smyth, Linear models and empirical Bayes methods, Stat. Appl. Genet. Mol. Biol. 3 (2004), sections 4 and 6, for
nu_0; Pintelon & Schoukens, System Identification (2012), section 12.3, for fits with sample variances.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Complex

# Constant parts c tried, and the gain of log-likelihood beyond which chance does not make noise depend on the response.
_FLOORS, _LIKELIER = 10.0 ** np.arange(-4.0, 2.5, 0.5), 6.0
# Lines whose mean is the level about each.
LINES = 15


def local_mean(values: Any, lines: int) -> Any:
    """Return means (..., n) of so many lines about each that is finite, of which others do not count."""
    from scipy.ndimage import convolve1d

    known = np.isfinite(values)
    total, count = (convolve1d(part, np.ones(lines), mode="constant")  # term by term: small ones keep digits
                    for part in (np.where(known, values, 0.0), known.astype(float)))  # fmt: skip
    return np.where(known, total / np.maximum(count, 1.0), values)


def shapes(size: Array) -> list[Array]:
    """Return the shapes v that are tried for a relative ``size`` |H|^2: 1 first, then c + |H|^2."""
    return [np.ones_like(size), *(c + size for c in _FLOORS)]


def likeliest(likelihoods: Sequence[float]) -> int:
    """Return which of the ``shapes`` has the largest log-likelihood; the first, if that is not more than chance."""
    k = int(np.argmax(likelihoods))
    return k if likelihoods[k] - likelihoods[0] > _LIKELIER else 0


def shape(variance: Array, size: Array, lines: int, freedom: float = 1.0) -> Array:
    """Return v (outputs, inputs, n) of sample variances, by ``size`` |H|^2: the likelier one for each output.

    ``freedom``: complex degrees of freedom of each variance.
    """
    result = np.ones_like(variance)
    for o, (w, h) in enumerate(zip(variance, size, strict=True)):
        known = np.isfinite(w) & (w > 0.0) & (h > 0.0)
        middle = np.ma.median(np.ma.array(h, mask=~known), axis=1).filled(1.0)  # type: ignore[no-untyped-call]
        tried, counted = shapes(np.where(known, h, 0.0) / middle[:, None]), np.where(known, w, np.nan)
        result[o] = tried[likeliest(
            [-freedom * np.log((v * local_mean(counted / v, lines))[known]).sum() for v in tried])]  # fmt: skip
    return result


def smoothed(variance: Array, responses: Complex, lines: int) -> Array:
    """Return variances (outputs, inputs, n) with the mean level of so many lines about each."""
    v = shape(variance, np.nan_to_num(np.abs(responses) ** 2), lines)
    return np.asarray(v * local_mean(variance / v, lines))


def shrunk(variance: Array, responses: Complex, freedom: float, alike: float = 1.0) -> Array:
    """Return the variances (outputs, inputs, n) that count in a fit, of sample variances with some degrees of freedom.

    ``alike``: how many neighbouring lines tell as much as one.
    They are larger than the best estimates by as much as what is left of their noise makes values of the fit noisier.
    """
    from scipy.special import polygamma, psi

    lines = round(LINES * alike)
    v = shape(variance, np.nan_to_num(np.abs(responses) ** 2), lines, freedom / alike)
    logarithm = np.log(variance / v)
    level = local_mean(logarithm, lines)  # of logarithms, so that a few lines of much noise do not count for all
    result = variance.copy()
    for o, off in enumerate(logarithm - level):
        known = np.isfinite(off)
        most = LINES * freedom  # degrees to which a level of so many lines is known
        excess = np.var(off[known]) - float(polygamma(1, freedom)) if known.any() else 0.0
        prior = min(0.5 + 1.0 / max(excess, 1.0 / most), most)  # psi'(x) is 1 / (x - 1/2) nearly
        mean = v[o] * np.exp(level[o] + psi(prior) - psi(freedom)) * freedom / prior
        total = prior + freedom
        best = (prior * mean + freedom * variance[o]) / total
        result[o] = best * (1.0 + 2.0 / max(total - 2.0, 1.0))
    return result
