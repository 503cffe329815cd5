"""The neutral object in the middle: all that a file keeps of a system, and nothing that has to be computed."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.driven import DrivenSystem
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.display import Displayed
from mbsvib.common.expected import kind_of
from mbsvib.common.selection import Names, port_numbers
from mbsvib.equations.selection import port_fields
from mbsvib.errors import ExportError, ResponseError, counted
from mbsvib.feedback.controller import Controller
from mbsvib.responses.from_control import arguments, is_control, is_transfer_function
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.names_ import SignalNames

if TYPE_CHECKING:
    import control

    from mbsvib.feedback.closed_loop import ClosedLoop

# What exporters take.
Source: TypeAlias = "System | ClosedLoop | Controller | StateSpace | SystemData | control.StateSpace"

Space = TypeVar("Space", bound=StateSpace)

SECOND_ORDER = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
FIRST_ORDER = ("A", "B", "C", "D", "transform")
OF_SPACE = "state_space."  # before the keys of the first-order equations
# What a state space has only where damped motions without mass have rates that inputs change at once.
THROUGH = "through"
# What a reduced state space has.
ERROR_BOUND = "error_bound"
# State spaces that have no other realization: exporters take them as they are.
READY = ("given", "controller", "reduced", "rolling")


def shapes(m: int, n: int, inputs: int, outputs: int, bodies: int = 0) -> dict[str, tuple[int, ...]]:
    """Return the shapes of all arrays by the keys of files, for m coordinates and n states."""
    return {
        "M": (m, m), "C": (m, m), "K": (m, m), "B": (m, inputs), "Cq": (outputs, m), "Cv": (outputs, m),
        "Ca": (outputs, m), "D": (outputs, inputs), "body_motion": (bodies, 6, m),
        f"{OF_SPACE}A": (n, n), f"{OF_SPACE}B": (n, inputs), f"{OF_SPACE}C": (outputs, n),
        f"{OF_SPACE}D": (outputs, inputs), f"{OF_SPACE}transform": (2 * m, n), f"{OF_SPACE}{THROUGH}": (2 * m, inputs),
    }  # fmt: skip


def _check(data: SystemData | StateSpace, expected: dict[str, tuple[int, ...]], kinds: tuple[str, ...]) -> None:
    """Refuse arrays of another shape than expected or with numbers that are not finite, and names of these kinds that
    are empty or repeated or have no units.
    """
    space = data.state_space if isinstance(data, SystemData) else data
    if not data.name.isprintable():
        raise ExportError(f"name = {data.name!r}; expected a text without line breaks or other characters that are "
                          f"not printed.")  # fmt: skip
    for key, shape in expected.items():
        label = key.removeprefix(OF_SPACE)
        array = getattr(data if label == key else space, label)
        if array is None:
            continue
        if array.shape != shape:
            raise ExportError(f"{data.name}: {key} has shape {array.shape}; expected {shape}, one row and column "
                              f"for each name that goes with it.")  # fmt: skip
        if not np.isfinite(array).all():
            raise ExportError(f"{data.name}: {key} holds NaN or infinity; expected finite numbers.")
        array.setflags(write=False)
    for kind in kinds:
        owner = space if kind == "states" else data
        names = getattr(owner, kind)
        units = names if kind == "bodies" else getattr(owner, f"{kind[:-1]}_units")
        if len(set(names)) < len(names) or not all(name and name.isprintable() for name in names):
            wrong = next(name for name in names if not name or not name.isprintable() or names.count(name) > 1)
            raise ExportError(f"{data.name}: the name {wrong!r} among the {kind} is empty, there more than once, or "
                              f"has characters that are not printed; expected names that differ.")  # fmt: skip
        if len(units) != len(names):
            raise ExportError(f"{data.name}: {len(units)} units for {len(names)} {kind}; expected one for each.")


@dataclass(frozen=True, repr=False, eq=False)
class SystemData(Displayed):
    """M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u, the same as a state space, names and units.

    ``M``, ``C``, ``K`` (m, m), ``B`` (m, inputs), ``Cq``, ``Cv``, ``Ca`` (outputs, m), ``D`` (outputs, inputs);
    ``body_motion`` (bodies, 6, m) leads from q to the displacements of the bodies, world axes; ``state_space`` holds
    A, B, C, D, the states and the way back from them to q. SI units and radians. Arrays are read-only.
    """

    name: str
    coordinates: tuple[str, ...]
    coordinate_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    bodies: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    B: Array
    Cq: Array
    Cv: Array
    Ca: Array
    D: Array
    body_motion: Array
    state_space: StateSpace

    def __post_init__(self) -> None:
        expected = shapes(len(self.coordinates), len(self.state_space.states), len(self.inputs), len(self.outputs),
                          len(self.bodies))  # fmt: skip
        _check(self, expected, ("coordinates", "inputs", "outputs", "states", "bodies"))

    @classmethod
    def of(cls, system: System, realization: str = "physical") -> SystemData:
        """Return what a file keeps of a system.

        Parameters
        ----------
        system : System
            The equations of motion.
        realization : str
            Of the state space: "physical", "modal" or "balanced".

        Returns
        -------
        SystemData
            Matrices, names and units.

        Raises
        ------
        ResponseError
            If the realization is unknown.
        """
        same = {item.name: getattr(system, item.name) for item in fields(cls) if item.name != "state_space"}
        return cls(**same, state_space=system.state_space(realization))

    def displacements(self, q: ArrayLike) -> dict[str, Array]:
        """Return the displacements of the bodies.

        Parameters
        ----------
        q : array-like, shape (m,) or (m, n)
            Minimal coordinates [m, rad].

        Returns
        -------
        dict of str to array, shape (6,) or (6, n)
            Translation of each body's centre of mass [m] and its rotation [rad], world axes.

        Raises
        ------
        ExportError
            If ``q`` does not have one entry for each coordinate.
        """
        vector = np.asarray(q)
        if vector.ndim not in (1, 2) or len(vector) != len(self.coordinates):
            raise ExportError(f"{self.name}: q has shape {vector.shape}; expected ({len(self.coordinates)},) or "
                              f"({len(self.coordinates)}, n), one entry for each coordinate.")  # fmt: skip
        return dict(zip(self.bodies, self.body_motion @ vector, strict=True))

    def __repr__(self) -> str:
        return (f"SystemData({self.name!r}: {len(self.coordinates)} DOF, {counted(len(self.inputs), 'input')}, "
                f"{counted(len(self.outputs), 'output')})")  # fmt: skip


def state_space_of(
    source: object, realization: str, caller: str, outputs: Names = None, inputs: Names = None
) -> StateSpace:
    """Return the state space of an exporter's source with some of its ``outputs`` and ``inputs``, None: all.

    ``realization``: states of a system; a state space is taken as it is, and accepts "physical" (the default).
    """
    source = with_ports(source, outputs, inputs)
    if isinstance(source, (System, DrivenSystem)):
        return source.state_space(realization)
    ready = source.state_space if isinstance(source, SystemData) else space_of(source, realization)
    if not isinstance(ready, StateSpace):
        raise refusal(source, caller, "a System (model.linearize()), a StateSpace (system.state_space()) or SystemData "
                      "(from_json, from_npz)")  # fmt: skip
    own = ready.realization in READY or kind_of(source) == "closed loop"
    if realization not in ("physical", ready.realization) and not own:
        raise ExportError(f"{caller}: realization = {realization!r}, and the state space given is "
                          f"{ready.realization!r}; give the System instead, or leave the realization out.")  # fmt: skip
    return ready


def discrete_space_of(source: Any, outputs: Names, inputs: Names) -> StateSpace:
    """Return the discrete-time equations of a system of python-control, A, B, C, D from sample to sample."""
    return _named_as_here(StateSpace.from_arrays(**arguments(source))).with_ports(outputs, inputs)


def check_finite(space: Any, caller: str) -> None:
    """Refuse equations (A, B, C, D) that are not finite."""
    for label in "ABCD":
        if not np.isfinite(getattr(space, label)).all():
            raise ExportError(f"{caller}: {label} of '{space.name}' holds NaN or infinity; expected finite numbers.")


def space_of(source: object, realization: str) -> object:
    """Return the state space of a loop, controller or system of python-control, else the source."""
    kind = kind_of(source)
    if kind == "closed loop":
        given = isinstance(source.open_loop, StateSpace)  # type: ignore[attr-defined]
        return source.state_space("modal" if given else realization)  # type: ignore[attr-defined]
    if kind == "controller":
        return source.state_space()  # type: ignore[attr-defined]
    foreign = kind is None and (is_control(source) or is_transfer_function(source))
    return _named_as_here(StateSpace.from_control(source)) if foreign else source


def _named_as_here(space: StateSpace) -> StateSpace:
    """A state space of python-control with the names that its signals had in mbsvib: ``leg1:f`` is ``leg1.f``."""
    inputs, outputs, states = (tuple(map(SignalNames.original, names))
                               for names in (space.inputs, space.outputs, space.states))  # fmt: skip
    return replace(space, name=SignalNames.original(space.name), inputs=inputs, outputs=outputs, states=states)


def linear_of(source: object) -> Any:
    """Return the source if it has responses, poles and zeros (system, closed loop, state space), else None."""
    if kind_of(source) in ("system", "sparse system", "closed loop", "state space"):
        return source
    ready = space_of(source, "modal")
    return ready if isinstance(ready, StateSpace) else None


def refusal(source: object, caller: str, expected: str, fault: str = "") -> ExportError:
    """Return the error of an exporter for what it cannot take, with advice; ``fault``: what is wrong, if not the kind.
    """
    kind, name = type(source).__name__, getattr(source, "name", "")
    if kind == "SparseSystem":
        return ExportError(f"{caller}: '{name}' has {getattr(source, 'dof', 0)} degrees of freedom and is held sparse; "
                           f"export some of its modes, {caller}(system.reduced(20, correction=True)). "
                           f"system.truncation_error tells what is missing then.")  # fmt: skip
    if kind in ("Batch", "DrivenBatch"):
        both = "batch" if kind == "Batch" else "batch.ends"
        return ExportError(f"{caller}: '{name}' is a batch of {len(source)} variants; export them one by one, "  # type: ignore[arg-type]
                           f"{caller}(batch[i]), or all in one file by to_npz_batch({both}).")  # fmt: skip
    if kind_of(source) == "uncertain plant":
        return ExportError(f"{caller}: '{name}' is uncertain; export it at values of its parameters, "
                           f"{caller}(plant.at(values)), or all of it by to_mat or to_control.")  # fmt: skip
    if kind == "DrivenSystem":
        fault, expected = "", f"{expected}, or its .ends, whose inputs are displacements and velocities"
    return ExportError(f"{caller}: {fault or f'system = {kind}'}; expected {expected}.")


def only_port(system: Any, name: str | None, kind: str, caller: str) -> str:
    """Return the name of an output or input (``kind``) of a system, which may be left out (None) where there is one."""
    known: tuple[str, ...] = getattr(system, f"{kind}s")
    if name is None and len(known) != 1:
        raise ExportError(f"{caller}: '{system.name}' has {len(known)} {kind}s; expected the name of one: {kind}=... "
                          f"of {', '.join(known) or 'none: add one to the model'}.")  # fmt: skip
    if name is not None:
        check.known(name, known, f"{caller}: there is no {kind} '{name}'", error=ResponseError)
    return known[0] if name is None else name


def with_ports(source: Any, outputs: Names, inputs: Names) -> Any:
    """Return a source of an exporter with some of its outputs and inputs, by names or patterns; None: all."""
    if outputs is None and inputs is None:
        return source
    if isinstance(source, SystemData):
        o, i = port_numbers(outputs, inputs, (source.outputs, source.inputs), source.name)
        ports = port_fields(source, o, i)
        space = source.state_space.with_ports(ports["outputs"], ports["inputs"])
        rows = {key: getattr(source, key)[o] for key in ("Cq", "Cv", "Ca")}
        return replace(source, B=source.B[:, i], state_space=space, **rows, **ports)
    linear = source if kind_of(source) == "closed loop" else space_of(source, "physical")
    return linear.with_ports(outputs, inputs) if hasattr(linear, "with_ports") else source


def data_of(
    source: object, realization: str, caller: str, outputs: Names = None, inputs: Names = None
) -> SystemData | StateSpace:
    """Return what a file keeps: second-order equations where there are any, else first-order equations alone."""
    source = with_ports(source, outputs, inputs)
    second = source if isinstance(source, System) else \
        getattr(source, "second_order", None) if kind_of(source) == "closed loop" else None  # fmt: skip
    if second is not None:
        return SystemData.of(second, realization)
    space = state_space_of(source, realization, caller)
    return source if isinstance(source, SystemData) else checked(space)


def checked(space: Space) -> Space:
    """Return a state space whose shapes, numbers and names are those that a file can keep."""
    expected = shapes(0, len(space.states), len(space.inputs), len(space.outputs))
    _check(space, {key: expected[OF_SPACE + key] for key in "ABCD"}, ("inputs", "outputs", "states"))
    if space.error_bound is not None and not 0.0 <= space.error_bound < np.inf:
        raise ExportError(f"{space.name}: error_bound = {space.error_bound}; expected a finite number, or none.")
    return space


def system_data_of(source: object, realization: str, caller: str, why: str) -> SystemData:
    """Return the second-order equations of a source; ``why``: for the error: what they are for, and what to do without.
    """
    data = data_of(source, realization, caller)
    if isinstance(data, SystemData):
        return data
    raise ExportError(f"{caller}: system = {type(source).__name__}, which has first-order equations only; expected "
                      "a System, a loop with static gains from displacements and velocities, or SystemData: "
                      f"{why}")  # fmt: skip
