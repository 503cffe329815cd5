"""modelDescription.xml of FMI 2.0."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib_export.fmu_.variables import attributes, unit_definitions

if TYPE_CHECKING:
    from mbsvib_export.fmu_.variables import Variable, Variables


def description_2(variables: Variables, head: dict[str, str], identifier: str, token: str) -> str:
    """Return modelDescription.xml of FMI 2.0.

    ``head``: attributes that both standards have: modelName, description, generationTool, generationDateAndTime.
    ``token``: the text that the matrices file has too.
    """
    able = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "providesDirectionalDerivative": True}
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<fmiModelDescription{attributes(fmiVersion='2.0', guid=token, **head)}"
        f'{attributes(variableNamingConvention="flat", numberOfEventIndicators=0)}>',
        f"<ModelExchange{attributes(modelIdentifier=identifier, completedIntegratorStepNotNeeded=True, **able)}/>",
        f"<CoSimulation{attributes(modelIdentifier=identifier, canHandleVariableCommunicationStepSize=True)}"
        f"{attributes(canInterpolateInputs=True, maxOutputDerivativeOrder=1, **able)}/>",
        unit_definitions(variables),
        '<LogCategories><Category name="logStatusError"/></LogCategories>',
        variables.default_experiment,
        "<ModelVariables>", *map(_variable, variables.listed), "</ModelVariables>",
        *_structure(variables), "</fmiModelDescription>", "",
    ]  # fmt: skip
    return "\n".join(line for line in lines if line) + "\n"


def _variable(variable: Variable) -> str:
    common, real = variable.described()  # numbered from 1 in the order of their references
    return f"<ScalarVariable{common}><Real{real}/></ScalarVariable>"


def _structure(variables: Variables) -> list[str]:
    unknowns = {}
    for kind in ("output", "derivative"):
        unknowns[kind] = "".join(
            f'<Unknown index="{variable.reference}"{variables.known_by(variable)}/>' for variable in variables.of(kind)
        )
    outputs, derivatives = unknowns["output"], unknowns["derivative"]
    return [
        "<ModelStructure>",
        f"<Outputs>{outputs}</Outputs>" if outputs else "",
        f"<Derivatives>{derivatives}</Derivatives>" if derivatives else "",
        f"<InitialUnknowns>{outputs}{derivatives}</InitialUnknowns>" if outputs or derivatives else "",
        "</ModelStructure>",
    ]
