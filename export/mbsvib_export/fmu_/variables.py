"""The scalar variables of an FMU in their one order, and what depends on what: both descriptions come from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

from mbsvib_export.fmu_.names import CONTROL, base_unit, unique_names
from mbsvib_export.fmu_.plant import Plant, patterns

# What both standards say of each kind of variable.
CAUSALITY: dict[str, dict[str, object]] = {
    "input": {"causality": "input", "variability": "continuous"},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
    "state": {"causality": "local", "variability": "continuous", "initial": "exact"},
    "derivative": {"causality": "local", "variability": "continuous", "initial": "calculated"},
    "parameter": {"causality": "parameter", "variability": "tunable", "initial": "exact"},
}
# The relative tolerance that importers take if nothing is said.
TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True)
class Variable:
    """A scalar: its place in the order is its value reference; 0 is time."""

    reference: int
    kind: str
    name: str
    unit: str
    description: str
    start: float | None = None
    nominal: float | None = None
    state: int | None = None  # of a derivative: the reference of its state

    def described(self, **more: object) -> tuple[str, str]:
        """Return the XML attributes of the variable, and those of its number."""
        return (attributes(name=self.name, valueReference=self.reference, description=self.description,
                           **CAUSALITY[self.kind], **more),
                attributes(unit=self.unit or None, start=self.start, nominal=self.nominal,
                           derivative=self.state))  # fmt: skip


@dataclass(frozen=True, slots=True)
class Variables:
    """All variables of an FMU, the references that each output and derivative depends on, and ``Plant.times``."""

    listed: tuple[Variable, ...]
    depends: dict[int, list[int]]
    names: dict[str, dict[str, str]]
    times: tuple[float, float]

    @property
    def default_experiment(self) -> str:
        """The element DefaultExperiment: some periods of the slowest rate."""
        stop, step = self.times
        return f"<DefaultExperiment{attributes(startTime=0, stopTime=stop, tolerance=TOLERANCE, stepSize=step)}/>"

    def known_by(self, variable: Variable) -> str:
        """Return the references that an output or derivative depends on, as an attribute; it is always written."""
        return f' dependencies="{" ".join(map(str, self.depends[variable.reference]))}"'

    def of(self, kind: str) -> list[Variable]:
        """Return the variables of a kind: input, output, state, derivative or parameter."""
        return [variable for variable in self.listed if variable.kind == kind]

    @property
    def units(self) -> dict[str, dict[str, int]]:
        """The units in use and their base units."""
        base_units = {variable.unit: base_unit(variable.unit) for variable in self.listed if variable.unit}
        return {unit: base for unit, base in base_units.items() if base is not None}


def variables_of(plant: Plant) -> Variables:
    """Return the variables in the order of value references: inputs, outputs, states, derivatives, parameters."""
    space, tuned = plant.space, plant.tunable
    groups = {"input": space.inputs, "output": space.outputs, "parameter": tuple(item.name for item in tuned),
              "state": space.states}  # fmt: skip
    named = unique_names(groups)
    used = {name for names in named.values() for name in names}
    rates = []
    for name in named["state"]:
        rate = f"der({name})"
        while rate in used:
            rate = f"der({rate})"
        used.add(rate)
        rates.append(rate)
    listed: list[Variable] = []

    def add(
        kind: str, names: Sequence[str], units: Sequence[str], describe: Sequence[str], **more: Sequence[float]
    ) -> None:
        for i, name in enumerate(names):
            unit = units[i] if base_unit(units[i]) is not None else ""
            listed.append(Variable(len(listed) + 1, kind, name, unit, describe[i],
                                   **{key: value[i] for key, value in more.items()}))  # type: ignore[arg-type]  # fmt: skip

    m, n = len(space.inputs), len(space.states)
    first = 1 + m + len(space.outputs)
    for kind, more in (("input", {"start": [0.0] * m}), ("output", {}),
                       ("state", {"start": [0.0] * n, "nominal": plant.nominal.tolist()})):  # fmt: skip
        units = getattr(space, f"{kind}_units")
        add(kind, named[kind], units, [f"{kind} {name}" + (f" [{unit}]" if unit and unit != "-" else "")
                                       for name, unit in zip(groups[kind], units, strict=True)], **more)  # fmt: skip
    add("derivative", rates, [_rate(unit) for unit in space.state_units],
        [f"time derivative of the state {name}" for name in space.states], state=range(first, first + n))
    add("parameter", named["parameter"], [item.unit for item in tuned],
        [f"{item.name}, tunable" for item in tuned], start=[item.value for item in tuned])  # fmt: skip
    names = {kind: dict(zip(groups[kind], named[kind], strict=True)) for kind in groups}
    return Variables(tuple(listed), dict(_dependencies(plant)), names, plant.times)


def _rate(unit: str) -> str:
    if base_unit(unit) is None:
        return ""
    return f"{unit[:-2]}/s^2" if unit.endswith("/s") else f"{unit}/s" if "/" not in unit else f"{unit} s^-1"


def _dependencies(plant: Plant) -> Iterator[tuple[int, list[int]]]:
    # tunable parameters have to be among them: importers take wrong Jacobians otherwise, and do not say so
    filled = patterns(plant) if plant.tunable else {label: getattr(plant.space, label) != 0 for label in "ABCD"}
    p, m = filled["D"].shape
    n = len(filled["A"])
    inputs, states = np.arange(1, 1 + m), np.arange(1 + m + p, 1 + m + p + n)
    parameters = list(range(1 + m + p + 2 * n, 1 + m + p + 2 * n + len(plant.tunable)))
    for first, of_states, of_inputs in ((1 + m, "C", "D"), (1 + m + p + n, "A", "B")):
        for i, (x, u) in enumerate(zip(filled[of_states], filled[of_inputs], strict=True)):
            yield first + i, [*inputs[u].tolist(), *states[x].tolist(), *parameters]


def attributes(**values: object) -> str:
    """Return XML attributes, those that are not None, with a space before each."""
    return "".join(f" {key}={quoteattr(_word(value))}" for key, value in values.items() if value is not None)


def _word(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else CONTROL.sub(" ", str(value))


def unit_definitions(variables: Variables) -> str:
    """Return the element UnitDefinitions, the same in both standards, or nothing where no unit is in use."""
    units = "".join(f"<Unit{attributes(name=unit)}><BaseUnit{attributes(**base)}/></Unit>"
                    for unit, base in sorted(variables.units.items()))  # fmt: skip
    return f"<UnitDefinitions>{units}</UnitDefinitions>" if units else ""
