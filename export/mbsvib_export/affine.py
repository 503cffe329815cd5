"""What parameters do to the equations, where they do it affinely: stiffness, damping, mass, inertia.

The derivatives are differences of linearizations, which are exact except for rounding where a matrix is affine; that
it is so is tested, for each parameter alone and for all together, and what is not is refused by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common import expected
from mbsvib.common.arrays import Array
from mbsvib.equations.assembly import linearized
from mbsvib.equations.equations import Equations
from mbsvib.equations.matrices import MATRICES
from mbsvib.errors import ExportError, MbsvibError
from mbsvib.mechanism.changes import scale_of
from mbsvib.mechanism.parameters import Parameters
from mbsvib_export.neutral import refusal

Matrices = dict[str, Array]

# Steps relative to the value: large ones keep most digits, small and negative ones keep inertia possible.
_STEPS = (32.0, 1.0, 1 / 16, -1 / 16, 1 / 256, -1 / 256)
_ROUNDING = 256 * np.finfo(float).eps
_AFFINE = ("mass", "inertia", "stiffness", "damping", "preload")


@dataclass(frozen=True, slots=True)
class Affine:
    """M(p) = M + sum_i (p_i - values_i) slopes["M"][i], likewise C, K, B, Cq, Cv, Ca, D of ``nominal``.

    ``names``, ``units`` and ``values`` are those of the parameters; ``slopes`` (parameters, rows, columns).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    nominal: System
    slopes: dict[str, Array]


def origin_of(system: System, caller: str) -> Any:
    """Return the model of a system whose equations depend on its parameters alone."""
    origin = system.provenance.origin
    if origin is None or system.provenance.removed is not None:
        raise ExportError(f"{caller}: '{system.name}' is not a system that model.linearize() returned, so that nothing "
                          f"tells what parameters do to it; give that one, or leave them out.")  # fmt: skip
    return origin


def names_of(known: Parameters, patterns: str | Sequence[str], caller: str) -> tuple[str, ...]:
    """Return the parameters of one or several names or patterns (``"leg*.k.stiffness"``), each once."""
    listed = expected.names(patterns, caller, "parameters", ExportError)
    return tuple(dict.fromkeys(name for pattern in listed for name in known.matching(pattern)))


def physical_affine(
    source: object, parameters: str | Sequence[str], realization: str, caller: str, argument: str
) -> Affine:
    """Return ``affine`` of an exporter's source in physical states; ``argument``: name of the parameters' argument."""
    parameters = expected.names(parameters, caller, argument, ExportError)
    request = f"{argument} = {', '.join(parameters)}"
    if not isinstance(source, System):
        raise refusal(source, caller, "a System (model.linearize())",
                      f"{request}, but {type(source).__name__} knows no parameters")  # fmt: skip
    if realization != "physical":
        raise ExportError(f"{caller}: realization = {realization!r} with {request}, which would change what the states "
                          f"are; leave it out: they are physical.")  # fmt: skip
    if source.massless:
        raise ExportError(f"{caller}: '{source.name}' has motions that move no mass (see system.explain()), whose "
                          f"rates are affine in no parameter; give them a little mass, or leave {argument} "
                          f"out.")  # fmt: skip
    return affine(source, parameters, caller)


def affine(system: System, parameters: Sequence[str], caller: str) -> Affine:
    """Return the derivatives of the equations by parameters (names or patterns) on which they depend affinely."""
    origin = origin_of(system, caller)
    known = origin.parameters
    names = names_of(known, parameters, caller)
    failures: dict[str, MbsvibError] = {}

    def build(values: Mapping[str, float]) -> Matrices | None:
        try:
            equations: Equations = linearized(origin.with_values(values), system.coordinates, system.cut_joints)
        except MbsvibError as error:
            failures.update(dict.fromkeys(values, error))
            return None
        for name in values:
            failures.pop(name, None)
        if equations.coordinates != system.coordinates or equations.massless != system.massless:
            return None
        return {label: getattr(equations, label) for label in MATRICES}

    base = build({})
    if base is None or any(not _near(base[label], getattr(system, label)) for label in MATRICES):
        raise ExportError(f"{caller}: the model of '{system.name}' gives other equations than these, so that nothing "
                          f"tells what parameters do to them; give the system of model.linearize().")  # fmt: skip
    slopes, steps = {label: np.zeros((len(names), *base[label].shape)) for label in MATRICES}, {}
    for i, name in enumerate(names):
        slope = _slope(base, known[name], scale_of(known, name), lambda value, of=name: build({of: value}))  # type: ignore[misc]
        if slope is None:
            raise ExportError(_refusal(known, name, caller, failures.get(name))) from failures.get(name)
        steps[name] = known[name] + 0.4 * slope[0]
        for label in MATRICES:
            slopes[label][i] = slope[1][label]
    together = build(steps) if len(names) > 1 else base
    shift = np.array([steps[name] - known[name] for name in names]) if len(names) > 1 else np.zeros(len(names))
    for label in MATRICES:
        expected = base[label] + np.tensordot(shift, slopes[label], 1)
        if together is None or not _near(together[label], expected, 1e-9):
            raise ExportError(f"{caller}: {label} is not affine in {', '.join(names)} together, though in each of "
                              f"them; leave some of them out.")  # fmt: skip
    entries = [known.entry(name) for name in names]
    values = np.array([entry.value for entry in entries])
    return Affine(names, tuple(entry.unit for entry in entries), values, system, slopes)


def _near(actual: Array, expected: Array, rtol: float = 1e-11) -> bool:
    size = float(max(np.abs(expected).max(initial=0.0), np.abs(actual).max(initial=0.0)))
    return actual.shape == expected.shape and bool(np.abs(actual - expected).max(initial=0.0) <= rtol * size)


def _slope(
    base: Matrices, value: float, scale: float, build: Callable[[float], Matrices | None]
) -> tuple[float, Matrices] | None:
    """Step and derivatives, or None where no step shows the equations affine."""
    for factor in _STEPS:
        change_of_value = factor * scale
        change_of_value = (value + change_of_value) - value
        end = build(value + change_of_value)
        middle = None if end is None else build(value + change_of_value / 2)
        if end is None or middle is None:
            continue
        slopes = {}
        for label in MATRICES:
            change = end[label] - base[label]
            noise = _ROUNDING * np.maximum(np.abs(end[label]), np.abs(base[label]))
            change[np.abs(change) <= noise] = 0.0
            size = max(np.abs(end[label]).max(initial=0.0), np.abs(base[label]).max(initial=0.0))
            curvature = np.abs(middle[label] - base[label] - change / 2).max(initial=0.0)
            if curvature > 1e-9 * np.abs(change).max(initial=0.0) + _ROUNDING * size:
                return None
            slopes[label] = change / change_of_value
        return change_of_value, slopes
    return None


def _refusal(known: Parameters, name: str, caller: str, failure: MbsvibError | None) -> str:
    if failure is not None:  # of what was tried last: a mass under gravity, whose springs would have to follow
        return (f"{caller}: '{name}' cannot be tuned, as changed alone it gives no system: {failure} Leave it out, or "
                f"export a file for each value, of a model that has all else that goes with it.")  # fmt: skip
    part = known.entry(name).part
    same = [key for key in known if key.startswith(f"{part}.") and known.entry(key).field in _AFFINE]
    options = same or [key for key in known if known.entry(key).field in ("mass", "stiffness", "damping")]
    return (f"{caller}: '{name}' cannot be tuned, as the equations are not affine in it. They would be in stiffness, "
            f"damping, mass and inertia where nothing is condensed and no free length makes loads of them: "
            f"{', '.join(options[:6]) or 'of which there are none'}{', ...' if len(options) > 6 else ''}. For others "
            f"export a file for each value, of model.with_values({{'{name}': ...}}).linearize().")  # fmt: skip
