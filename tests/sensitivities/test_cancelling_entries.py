"""Derivatives by differences where entries of the matrices cancel: a coupler that never turns, in a plane at a slant.

Shifts of pins along their axes change nothing; what rounding leaves of rows and columns is no reason to refuse them.
"""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.linalg.differences import slope
from mbsvib.sensitivities.variables import Direction
from mbsvib.sensitivities.variants import Variants

NORMAL = np.array((1.0, 2.0, 2.0)) / 3.0
ACROSS = np.cross(NORMAL, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(NORMAL, (0.0, 0.0, 1.0)))
TURN = (0.0, 0.0, 0.0, *NORMAL)


def parallelogram(spring="low", output=None, force=None, inputs="push", gravity=None):
    model = mv.Model("parallelogram", gravity=gravity)
    pins = [x * ACROSS + y * np.cross(NORMAL, ACROSS) for x, y in ((0, 0), (0.3, 0.7), (1.3, 0.9), (1.0, 0.2))]
    bodies = ("ground", "low", "coupler", "high", "ground")
    for name, start, end in zip(bodies[1:4], pins, pins[1:], strict=False):
        model.add_body(name, 1.0, (0.1, 0.2, 0.3), position=0.5 * (start + end))
    for k, pin in enumerate(pins):
        model.add_joint(f"pin{k}", "revolute", bodies[k], bodies[k + 1], position=pin, axis=NORMAL)
    model.add_bushing("spring", "ground", spring, pins[0], (0, 0, 0, 50, 60, 70), damping=(0, 0, 0, 1, 2, 3))
    if inputs == "push":
        model.add_input("push", "coupler", tuple(ACROSS))
    elif inputs == "turn":
        model.add_input("turn", "coupler", TURN)
    else:
        model.add_base_motion("base", tuple(NORMAL))
    if output:
        model.add_output("turned", "coupler", TURN, quantity=output)
    if force:
        model.add_force_output("moment", force, "rz")
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("case", [
    {"output": "displacement"}, {"output": "velocity"}, {"output": "acceleration"}, {"inputs": "turn"},
    {"inputs": "base"}, {"spring": "coupler", "force": "spring"},
], ids=str)  # fmt: skip
def test_shifts_along_the_axes_of_pins_change_nothing(case):
    system = parallelogram(**case).linearize()
    variants, largest = Variants(system), max(1.0, float(np.abs(system.K).max()))
    for k in range(3):
        shift = Direction("shift", tuple((f"pin{k}.position.{axis}", float(share))
                                         for axis, share in zip("xyz", NORMAL, strict=True)))  # fmt: skip
        assert all(np.abs(change).max(initial=0.0) < 1e-10 * largest for change in variants.slopes([shift]).values())


@pytest.mark.slow
def test_a_spring_that_never_strains():
    """Its stiffness k turn^2 vanishes with the turn of the coupler, and so do all first derivatives of it."""
    variants = Variants(parallelogram(spring="coupler", force="spring").linearize())
    names = [f"pin{k}.position.{axis}" for k in range(4) for axis in "xyz"]
    slopes = variants.slopes([Direction(name, ((name, 1.0),)) for name in names])
    assert max(np.abs(slopes["K"]).max(), np.abs(slopes["C"]).max()) < 1e-9
    assert np.abs(slopes["Cq"]).max() > 10.0


@pytest.mark.slow
def test_what_cancels_may_change():
    """The coupler turns as soon as its pins are no parallelogram: -1 + 1 becomes a derivative of its own size.

    An upright mast in a field of gravity lets all parameters act by differences.
    """
    model = parallelogram(output="displacement", gravity=tuple(-1e-3 * NORMAL))
    model.add_beam("mast", "ground", None, start=(5, 0, 0), end=(5, 0, 0.5), elements=1,
                   section={"type": "circle", "radius": 0.02}, material={"E": 1e9, "nu": 0.3, "rho": 1000.0})
    system = model.linearize()
    directions = {name: {f"pin1.position.{axis}": float(share) for axis, share in zip("xyz", way, strict=True)}
                  for name, way in (("along", NORMAL), ("across", ACROSS))}  # fmt: skip
    result = system.matrix_derivatives(directions).Cq[:, 0, 0]

    def at(change):
        values = {name: model.parameters[name] + change * rate for name, rate in directions["across"].items()}
        return model.with_values(values).linearize(independent=system.coordinates).Cq[0]

    expected = slope(at, 1e-2)[0][0]
    assert abs(expected) > 0.1
    assert result == pytest.approx([0.0, expected], rel=1e-9, abs=1e-9)
