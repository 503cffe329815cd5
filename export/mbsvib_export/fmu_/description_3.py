"""modelDescription.xml of FMI 3.0."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib_export.fmu_.variables import attributes, unit_definitions

if TYPE_CHECKING:
    from mbsvib_export.fmu_.variables import Variable, Variables


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
    updated = {"intermediateUpdate": True} if variable.kind in ("input", "output") else {}
    return f"<Float64{''.join(variable.described(**updated))}/>"


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
