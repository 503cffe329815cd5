"""modelDescription.xml of FMI 2.0 and 3.0."""

from __future__ import annotations

from mbsvib_export.fmu_.variables import Variable, Variables, attributes, unit_definitions

VERSIONS = ("2.0", "3.0")
# What FMUs of a version can do: attributes of all FMUs, of model exchange, of co-simulation.
_ABLE = {
    "2.0": (
        {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "providesDirectionalDerivative": True},
        {"completedIntegratorStepNotNeeded": True},
        {"canHandleVariableCommunicationStepSize": True, "canInterpolateInputs": True, "maxOutputDerivativeOrder": 1},
    ),
    "3.0": (
        {"canGetAndSetFMUState": True, "canSerializeFMUState": True, "providesDirectionalDerivatives": True,
         "providesAdjointDerivatives": True},
        {"needsCompletedIntegratorStep": False},
        {"canHandleVariableCommunicationStepSize": True, "maxOutputDerivativeOrder": 1, "hasEventMode": True,
         "providesIntermediateUpdate": True, "canReturnEarlyAfterIntermediateUpdate": True,
         "recommendedIntermediateInputSmoothness": 0},
    ),
}  # fmt: skip


def description(version: str, variables: Variables, head: dict[str, str], identifier: str, token: str) -> str:
    """Return modelDescription.xml; ``head``: attributes of both standards; ``token``: as in the file of numbers."""
    able, exchange, steps = _ABLE[version]
    if version == "2.0":
        top = attributes(fmiVersion=version, guid=token, **head, variableNamingConvention="flat",
                         numberOfEventIndicators=0)  # fmt: skip
        exchange, steps, listed, structure = exchange | able, steps | able, _variables_2, _structure_2
    else:
        top = attributes(fmiVersion=version, instantiationToken=token, **head, variableNamingConvention="flat")
        exchange, steps, listed, structure = exchange | able, able | steps, _variables_3, _structure_3
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<fmiModelDescription{top}>",
        f"<ModelExchange{attributes(modelIdentifier=identifier, **exchange)}/>",
        f"<CoSimulation{attributes(modelIdentifier=identifier, **steps)}/>",
        unit_definitions(variables),
        '<LogCategories><Category name="logStatusError"/></LogCategories>',
        variables.default_experiment,
        "<ModelVariables>", *listed(variables), "</ModelVariables>",
        "<ModelStructure>", *structure(variables), "</ModelStructure>", "</fmiModelDescription>",
    ]  # fmt: skip
    return "\n".join(line for line in lines if line) + "\n"


def _variables_2(variables: Variables) -> list[str]:
    return [f"<ScalarVariable{common}><Real{number}/></ScalarVariable>"  # numbered from 1 in order of their references
            for common, number in (item.described() for item in variables.listed)]  # fmt: skip


def _variables_3(variables: Variables) -> list[str]:
    time = "time"
    while any(item.name == time for item in variables.listed):
        time += "_"
    more = {"intermediateUpdate": True}
    described = [item.described(**more if item.kind in ("input", "output") else {}) for item in variables.listed]
    clock = attributes(name=time, valueReference=0, causality="independent", variability="continuous")
    return [f"<Float64{clock}/>", *(f"<Float64{common}{number}/>" for common, number in described)]


def _unknowns(variables: Variables, reference: str) -> tuple[list[str], list[str]]:
    """Attributes of outputs and of derivatives in the structure; ``reference``: what the number of one is called."""
    def entry(item: Variable) -> str:
        return f' {reference}="{item.reference}"{variables.known_by(item)}/>'

    return [entry(item) for item in variables.of("output")], [entry(item) for item in variables.of("derivative")]


def _structure_2(variables: Variables) -> list[str]:
    outputs, derivatives = ("".join(f"<Unknown{entry}" for entry in listed) for listed in _unknowns(variables, "index"))
    groups = {"Outputs": outputs, "Derivatives": derivatives, "InitialUnknowns": outputs + derivatives}
    return [f"<{group}>{entries}</{group}>" for group, entries in groups.items() if entries]


def _structure_3(variables: Variables) -> list[str]:
    outputs, derivatives = _unknowns(variables, "valueReference")
    groups = {"Output": outputs, "ContinuousStateDerivative": derivatives, "InitialUnknown": outputs + derivatives}
    return [f"<{element}{entry}" for element, entries in groups.items() for entry in entries]
