"""Plant and controller, connected, in one file: an archive of SSP 1.0 (System Structure and Parameterization)."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

from mbsvib.common.arguments import shown
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path, flag
from mbsvib.errors import ExportError
from mbsvib_export.cosimulation.check import as_file
from mbsvib_export.cosimulation.connections import SIDES, Connections, connect
from mbsvib_export.cosimulation.unit import UnitFile, open_unit
from mbsvib_export.fmu_.names import unique_names
from mbsvib_export.fmu_.variables import attributes

_SPACE = "http://ssp-standard.org/SSP1/SystemStructure"
_EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


def to_ssp(
    plant: Any, controller: Any, path: str | os.PathLike[str], *, connections: Mapping[str, str | None] | None = None,
    version: str = "2.0", name: str = "loop", outer: bool = True,
) -> Path:  # fmt: skip
    """Write a plant and its controller as one archive that co-simulation tools open: FMUs and connections.

    Inputs that are not connected are inputs of the system of both, and all outputs are outputs of it.

    Parameters
    ----------
    plant, controller : path, System, StateSpace, SystemData or control.StateSpace
        As for ``check_cosimulation``: FMU files, or systems, which are exported.
    path : str or path
        The file, ``"loop.ssp"``.
    connections : mapping of str to str, optional
        As for ``check_cosimulation``: output by input where names differ.
    version : str
        FMI "2.0" or "3.0" of what is exported here.
    name : str
        Name of the system of both units.
    outer : bool
        False: the system of both has no inputs and outputs, for tools that know none (Ecos).

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ExportError
        If an FMU cannot be read, units or names do not fit, or the file cannot be written.
    """
    goal = a_path(path, "to_ssp", ExportError)
    outer = flag(outer, "to_ssp", "outer", ExportError)
    if not isinstance(name, str):
        raise ExportError(f"to_ssp: name = {shown(name)}; expected a text.")
    if goal.suffix.lower() != ".ssp":
        raise ExportError(f"to_ssp: path = '{goal}'; expected a name that ends in .ssp, by which importers know it.")
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="mbsvib-")))
        units = {side: stack.enter_context(open_unit(as_file(source, folder / f"{side}.fmu", version), "to_ssp"))
                 for side, source in zip(SIDES, (plant, controller), strict=True)}  # fmt: skip
        links = connect(list(units.values()), connections, "to_ssp")
        described = "\n".join(_description(name, units, links, outer)) + "\n"

        def write(stream: IO[bytes]) -> None:
            with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
                for entry, content in (
                    ("SystemStructure.ssd", described.encode()),
                    *((f"resources/{side}.fmu", unit.path.read_bytes()) for side, unit in units.items()),
                ):
                    archive.writestr(zipfile.ZipInfo(entry, (2020, 1, 1, 0, 0, 0)), content)

        return write_atomic(goal, write)


def _description(name: str, units: dict[str, UnitFile], links: Connections, with_outputs: bool) -> Iterator[str]:
    # side, name in the file, kind and unit of each signal, in the order of the numbers of connections
    inputs, outputs = ([(side, item.name, item.causality, item.unit or None) for side, unit in units.items()
                        for item in unit.description.modelVariables if item.causality == kind]
                       for kind in ("input", "output"))  # fmt: skip
    outer = sorted([*(inputs[i] for i in links.free), *outputs], key=lambda item: SIDES.index(item[0]))
    outer = outer if with_outputs else []
    # a name is that of the signal, except where both units have a signal of that name
    names = unique_names({"signal": [item[1] for item in outer]})["signal"]
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield (f'<ssd:SystemStructureDescription xmlns:ssd="{_SPACE}Description" xmlns:ssc="{_SPACE}Common"'
           f'{attributes(version="1.0", name=name)}>')  # fmt: skip
    yield f"<ssd:System{attributes(name=name)}>"
    if outer:
        yield from _connectors((unique, *item[2:]) for unique, item in zip(names, outer, strict=True))
    yield "<ssd:Elements>"
    for side in units:
        component = attributes(name=side, type="application/x-fmu-sharedlibrary", source=f"resources/{side}.fmu")
        yield f"<ssd:Component{component}>"
        yield from _connectors(item[1:] for item in (*inputs, *outputs) if item[0] == side)
        yield "</ssd:Component>"
    yield "</ssd:Elements>"
    yield "<ssd:Connections>"
    for i, o in links.pairs:
        yield _connection(*outputs[o][:2], *inputs[i][:2])
    for unique, (side, inner, kind, _) in zip(names, outer, strict=True):
        yield _connection(None, unique, side, inner) if kind == "input" else _connection(side, inner, None, unique)
    yield "</ssd:Connections></ssd:System>"
    yield from _units(units)
    known = [unit.description.defaultExperiment for unit in units.values()]
    stop = max((float(item.stopTime) for item in known if item is not None and item.stopTime), default=1.0)
    yield f"<ssd:DefaultExperiment{attributes(startTime=0, stopTime=stop)}/>"
    yield "</ssd:SystemStructureDescription>"


def _connectors(listed: Iterable[tuple[str, str, str | None]]) -> Iterator[str]:
    yield "<ssd:Connectors>"
    for name, kind, unit in listed:
        yield f"<ssd:Connector{attributes(name=name, kind=kind)}><ssc:Real{attributes(unit=unit)}/></ssd:Connector>"
    yield "</ssd:Connectors>"


def _connection(start: str | None, source: str, end: str | None, goal: str) -> str:
    return "<ssd:Connection" + attributes(
        startElement=start, startConnector=source, endElement=end, endConnector=goal
    ) + "/>"  # fmt: skip


def _units(units: dict[str, UnitFile]) -> Iterator[str]:
    base_units = {signal.unit: signal.base for unit in units.values() for signal in (*unit.inputs, *unit.outputs)
                  if signal.unit and signal.base is not None}  # fmt: skip
    if base_units:
        yield "<ssd:Units>"
        for unit, base in sorted(base_units.items()):
            exponents = {key: int(value) for key, value in zip(_EXPONENTS, base, strict=False) if value}
            yield (f"<ssc:Unit{attributes(name=unit)}><ssc:BaseUnit{attributes(**exponents)}"
                   f"{attributes(factor=base[8], offset=base[9])}/></ssc:Unit>")  # fmt: skip
        yield "</ssd:Units>"
