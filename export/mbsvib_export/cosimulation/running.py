"""The masters with the FMUs themselves: the same steps as in ``masters``, as calls of FMI."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ExportError
from mbsvib_export.cosimulation.unit import Instance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib_export.cosimulation.masters import Loop
    from mbsvib_export.cosimulation.unit import UnitFile

    # an FMU, and which inputs and outputs of the loop are its own
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
