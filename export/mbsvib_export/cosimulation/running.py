"""The masters with the FMUs themselves: the same steps as in ``masters``, as calls of FMI."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ExportError
from mbsvib_export.cosimulation.unit import Instance

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib_export.cosimulation.masters import Loop
    from mbsvib_export.cosimulation.unit_file import UnitFile


_MOST = 500  # iterations of a step
# Outputs meet when they change by the first share of their size, or by no more than the second and not less than in so
# many iterations before: what is left is rounding of the states, which outputs may magnify.
_MET, _ROUNDING, _WITHOUT_PROGRESS = 1e-14, 1e-8, 10


def run(
    method: str, plant: UnitFile, controller: UnitFile, loop: Loop, x: Array, e: Array, count: int
) -> tuple[Array, Array]:
    """Simulate the FMUs of a closed loop with a master.

    ``method``: one of ``MASTERS``. ``loop``: connections and step; its matrices of the FMUs are not used. Returns
    outputs of plant and controller at the beginning and after each step (count + 1, outputs), and the inputs of the
    plant at the middle of each step (count, inputs).
    """
    extrapolate = method in ("slopes", "iteration")
    with ExitStack() as stack:
        units = []
        for unit in (plant, controller):
            units.append(Instance(unit, "cs", extrapolate))
            stack.callback(units[-1].close)
        try:
            return _run(method, units[0], units[1], loop, x, e, count)
        except ExportError:
            raise
        except Exception as error:
            text = "; ".join(dict.fromkeys(units[0].log[-3:] + units[1].log[-3:]))
            raise ExportError(f"check_cosimulation: {plant.path.name} and {controller.path.name}, {method}: {error} "
                              f"{text}".strip()) from error  # fmt: skip


def _run(method: str, p: Instance, k: Instance, loop: Loop, x: Array, e: Array, count: int) -> tuple[Array, Array]:
    n, h = loop.sizes[0], loop.h
    plant_excitation, controller_excitation = loop.plant_free @ e, loop.controller_free @ e
    for instance, states in ((p, x[:n]), (k, x[n:])):
        listed = len(instance.unit.states)
        instance.enter().set_states(states if len(states) == listed else np.zeros(listed))
    y, f = np.zeros(len(p.unit.outputs)), np.zeros(len(k.unit.outputs))
    for _ in range(len(y) + len(f) + 1):  # feedthrough converges, as there is no algebraic loop
        before = y, f
        p.set(loop.actuate @ f + plant_excitation)
        y = p.get()
        k.set(loop.measure @ y + controller_excitation)
        f = k.get()
        if np.array_equal(before[0], y) and np.array_equal(before[1], f):
            break
    p.leave()
    k.leave()
    rows, forces = [np.concatenate((y, f))], []
    for i in range(count):
        t, up, uk = i * h, loop.actuate @ f + plant_excitation, loop.measure @ y + controller_excitation
        if method == "iteration":
            middle, y, f = _iterate(p, k, loop, t, up, uk, y, f)
        elif method == "slopes":
            dy, df = p.output_slopes(), k.output_slopes()
            sp = loop.actuate @ df
            p.set(up)
            k.set(uk)
            p.step(t, h, sp)
            k.step(t, h, loop.measure @ dy)
            middle, y, f = up + h / 2 * sp, p.get(), k.get()
        else:
            p.set(up)
            if method == "jacobi":
                k.set(uk)
            p.step(t, h)
            y = p.get()
            if method == "gauss-seidel":
                k.set(loop.measure @ y + controller_excitation)
            k.step(t, h)
            middle, f = up, k.get()
        rows.append(np.concatenate((y, f)))
        forces.append(middle)
    return np.array(rows), np.array(forces)


def _iterate(
    p: Instance, k: Instance, loop: Loop, t: float, up: Array, uk: Array, y: Array, f: Array
) -> tuple[Array, Array, Array]:
    h = loop.h
    saved = [instance.fmu.getFMUState() for instance in (p, k)]
    try:
        guess, least, since = f, np.inf, 0
        for number in range(_MOST):
            if number:
                for instance, state in zip((p, k), saved, strict=True):
                    instance.fmu.setFMUState(state)
            slope = loop.actuate @ (guess - f) / h
            p.set(up)
            p.step(t, h, slope)
            y1 = p.get()
            k.set(uk)
            k.step(t, h, loop.measure @ (y1 - y) / h)
            outputs = k.get()
            change = np.abs(outputs - guess).max(initial=0.0)
            size = max(np.abs(outputs).max(initial=0.0), np.abs(f).max(initial=0.0))
            least, since = (change, 0) if change < least else (least, since + 1)
            if change <= _MET * size or (since >= _WITHOUT_PROGRESS and change <= _ROUNDING * size):
                return up + h / 2 * slope, y1, outputs
            guess = outputs
    finally:
        for instance, state in zip((p, k), saved, strict=True):
            instance.fmu.freeFMUState(state)
    raise ExportError(f"check_cosimulation: iteration: the step at {t:g} s does not converge in {_MOST} iterations; "
                      f"take a smaller step.")  # fmt: skip
