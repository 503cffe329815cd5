"""Derivatives by differences of the whole computation, extrapolated to step zero."""

import numpy as np


def step_of(parameters, name):
    """A step that is small against the parameter and large against rounding."""
    value = parameters[name]
    if ".inertia." in name:
        part = name.rsplit(".", 1)[0]
        return 1e-4 * max(parameters[f"{part}.{entry}"] for entry in ("xx", "yy", "zz"))
    return 1e-4 * (abs(value) if abs(value) > 1.0 else 1.0)


def difference(model, system, name, of):
    """d of(system) / d name by central differences of two steps (error: step^4)."""
    value, h = system.parameters[name], step_of(system.parameters, name)

    def at(change):
        return of(model.with_values({name: value + change}).linearize(independent=system.coordinates))

    one, two = ((at(k * h) - at(-k * h)) / (2 * k * h) for k in (1, 2))
    return (4 * one - two) / 3


def eigenvalues(system):
    return system.modes().eigenvalues


def assert_derivative(found, expected, values, step, rtol=1e-6):
    """Differences are blind to what rounding of the values, divided by the step, hides."""
    limit = rtol * np.abs(expected) + 3e-12 * np.abs(values).max() / step
    assert (np.abs(found - expected) <= limit).all(), np.c_[found, expected][np.abs(found - expected) > limit]
