"""Names for what python-control computes from a named plant: most of its functions hand back ``u[0]`` and ``y[0]``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any, TypeVar

from mbsvib.common.arguments import shown
from mbsvib.common.expected import flag
from mbsvib.errors import ExportError
from mbsvib.responses.from_control import is_control
from mbsvib_export.packages import need

T = TypeVar("T")


def named(result: T, like: Any, *, controller: bool = False, states: bool = False, name: str | None = None) -> T:
    """Return a result of python-control with the names of the plant it was made from.

    Its ``balred``, ``minreal``, ``series``, ``feedback``, ``h2syn``, ``hinfsyn``, products, sums and signs drop names.
    Interconnections by name go on working with them again.

    Parameters
    ----------
    result : system of python-control
        StateSpace, TransferFunction or FrequencyResponseData; it is not changed.
    like : system of python-control, or sequence of them
        Whose inputs and outputs the result has. Of several in the order of the signal (``series(one, two)``), inputs
        are those of the first and outputs those of the last.
    controller : bool
        Whether the result is a controller of the plant (h2syn, hinfsyn): its inputs are then the plant's last
        outputs, its outputs the plant's last inputs.
    states : bool
        Whether the states are those of the plants, one after the other, as after a sign or in series.
    name : str, optional
        Name of the result; default: that of the plant, with ``_controller`` for a controller, or both names.

    Returns
    -------
    system of python-control
        A copy of the result with names.

    Raises
    ------
    ExportError
        If the numbers of inputs, outputs or states do not fit.
    """
    need("control", "named")
    controller, states = (flag(value, "named", field, ExportError)
                          for value, field in ((controller, "controller"), (states, "states")))  # fmt: skip
    if name is not None and not isinstance(name, str):
        raise ExportError(f"named: name = {shown(name)}; expected a text.")
    plants = list(like) if isinstance(like, (list, tuple)) and like else [like]
    for system in (result, *plants):
        if not hasattr(system, "input_labels"):
            raise ExportError(f"named: {type(system).__name__} is not a system of python-control; expected a "
                              f"StateSpace, TransferFunction or FrequencyResponseData (of h2syn and hinfsyn: the first "
                              f"thing they return).")  # fmt: skip
    renamed: Any = deepcopy(result)
    if controller:
        inputs = _last(plants[-1].output_labels, renamed.ninputs, "inputs", "outputs")
        outputs = _last(plants[0].input_labels, renamed.noutputs, "outputs", "inputs")
    else:
        # series(one, two): the signal enters one and leaves two
        inputs = _all(plants[0].input_labels, renamed.ninputs, "inputs")
        outputs = _all(plants[-1].output_labels, renamed.noutputs, "outputs")
    renamed.set_inputs(inputs)
    renamed.set_outputs(outputs)
    if states:
        from mbsvib_export.control_space import unique_names

        renamed.set_states(_all(unique_names(plants, "state"), renamed.nstates, "states"))
    joined = "_".join(dict.fromkeys(system.name for system in plants))
    renamed.name = name if name is not None else joined + ("_controller" if controller else "")
    if is_control(renamed):  # what is made of it keeps names too
        from mbsvib_export.control_space import NamedStateSpace

        return NamedStateSpace.of(renamed)
    return renamed  # type: ignore[no-any-return]


def _all(labels: Sequence[str], count: int, ports: str) -> list[str]:
    if len(labels) != count:
        raise ExportError(f"named: the result has {count} {ports}, the plant {len(labels)} ({_few(labels)}); "
                          f"give the system whose {ports} it has as like=, or controller=True for a "
                          f"controller.")  # fmt: skip
    return list(labels)


def _last(labels: Sequence[str], count: int, ports: str, whose: str) -> list[str]:
    if len(labels) < count:
        raise ExportError(f"named: the controller has {count} {ports}, the plant only {len(labels)} {whose} "
                          f"({_few(labels)}); give the plant that it was designed for as like=.")  # fmt: skip
    return list(labels)[len(labels) - count :]


def _few(labels: Sequence[str]) -> str:
    return ", ".join(labels[:6]) + (", ..." if len(labels) > 6 else "")


def with_names(function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Call a function of python-control, and name its results after its arguments.

    ``with_names(control.hinfsyn, plant, 2, 1)`` is ``control.hinfsyn(plant, 2, 1)`` with named results: the controller
    has the plant's last outputs as inputs and its last inputs as outputs, the closed loop what is left of both. Knows
    ``balred``, ``modred``, ``minreal``, ``series``, ``parallel``, ``feedback``, ``negate``, ``h2syn`` and ``hinfsyn``;
    ``series``, ``parallel``, ``feedback`` and ``negate`` keep the names of states too.

    Parameters
    ----------
    function : callable
        The function, such as ``control.feedback``.
    *arguments
        Its arguments, systems first.
    **options
        Its options.

    Returns
    -------
    whatever the function returns
        With names in the place of ``u[0]`` and ``y[0]``.

    Raises
    ------
    ExportError
        If the function is not known, or needs slycot, which is not installed. Its own errors are not touched.
    """
    need("control", "with_names")
    function_name = getattr(function, "__name__", repr(function))
    name = _SAME.get(function_name, function_name)
    if name not in (*_OF_FIRST, *_SYNTHESES, "series"):
        raise ExportError(f"with_names: {name} is none of {', '.join((*_OF_FIRST, *_SYNTHESES, 'series'))}; call it, "
                          f"and give its result to named(result, like=plant).")  # fmt: skip
    if name in _KEEP_STATES:
        from mbsvib_export.control_space import NamedStateSpace

        arguments = tuple([NamedStateSpace.of(item) if is_control(item) else item for item in arguments])
    try:
        result = function(*arguments, **options)
    except (ImportError, TypeError) as error:
        if "slycot" not in str(error):
            raise
        raise ExportError(f'with_names: {name} of python-control needs slycot, which is not installed; install it '
                          f'with:  pip install "mbsvib[slycot]"') from error  # fmt: skip
    if name == "series":
        systems = [item for item in arguments if hasattr(item, "input_labels")]
        return named(result, systems) if systems else result
    plant = arguments[0]
    if name in _OF_FIRST:
        many = isinstance(result, list)  # balred of several orders
        return [named(item, plant) for item in result] if many else named(result, plant)
    controller, *other_results = result if isinstance(result, tuple) else (result,)
    loops = (_loop(item, plant, controller) if hasattr(item, "input_labels") else item for item in other_results)
    renamed = [named(controller, plant, controller=True), *loops]
    return tuple(renamed) if isinstance(result, tuple) else renamed[0]


_OF_FIRST = ("balred", "modred", "minreal", "parallel", "feedback", "negate")
_SAME = {"balanced_reduction": "balred", "model_reduction": "modred", "minimal_realization": "minreal"}
_SYNTHESES = ("h2syn", "hinfsyn")
# Their results have the states of their arguments.
_KEEP_STATES = ("series", "parallel", "feedback", "negate")


def _loop(loop: Any, plant: Any, controller: Any) -> Any:
    """The plant with the controller's loop closed: it keeps its first inputs and outputs."""
    renamed = deepcopy(loop)
    renamed.set_inputs(list(plant.input_labels)[: plant.ninputs - controller.noutputs])
    renamed.set_outputs(list(plant.output_labels)[: plant.noutputs - controller.ninputs])
    renamed.name = f"{plant.name}_closed"
    return renamed
