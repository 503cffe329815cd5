"""Derivatives by differences of the whole computation, extrapolated to step zero."""

import numpy as np

from mbsvib.equations.matrices import MATRICES
from mbsvib.sensitivities.variables import Direction
from mbsvib.sensitivities.variants import Variants


def step_of(parameters, name):
    """A step that is small against the parameter and large against rounding."""
    value = parameters[name]
    if ".inertia." in name:
        part = name.rsplit(".", 1)[0]
        return 1e-4 * max(parameters[f"{part}.{entry}"] for entry in ("xx", "yy", "zz"))
    if name.endswith((".radius", ".wall", ".beta")):
        return 1e-3 * value
    return 1e-4 * (abs(value) if abs(value) > 1.0 else 1.0)


def difference(model, system, name, of):
    """d of(system) / d name, an array or a list of them, by central differences of two steps (error: step^4)."""
    value, h = system.parameters[name], step_of(system.parameters, name)

    def at(change):
        return of(model.with_values({name: value + change}).linearize(independent=system.coordinates))

    def extrapolated(near, minus_near, far, minus_far):
        return (4 * (near - minus_near) / (2 * h) - (far - minus_far) / (4 * h)) / 3

    points = [at(k * h) for k in (1, -1, 2, -2)]
    if isinstance(points[0], list):
        return [extrapolated(*item) for item in zip(*points, strict=True)]
    return extrapolated(*points)


def eigenvalues(system):
    return system.modes().eigenvalues


def assert_derivative(result, expected, values, step, rtol=1e-6):
    """Differences are blind to what rounding of the values, divided by the step, hides."""
    limit = rtol * np.abs(expected) + 3e-12 * np.abs(values).max() / step
    assert (np.abs(result - expected) <= limit).all(), np.c_[result, expected][np.abs(result - expected) > limit]


def of_variants(system, name):
    """Derivatives of all matrices to one parameter, by variants of the whole equations."""
    slopes = Variants(system).slopes((Direction(name, ((name, 1.0),)),))
    return {key: slope[0] for key, slope in slopes.items()}


def assert_as_variants(matrices, k, system, expected, value, rtol, noise, *, lost=True):
    """Derivatives of all matrices to the k-th variable are ``expected``; ``noise`` is of the whole matrix over the
    value of the parameter. ``lost`` allows that degrees of freedom are lost, where neither is a number.
    """
    scale, name = max(abs(value), 1.0), matrices.variables[k]
    for key in MATRICES:
        result, at = getattr(matrices, key)[k], expected[key]
        assert np.isnan(result).all() == np.isnan(at).all(), (name, key)
        limit = rtol * np.abs(at).max(initial=0.0) + noise * np.abs(getattr(system, key)).max(initial=0.0) / scale
        assert (lost and np.isnan(at).any()) or np.abs(result - at).max(initial=0.0) <= limit, (name, key)
