"""The verb: parts joined at ports, as equations, or as responses where some parts are measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from mbsvib.api.sparse_system import SparseSystem
from mbsvib.api.system import System
from mbsvib.assembly.connections import WHO, connections_of, part_of
from mbsvib.assembly.responses import assembled_responses
from mbsvib.assembly.sparse_systems import assembled_sparse
from mbsvib.assembly.systems import assembled_system
from mbsvib.common.arguments import DIRECTIONS, shown
from mbsvib.common.expected import kind_of, names, real
from mbsvib.elements.superelement_files import Reduced
from mbsvib.errors import ModelError, nearest


def assemble(
    parts: Mapping[str, Any], connect: Iterable[tuple[Any, ...]], *, remove: str | Iterable[str] = (),
    distance: float | None = None, name: str = "assembly", positions: Mapping[str, Any] | None = None,
) -> Any:
    """Return parts that are joined at their ports.

    Equations: (M, C, K) of all parts with L q = 0 along rigid connections, K + L^T k L, C + L^T c L of others

    Responses: G = G0 - G0 L^T (L G0 L^T + (k + i w c)^-1)^+ L G0, L: relative displacements of the ports

    Parameters
    ----------
    parts : mapping of str to Model, System, SparseSystem, Measurement or superelements.Reduced
        By name. Each is in balance by itself: connections carry no force at rest. Sparse systems are those of
        ``System.from_matrices``; ports of reduced matrices from files are the numbers of their grid points.
    connect : iterable of (str, str, how) or (str, str, how, directions)
        Two ports PART.PORT, as ``model.add_port`` makes them: inputs and outputs PORT.x ... PORT.rz. ``how`` is
        "rigid", a stiffness (d,) or (d, d) [N/m, N m/rad], or a pair: stiffness and damping, or stiffness and
        ``mv.Dynamic``, by which it depends on frequency (a rational one, unless a part is measured). ``directions``
        (d,): those that are joined, in the order of the stiffness; default: all of the ports, which must be the same.
        Patterns join ports by position.
    remove : str or iterable of str
        Parts that are taken away: the measurement of a whole without them is what remains.
    distance : float
        How far ports that are joined may be apart [m], where their places are known. Default: 1 mm, of small parts a
        twentieth of the largest distance between known places of the larger one.
    name : str
        Name of the system.
    positions : mapping of str to array-like, shape (3,), optional
        Places [m] of ports PART.PORT of which the part does not know them, such as nodes of matrices, world axes.

    Returns
    -------
    System, SparseSystem or AssembledMeasurement
        A system, where no part is measured or taken away; names are PART.NAME, motions of the ground have one input.
        It is sparse if a part is. Else responses at the measured lines with ``variance``, ``condition`` and ``kept``,
        printed as a table.

    Raises
    ------
    ModelError
        If a port is unknown, ports are apart or have other directions, outputs and inputs are not collocated, a part
        to be joined rigidly has motions without mass, a port is not in SI units, or grounds move differently.
    ResponseError
        If lines of measurements differ, or the response of a part is infinite at one.

    Warns
    -----
    AccuracyWarning
        If a measured part gives energy at its port, as complex conjugates of responses do.

    Source: de Klerk, Rixen & Voormeeren, AIAA J. 46 (2008) 1169.
    """
    if not hasattr(parts, "items") or len(parts) < 2:
        raise ModelError(f"{WHO}: parts = {shown(parts)}; expected two or more by name, "
                         f"{{\"base\": system, \"payload\": other}}.")  # fmt: skip
    places: dict[str, dict[str, Any]] = {key: {} for key in parts}
    for port, place in (positions or {}).items():
        owner = max((key for key in parts if port.startswith(f"{key}.")), key=len, default=None)
        if owner is None:
            raise ModelError(f"{WHO}: positions has '{port}', which belongs to none of {', '.join(parts)}; expected "
                             f"names PART.PORT.", element=str(port))  # fmt: skip
        places[owner][port.removeprefix(f"{owner}.")] = place
    held = {key: part_of(key, _linear(key, given), places[key]) for key, given in parts.items()}
    apart = None if distance is None else real(distance, WHO, "distance", "a distance [m], 0 or more", least=0.0)
    connections = connections_of(held, connect, apart)
    gone = names(remove, WHO, "remove", ModelError)
    for one in gone:
        if one not in held:
            raise ModelError(f"{WHO}: remove has {shown(one)}; expected names of parts.{nearest(one, list(held))}")
    listed = list(held.values())
    if not any(part.is_measured for part in listed):
        if gone:
            raise ModelError(f"{WHO}: remove = {', '.join(gone)}, but no part is measured; expected a measurement, "
                             f"whose lines the result has. Of systems, leave the part out.")  # fmt: skip
        sparse = any(kind_of(part.linear) == "sparse system" for part in listed)
        return (assembled_sparse if sparse else assembled_system)(listed, connections, name)
    return assembled_responses(listed, connections, gone)


def _linear(name: str, given: Any) -> Any:
    """The system of reduced matrices, with ports at their grid points."""
    return _of_reduced(name, given) if isinstance(given, Reduced) else given


def _of_reduced(name: str, given: Reduced) -> System | SparseSystem:
    if not given.labels:
        raise ModelError(f"{WHO}: the reduced matrices '{name}' have no labels of grid points; make a system of them, "
                         f"System.from_matrices with inputs and outputs NODE.x, and so on.", element=name)  # fmt: skip
    at = [k for k, (_, component) in enumerate(given.labels) if component]
    rows = np.eye(len(given.labels))[at]
    names = [f"{given.labels[k][0]}.{DIRECTIONS[given.labels[k][1] - 1]}" for k in at]
    made: System | SparseSystem = System.from_matrices(given.M, given.C, given.K, rows.T, rows, inputs=names,
                                                       outputs=names, name=name)  # fmt: skip
    return made
