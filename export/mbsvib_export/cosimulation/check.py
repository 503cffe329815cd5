"""A plant and a controller as FMUs, co-simulated by several masters and compared with the loop as one system.

The masters run the FMUs themselves with the same steps as in ``masters``, as calls of FMI.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mbsvib.common.arguments import known
from mbsvib.common.arrays import Array
from mbsvib.common.expected import names, one_of, reals
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib.linalg.discrete import first_order_hold
from mbsvib_export.cosimulation.connections import SIDES, by_names, connect, refuse_algebraic_loop
from mbsvib_export.cosimulation.masters import MASTERS, Loop, is_stable, largest_stable_step, loop_of, radius, within
from mbsvib_export.cosimulation.result import CosimulationCheck, MasterCheck
from mbsvib_export.cosimulation.unit import Instance, Signal, UnitFile, equations, open_unit
from mbsvib_export.sampling import check_step

Side = tuple[Instance, slice, slice]


_MOST = 500  # iterations of a step
# Outputs meet when they change by the first share of their size, or by no more than the second and not less than in so
# many iterations before: what is left is rounding of the states, which outputs may magnify.
_MET, _ROUNDING, _WITHOUT_PROGRESS = 1e-14, 1e-8, 10


def run(method: str, units: Sequence[UnitFile], loop: Loop, x: Array, e: Array, count: int) -> tuple[Array, Array]:
    """Return what a master makes of FMUs: outputs (count + 1, o) at all times, inputs (count, i) in mid-steps."""
    sides: list[Side] = []
    with ExitStack() as stack:
        i = o = 0
        for unit in units:
            instance = Instance(unit, "cs", method in ("slopes", "iteration"))
            stack.callback(instance.fmu.freeInstance)
            sides.append((instance, slice(i, i + len(unit.inputs)), slice(o, o + len(unit.outputs))))
            i, o = sides[-1][1].stop, sides[-1][2].stop
        try:
            return _run(method, sides, loop, x, e, count)
        except ExportError:
            raise
        except Exception as error:
            text = "; ".join(dict.fromkeys(text for side in sides for text in side[0].log[-3:]))
            raise ExportError(f"check_cosimulation: {', '.join(unit.path.name for unit in units)}, {method}: {error} "
                              f"{text}".strip()) from error  # fmt: skip


def _run(method: str, sides: list[Side], loop: Loop, x: Array, e: Array, count: int) -> tuple[Array, Array]:
    held = loop.outside @ e
    starts = iter(x)
    for instance, _, _ in sides:
        instance.enter()
        instance.set_states([next(starts, 0.0) for _ in instance.unit.states])
    y = np.zeros(len(loop.C))
    for _ in range(len(y) + 1):  # feedthrough converges, as there is no algebraic loop
        before = y.copy()
        for instance, into, out in sides:
            instance.set((loop.coupling @ y + held)[into])
            y[out] = instance.get()
        if np.array_equal(before, y):
            break
    for instance, _, _ in sides:
        instance.fmu.exitInitializationMode()
    rows, middles = [y], []
    for i in range(count):
        t, y, u = i * loop.h, y.copy(), loop.coupling @ y + held
        slope = np.zeros(len(u))
        if method == "slopes":
            slope = loop.coupling @ np.concatenate([instance.output_slopes() for instance, _, _ in sides])
        if method == "iteration":
            slope, y = _iterated(sides, loop, t, u, y)
        middles.append(u + loop.h / 2 * slope)
        for instance, into, out in sides if method != "iteration" else ():
            y[out] = instance.stepped(t, loop.h, u[into], slope[into] if method == "slopes" else None)
            if method == "gauss-seidel":
                u = loop.coupling @ y + held
        rows.append(y)
    return np.array(rows), np.array(middles)


def _iterated(sides: list[Side], loop: Loop, t: float, u: Array, y: Array) -> tuple[Array, Array]:
    """Slopes of inputs and outputs at the end of a step, repeated until the controller's outputs are those assumed."""
    saved = [instance.fmu.getFMUState() for instance, _, _ in sides]
    controller = sides[-1][2]
    try:
        guess, least, since = y.copy(), np.inf, 0
        for number in range(_MOST):
            before = guess[controller].copy()
            for (instance, into, out), state in zip(sides, saved, strict=True):
                if number:
                    instance.fmu.setFMUState(state)
                slope = loop.coupling @ (guess - y) / loop.h
                guess[out] = instance.stepped(t, loop.h, u[into], slope[into])
            change = np.abs(guess[controller] - before).max(initial=0.0)
            size = max(np.abs(guess[controller]).max(initial=0.0), np.abs(y[controller]).max(initial=0.0))
            least, since = (change, 0) if change < least else (least, since + 1)
            if change <= _MET * size or (since >= _WITHOUT_PROGRESS and change <= _ROUNDING * size):
                return slope, guess
    finally:
        for (instance, _, _), state in zip(sides, saved, strict=True):
            instance.fmu.freeFMUState(state)
    raise ExportError(f"check_cosimulation: iteration: the step at {t:g} s does not converge in {_MOST} iterations; "
                      f"take a smaller step.")  # fmt: skip


_STEPS = 256  # of the first size, where no duration is given
_HALVED = (1, 2, 4)
_TOO_MUCH = 1e6  # growth up to which an unstable master is followed
# Differences of an output are measured by this share of the largest output of its unit at least: the rounding of terms
# that cancel is 1e-13 of that after a thousand steps.
_CANCELLED = 1e-3
_FLOOR = 1e-9  # outputs below this share of the largest of their unit are measured by that


def check_cosimulation(
    plant: Any, controller: Any, step: float, *, masters: Names = None,
    connections: Mapping[str, str | None] | None = None, excitation: Mapping[str, float] | None = None,
    duration: float | None = None, bonds: Mapping[str, str] | None = None, systems: Mapping[str, Any] | None = None,
) -> CosimulationCheck:  # fmt: skip
    """Co-simulate a plant and a controller as FMUs, and compare the result with that of the loop as one system.

    Names, units and connections are checked first, and algebraic loops are refused. Then, for each master and for the
    steps H, H/2 and H/4, the FMUs are compared with a reference: the same steps in numpy on exactly discretised
    equations (1e-9 passes, 1e-12 is usual). The plant's outputs are compared with those of the closed loop, which gives
    error and order. The spectral radius of the discrete loop gives the largest
    step such that it and all shorter ones are stable. All inputs that are not
    connected step to 1 at the beginning; if there is none, states start at their nominal values.

    Parameters
    ----------
    plant, controller : path, System, StateSpace, SystemData or control.StateSpace
        FMU files, FMI 2.0 or 3.0 with co-simulation; systems are exported first. Signals of the same name are
        connected.
    step : float
        Communication step H [s].
    masters : str or sequence of str, optional
        "jacobi" (both step in parallel, as most tools do), "gauss-seidel" (plant first), "slopes" (linear
        extrapolation of inputs) and "iteration" (steps repeated until outputs and inputs agree). Default: all that
        the FMUs support.
    connections : mapping of str to str, optional
        Output by input, where names differ; None leaves an input free. ``"plant:NAME"`` or ``"controller:NAME"`` where
        both have an input of this name.
    excitation : mapping of str to float, optional
        Values of free inputs instead of 1; those that are not named are 0 then.
    duration : float, optional
        Time to simulate [s]. Default: 256 steps H.
    bonds : mapping of str to str, optional
        Displacement (m, rad) by force input of the plant that works on it, for the energy that the coupling generates.
    systems : mapping of str to System, StateSpace, SystemData or control.StateSpace, optional
        The equations of ``"plant"`` or ``"controller"``, with its inputs and outputs by name. They are needed for an
        FMU without model exchange that lists no states; others state them.

    Returns
    -------
    CosimulationCheck
        Errors, orders, largest stable steps; a table by ``print``, a figure by ``plot()``.

    Raises
    ------
    ExportError
        If an FMU cannot be read or run, is not linear, units or names do not fit, or there is an algebraic loop.
    """
    check_step(step, "check_cosimulation")
    if duration is not None:
        check_step(duration, "check_cosimulation", "duration")
    h, count = float(step), _STEPS if duration is None else max(round(duration / step), 1)
    given = by_names(systems, "check_cosimulation", "systems", "a mapping {'plant' or 'controller': system}")
    for word in given:
        one_of(word, SIDES, "check_cosimulation", "a key of systems", ExportError)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="mbsvib-")))
        units = [stack.enter_context(open_unit(as_file(source, folder / f"{side}.fmu"), "check_cosimulation"))
                 for side, source in zip(SIDES, (plant, controller), strict=True)]  # fmt: skip
        links = connect(units, connections, "check_cosimulation")
        methods, remarks = _able(masters, units)
        numbers = [_equations(side, unit, given.get(side), folder)
                   for side, unit in zip(SIDES, units, strict=True)]  # fmt: skip
        refuse_algebraic_loop(units, links, [d for _, _, _, d in numbers])
        make = partial(loop_of, numbers, links.coupling, links.outside)
        a = make(h).monolithic()[0]
        growth = float(np.linalg.eigvals(a).real.max(initial=-np.inf)) if np.isfinite(a).all() else np.inf
        if growth * h * count > 1e-6:
            remarks.append(f"The closed loop itself is unstable: a pole at {growth:.3g} 1/s.")
        inputs = [signal for unit in units for signal in unit.inputs]
        values = _excited([inputs[i].name for i in links.free], excitation)
        e = np.array(list(values.values()))
        x = np.zeros(len(a))
        if not e.any():
            x = _nominal(units)
            if len(x) != len(a):
                raise ExportError("check_cosimulation: excitation: no free input is excited, and an FMU lists no "
                                  "states that could start elsewhere than at rest; leave an input free, and excite it.")
            remarks.append("No free input is excited: states start at their nominal values.")
        work = _bonds(units[0], bonds)
        checked = tuple(_check(method, units, make, h, count, x, e, growth, work) for method in methods)
        return CosimulationCheck(units[0].name, units[1].name, h, h * count, links.notes, values, growth, checked,
                                 tuple(remarks))  # fmt: skip


def as_file(source: Any, path: Path, version: str = "3.0") -> Path:
    """Return the path of an FMU, which is written there if the source is not a file."""
    if isinstance(source, (str, os.PathLike)):
        return Path(source)
    from mbsvib_export.fmu_ import to_fmu

    return to_fmu(source, path, version).path


def _equations(word: str, unit: UnitFile, system: Any, folder: Path) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D of an FMU: those of the system that is given for it, or what its binary answers."""
    if system is None:
        if unit.hides_states:
            raise ExportError(f"{unit.path}: '{unit.name}' is for co-simulation only and lists no states, so that "
                              f"there is nothing to compare with; give its equations: systems={{'{word}': system}}.")
        return equations(unit)
    with open_unit(as_file(system, folder / f"{word}_system.fmu"), "check_cosimulation") as other:
        a, b, c, d = equations(other)
        columns, rows = (_by_name(word, kind, getattr(unit, kind), getattr(other, kind))
                         for kind in ("inputs", "outputs"))  # fmt: skip
        return a, b[:, columns], c[rows], d[np.ix_(rows, columns)]


def _by_name(word: str, kind: str, signals: Sequence[Signal], given: Sequence[Signal]) -> list[int]:
    """Numbers of the signals of an FMU among those of the system that is given for it."""
    names = [signal.name for signal in given]
    for signal in signals:
        known(signal.name, names, f"check_cosimulation: systems['{word}'] has no '{signal.name}' among its {kind}, "
              f"which the FMU has", None, "The system has", ExportError)  # fmt: skip
    return [names.index(signal.name) for signal in signals]


def _able(masters: Names, units: list[UnitFile]) -> tuple[list[str], list[str]]:
    """Masters that the FMUs support, and remarks on those that they do not."""
    requested = list(MASTERS) if masters is None else names(masters, "check_cosimulation", "masters", ExportError)
    for master in requested:
        one_of(master, MASTERS, "check_cosimulation", "one of masters", ExportError)
    unavailable: dict[str, str] = {}
    for unit in units:
        able = unit.description.coSimulation
        if able is None:
            raise ExportError(f"{unit.path}: does not support co-simulation; export it with to_fmu, which supports it.")
        sloped = able.providesIntermediateUpdate if unit.new else able.canInterpolateInputs
        if not sloped:
            reason = f"'{unit.name}' takes no inputs that vary within a step"
            unavailable |= dict.fromkeys(("slopes", "iteration"), reason)
            continue
        if not able.maxOutputDerivativeOrder:
            unavailable["slopes"] = f"'{unit.name}' gives no derivatives of outputs"
        if not able.canGetAndSetFMUstate:
            unavailable["iteration"] = f"'{unit.name}' does not support repeated steps"
    for method, why in unavailable.items():
        if method in requested and masters is not None:
            raise ExportError(f"check_cosimulation: masters: '{method}' is not possible, as {why}.")
    return ([master for master in requested if master not in unavailable],
            [f"Left out: {method}, as {why}." for method, why in unavailable.items()
             if method in requested])  # fmt: skip


def _excited(names: list[str], inputs: Mapping[str, float] | None) -> dict[str, float]:
    """Values of the free inputs by their names."""
    wanted = by_names(inputs, "check_cosimulation", "excitation", "a mapping {input: number}")
    for name in wanted:
        known(name, names, f"check_cosimulation: excitation: '{name}' is not a free input", None, "These are free:",
              ExportError)  # fmt: skip
    numbers = reals([1.0 if inputs is None else wanted.get(name, 0.0) for name in names], "check_cosimulation",
                    "excitation", "a mapping {input: number}", ExportError)  # fmt: skip
    if not np.isfinite(numbers).all():
        raise ExportError("check_cosimulation: excitation holds NaN or infinity; expected finite numbers.")
    return dict(zip(names, numbers.tolist(), strict=True))


def _nominal(units: list[UnitFile]) -> Array:
    by_reference = [{v.valueReference: v.nominal for v in unit.description.modelVariables} for unit in units]
    return np.array([float(nominal[state.reference] or 1.0)
                     for unit, nominal in zip(units, by_reference, strict=True) for state in unit.states])  # fmt: skip


def _bonds(plant: UnitFile, pairs: Mapping[str, str] | None) -> list[tuple[int, int]]:
    inputs, outputs = [signal.name for signal in plant.inputs], [signal.name for signal in plant.outputs]
    listed = by_names(pairs, "check_cosimulation", "bonds", "a mapping {input: displacement}")
    for force, motion in listed.items():
        for name, has in ((force, inputs), (motion, outputs)):
            known(name, has, f"check_cosimulation: bonds: the plant has no '{name}'; expected an input by an output "
                  f"of it", error=ExportError)  # fmt: skip
        unit = plant.outputs[outputs.index(motion)].unit
        if unit not in ("", "m", "rad"):
            raise ExportError(f"check_cosimulation: bonds: '{motion}' is in {unit}; expected a displacement in m or "
                              f"an angle in rad.")  # fmt: skip
    return [(inputs.index(force), outputs.index(motion)) for force, motion in listed.items()]


def _check(
    method: str, units: list[UnitFile], make: Callable[[float], Loop], h: float, count: int, x: Array, e: Array,
    growth: float, work: list[tuple[int, int]],
) -> MasterCheck:  # fmt: skip
    signals = (*units[0].outputs, *units[1].outputs)
    groups = [signal.unit or side for side, unit in zip(SIDES, units, strict=True) for signal in unit.outputs]
    plant = len(units[0].outputs)  # some masters return controller outputs ahead of time: only the plant's are compared
    steps, errors, difference, worst, energy = [], [], 0.0, "", float("nan")
    first = radius(make(h), method)
    for divisor in _HALVED:
        loop, number = make(h / divisor), count * divisor
        grows = radius(loop, method)
        # an unstable run is stopped once it has grown; iteration is skipped if it diverges
        completed = number if grows <= 1.0 else int(min(number, np.log(_TOO_MUCH) / np.log(grows)))
        steps.append(h / divisor)
        if completed == 0 or (method == "iteration" and not is_stable(grows, growth, loop.h)):
            errors.append(float("inf"))
            continue
        rows, middles = run(method, units, loop, x, e, completed)
        truth = _reference(loop, x, e, number)
        same = _simulated(method, loop, x, e, completed)
        difference = max(difference, float(_relative(rows, same, same, groups, _CANCELLED).max(initial=0.0)))
        relative = _relative(rows, truth[: completed + 1], truth, groups, _FLOOR)[:plant]
        errors.append(float(relative.max(initial=0.0)))
        if not worst and len(relative):
            worst = signals[int(relative.argmax())].name
        if divisor == 1 and work:
            energy = _generated_energy(rows, middles, loop, work, e)
    largest = largest_stable_step(make, method, h, growth)
    stable = is_stable(first, growth, h) and within(h, largest)
    return MasterCheck(method, tuple(steps), tuple(errors), worst, difference, first, stable, largest, energy)


def _reference(loop: Loop, x: Array, e: Array, count: int) -> Array:
    """Outputs of the closed loop as one system, at all steps."""
    a, b, c, d = loop.monolithic()
    phi, held, _ = first_order_hold(a, (b @ e)[:, None], loop.h)
    states = [x]
    for _ in range(count):
        states.append(phi @ states[-1] + held[:, 0])
    return np.asarray(states @ c.T + d @ e)


def _simulated(method: str, loop: Loop, x: Array, e: Array, count: int) -> Array:
    """Outputs of the same master in numpy."""
    rows = [loop.start(x, e, method == "slopes")]
    for _ in range(count):
        rows.append(loop.step(method, rows[-1], e))
    return np.array(rows)[:, len(loop.A) : len(loop.A) + len(loop.C)]


def _relative(actual: Array, truth: Array, scale: Array, groups: list[str], share: float) -> Array:
    """Largest error of each output relative to its size, at least that share of the largest of its unit."""
    size = np.abs(scale).max(axis=0, initial=0.0)
    floor = np.array([max(size[i] for i, name in enumerate(groups) if name == group) for group in groups])
    size = np.maximum(size, share * floor)
    return np.asarray(np.abs(actual - truth).max(axis=0) / np.where(size > 0, size, 1.0))


def _generated_energy(rows: Array, middles: Array, loop: Loop, work: list[tuple[int, int]], e: Array) -> float:
    """Energy error of the coupling: work of the plant's inputs minus work of the controller's outputs."""
    into, onto = [column[0] for column in work], [column[1] for column in work]
    forces = (rows @ loop.coupling.T + loop.outside @ e)[:, into]
    displacements = np.diff(rows[:, onto], axis=0)
    expected = (forces[1:] + forces[:-1]) / 2 * displacements
    through = float(np.abs(expected).sum())
    return float((middles[:, into] * displacements - expected).sum() / through) if through else float("nan")
