"""The results of a study at each point: attributes of a system by name, or functions of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, nearest
from mbsvib.studies.plants import NO_PLANT, Plant

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.api.batch import Batch

    Answer: TypeAlias = dict[str, NDArray[Any]]

Asked: TypeAlias = "str | Callable[[Any], Any] | Mapping[str, str | Callable[[Any], Any]]"

# Attributes of batches with an axis of variants in front, as of single systems; units of frequent results.
BATCHED = frozenset((
    "M", "C", "K", "B", "Cq", "Cv", "Ca", "D", "modes.eigenvalues", "modes.errors", "modes.natural",
    "modes.frequencies", "modes.damped_frequencies", "modes.damping_ratios", "modes.stable",
))  # fmt: skip
UNITS = {"modes.eigenvalues": "1/s", "poles": "1/s", "modes.natural": "rad/s", "modes.frequencies": "Hz",
         "modes.damped_frequencies": "Hz", "modes.damping_ratios": "1", "modes.errors": "1"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Question:
    """Results by label: a path such as "modes.frequencies", or a function of a system (``takes_batch``: of a batch).

    ``plant``: what it makes of a system is asked in its place, such as a closed loop.
    """

    items: Mapping[str, str | Callable[[Any], Any]]
    takes_batch: bool = False
    plant: Plant = NO_PLANT

    @property
    def batched(self) -> bool:
        """Whether a batch can compute all results at once."""
        return self.plant.function is None and all(
            item in BATCHED if isinstance(item, str) else self.takes_batch for item in self.items.values())

    @property
    def units(self) -> dict[str, str]:
        """Units of the results, where known."""
        return {label: UNITS[item] for label, item in self.items.items() if isinstance(item, str) and item in UNITS}

    def ask(self, system: Any, values: Mapping[str, Any]) -> Answer:
        """Return the results of one system, at values of the variables, as arrays."""
        result: Answer = {}
        asked = self.plant(system, values)
        for label, item in self.items.items():
            value = follow(asked, item) if isinstance(item, str) else item(asked)
            if isinstance(value, Mapping):
                prefix = "" if len(self.items) == 1 else f"{label}."
                result |= {f"{prefix}{key}": _numbers(f"{prefix}{key}", entry) for key, entry in value.items()}
            else:
                result[label] = _numbers(label, value)
        return result

    def ask_batch(self, batch: Batch) -> Answer:
        """Return the results of all variants, which have an axis of variants in front."""
        results = self.ask(batch, {})
        for label, value in results.items():
            if value.shape[:1] != (len(batch),):
                raise ModelError(f"of: '{label}' of a batch of {len(batch)} has shape {value.shape}; expected one "
                                 f"entry for each along the first axis. Leave batched=True away for functions of "
                                 f"single systems.", field="of")  # fmt: skip
        return results


def question(of: Asked, batched: bool = False, plant: Plant = NO_PLANT) -> Question:
    """Return the results to be computed at each point, checked.

    ``of``: a path from a system ("modes.frequencies", "poles", "K"), a function of a system, or several by label.
    ``batched``: whether functions accept batches too and return an axis of variants in front. ``plant``: what is asked
    in place of the system.
    """
    if plant.function is not None and batched:
        raise check.refuse("study", "batched", batched, "False beside plant, which is a function of single systems")
    items: Mapping[Any, Any] = of if isinstance(of, Mapping) else {_label(of): of}
    for item in items.values():
        if not callable(item) and not (isinstance(item, str) and item):
            raise check.refuse("study", "of", item, "a result such as 'modes.frequencies', or a function of a system")
    if not items:
        raise check.refuse("study", "of", of, "at least one result")
    return Question({str(label): item for label, item in items.items()}, batched, plant)


def follow(system: Any, path: str) -> Any:
    """Return the value of a path of attributes, and of methods that need no arguments."""
    value = system
    for name in path.split("."):
        kind = type(value).__name__
        if name.startswith("_") or not (hasattr(type(value), name) or hasattr(value, name)):
            known = [attribute for attribute in dir(value) if not attribute.startswith("_")]
            raise ModelError(f"of = '{path}': a {kind} has no '{name}'.{nearest(name, known)}", element=path,
                             field="of")  # fmt: skip
        value = getattr(value, name)
        if callable(value):
            try:
                value = value()
            except TypeError as error:
                raise ModelError(f"of = '{path}': {name}() of a {kind} needs arguments; give a function, such as "
                                 f"lambda system: system.{name}(...). ({error})", element=path,
                                 field="of") from error  # fmt: skip
    return value


def _label(of: Any) -> str:
    if isinstance(of, str):
        return of
    name = str(getattr(of, "__name__", type(of).__name__))
    return "value" if name == "<lambda>" else name


def _numbers(label: str, value: Any) -> NDArray[Any]:
    array = np.asarray(value)
    if array.dtype.kind not in "biufc":
        raise ModelError(f"of: '{label}' is {check.shown(value)}; expected numbers.", element=label, field="of")
    return array
