"""modelDescription.xml of FMI 3.0."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib_export.fmu_.variables import attributes, unit_definitions

if TYPE_CHECKING:
    from mbsvib_export.fmu_.variables import Variable, Variables

_CAUSALITY: dict[str, dict[str, object]] = {
    "input": {"causality": "input", "variability": "continuous", "intermediateUpdate": True},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated", "intermediateUpdate": True},
    "state": {"causality": "local", "variability": "continuous", "initial": "exact"},
    "derivative": {"causality": "local", "variability": "continuous", "initial": "calculated"},
    "parameter": {"causality": "parameter", "variability": "tunable", "initial": "exact"},
}


def description_3(variables: Variables, head: dict[str, str], identifier: str, token: str) -> str:
    """Return modelDescription.xml of FMI 3.0.

    ``head``: attributes that both standards have: modelName, description, generationTool, generationDateAndTime.
    ``token``: the text that the matrices file has too.
    """
    able = {"canGetAndSetFMUState": True, "canSerializeFMUState": True, "providesDirectionalDerivatives": True,
            "providesAdjointDerivatives": True}  # fmt: skip
    steps = {"canHandleVariableCommunicationStepSize": True, "maxOutputDerivativeOrder": 1, "hasEventMode": True,
             "providesIntermediateUpdate": True, "canReturnEarlyAfterIntermediateUpdate": True,
             "recommendedIntermediateInputSmoothness": 0}  # fmt: skip
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<fmiModelDescription{attributes(fmiVersion='3.0', instantiationToken=token, **head)}"
        f'{attributes(variableNamingConvention="flat")}>',
        f"<ModelExchange{attributes(modelIdentifier=identifier, needsCompletedIntegratorStep=False, **able)}/>",
        f"<CoSimulation{attributes(modelIdentifier=identifier, **able, **steps)}/>",
        unit_definitions(variables),
        '<LogCategories><Category name="logStatusError"/></LogCategories>',
        variables.default_experiment,
        "<ModelVariables>",
        f"<Float64{attributes(name=_time(variables), valueReference=0, causality='independent')}"
        f'{attributes(variability="continuous")}/>',
        *map(_variable, variables.listed), "</ModelVariables>",
        "<ModelStructure>", *_structure(variables), "</ModelStructure>", "</fmiModelDescription>",
    ]  # fmt: skip
    return "\n".join(line for line in lines if line) + "\n"


def _time(variables: Variables) -> str:
    name = "time"
    while any(variable.name == name for variable in variables.listed):
        name += "_"
    return name


def _variable(variable: Variable) -> str:
    common = attributes(name=variable.name, valueReference=variable.reference, description=variable.description,
                     **_CAUSALITY[variable.kind])  # fmt: skip
    more = attributes(unit=variable.unit or None, start=variable.start, nominal=variable.nominal,
                      derivative=variable.state)  # fmt: skip
    return f"<Float64{common}{more}/>"


def _structure(variables: Variables) -> list[str]:
    entries = {
        kind: [f' valueReference="{item.reference}"{variables.known_by(item)}/>' for item in variables.of(kind)]
        for kind in ("output", "derivative")
    }
    return [
        *(f"<Output{entry}" for entry in entries["output"]),
        *(f"<ContinuousStateDerivative{entry}" for entry in entries["derivative"]),
        *(f"<InitialUnknown{entry}" for entry in (*entries["output"], *entries["derivative"])),
    ]
