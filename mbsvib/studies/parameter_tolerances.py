"""Tolerances of parameters, and random values within them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import a_model
from mbsvib.common.number_text import real
from mbsvib.errors import ModelError
from mbsvib.mechanism.changes import resolved
from mbsvib.studies.design import design, posed_names

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array
    from mbsvib.studies.design import StudyVariables, Ties


# standard deviation over tolerance
DEVIATION = {"normal": 1.0 / 3.0, "uniform": 1.0 / np.sqrt(3.0)}


def parameter_tolerances(
    model: Model, tolerances: Mapping[str, Any], ties: Ties | None, gains: Mapping[str, float], relaxed: bool
) -> tuple[StudyVariables, dict[str, float]]:
    """Return the variables and their tolerances.

    ``tolerances``: by name or pattern, in the unit of the parameter, or as a share of its value, "2 %". Names of
    ``ties`` and ``gains`` may be among them; these and ``relaxed`` are as of ``design``.
    """
    if not isinstance(tolerances, Mapping) or not tolerances:
        raise check.refuse("tolerances", "tolerances", tolerances, "how far each parameter may be off, such as "
                           "{'leg*.k.stiffness': '2 %'}")  # fmt: skip
    if ties is not None and not isinstance(ties, Mapping):
        raise check.refuse("tolerances", "ties", ties, "a mapping of variables to the parameters that they move")
    used = {name: rates for name, rates in (ties or {}).items() if name in tolerances}
    mapped = {name: value for name, value in tolerances.items() if name in used or name in gains}
    unmapped = {name: value for name, value in tolerances.items() if name not in mapped}
    parameters = a_model(model, "study").parameters
    picked = {name: (name,) for name in mapped} | posed_names(model, list(unmapped))
    known = resolved(parameters, {name: value for name, value in unmapped.items() if name not in picked})
    known |= {name: tolerances[pattern] for pattern, names in picked.items() for name in names}
    values = {name: known[name] for pattern in tolerances
              for name in picked.get(pattern) or parameters.matching(pattern)}  # fmt: skip
    variables = design(model, values, used or None, gains, relaxed)
    return variables, {name: _tolerance(name, value, variables.start[name]) for name, value in values.items()}


def _tolerance(name: str, tolerance: Any, value: float) -> float:
    expected = "how far it may be off, in its unit or as a share of its value, such as '2 %'"
    if isinstance(tolerance, str):
        text = tolerance.strip()
        try:
            share = real(text.removesuffix("%")) / 100.0
        except ValueError as error:
            raise check.refuse(f"tolerance of '{name}'", "value", tolerance, expected) from error
        if not text.endswith("%"):
            raise check.refuse(f"tolerance of '{name}'", "value", tolerance, expected)
        if value == 0.0:
            raise ModelError(f"tolerance of '{name}': {tolerance} of 0 is nothing; give it in the parameter's unit.",
                             element=name, field="tolerances")  # fmt: skip
        result = share * abs(value)
    else:
        result = check.number(tolerance, f"tolerance of '{name}'", "value", expected)
    if not 0.0 < result < np.inf:
        raise check.refuse(f"tolerance of '{name}'", "value", tolerance, "more than 0")
    return result


def random_values(
    centre: Mapping[str, float], tolerance: Mapping[str, float], samples: int, distribution: str, seed: int | None
) -> dict[str, Array]:
    """Return random values (samples,) by variable.

    ``centre``, ``tolerance``: nominal value and tolerance of each variable. ``distribution``: "normal": the tolerance
    is three standard deviations; "uniform": all values within it are equally likely.
    """
    check.count(samples, "tolerances", "samples", 2)
    if distribution not in DEVIATION:
        raise check.refuse("tolerances", "distribution", distribution, "'normal' or 'uniform'")
    random = np.random.default_rng(seed)
    result = {}
    for name, width in tolerance.items():
        off = random.standard_normal(samples) / 3.0 if distribution == "normal" else random.uniform(-1.0, 1.0, samples)
        result[name] = centre[name] + width * off
    return result
