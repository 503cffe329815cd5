"""Refusals that no other test reaches: each names what was given and what to do."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library, studies
from mbsvib.beams import Circle, Rectangle, Section, Tube
from tests.support.arm import arm

HEXAPOD = library.cubic_hexapod()


def wheel(**words):
    """A body that itself spins on a shaft."""
    model = mv.Model("wheel")
    model.add_body("rotor", 2.0, (0.1, 0.1, 0.2))
    model.add_joint("shaft", "free", "ground", "rotor", (0, 0, 0))
    model.add_bushing("k", "ground", "rotor", (0, 0, 0), (1e3, 1e3, 1e3, 10, 10, 0))
    model.add_rotor("spin", "rotor", 50.0, (0, 0, 1), **words)
    return model


def spun_twice():
    model = wheel()
    model.add_rotor("again", "rotor", 5.0, (0, 0, 1))
    return model.linearize()


def spun_point():
    model = mv.Model("point")
    model.add_body("rotor", 2.0, (0, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "rotor", axis=(1, 0, 0))
    model.add_rotor("spin", "rotor", 50.0, (0, 0, 1))
    return model.linearize()


def spun_maxwell():
    model = wheel()
    model.add_maxwell("mx", "ground", "rotor", (0, 0, -1), (0, 0, 0), 10.0, 1.0)
    return model.linearize()


def turned_ground():
    model = wheel(inertia=0.1)
    model.add_base_motion("floor", "rz", (0, 0, 0))
    return model.linearize()


def slide(damping):
    model = mv.Model("slide")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b")
    model.add_spring("k", "ground", "b", (0, 0, -1), (0, 0, 0), 4.0, damping)
    model.add_input("F", "b", "z")
    model.add_output("x", "b", "z")
    return model.linearize()


def at_a_pole():
    return slide(0.0).frequency_response_sensitivities([1.0, 2.0], "b.mass")


def closed():
    return slide(0.1).feedback([[-1.0]], "x", "F")


def legless(body="top"):
    model = mv.Model("table")
    model.add_body(body, 25.0, (0.8, 0.9, 1.5), position=(0, 0, 0.4))
    model.add_bushing("mount", "ground", body, (0, 0, 0), (1e3,) * 6)
    return model


def on_the_axis():
    model = legless()
    model.add_spring("leg", "ground", "top", (0, 0, 0), (0.1, 0, 0.3), stiffness=1e4)
    return isolation.ring(model, "start", legs=["leg"])


def noise(**words):
    study = isolation.study(HEXAPOD, "platform", directions=("x", "y"), frequencies=[1.0, 10.0])
    return study.under(**words)


def complex_quantity() -> object:
    pole = studies.given(lambda system, _: (system.poles()[:1], 0.0), "pole")
    return studies.optimize(mv.library.quarter_car(), {"suspension.damping": (500.0, 5e3)}, pole)


REFUSALS = [
    (lambda: Tube(0.1, 0.2), r"wall = 0.2; expected at most the outer radius 0.1 m"),
    (lambda: Circle(0.0), r"circle: radius = 0.*positive"),
    (lambda: Rectangle(0.1, -0.2), r"rectangle: height = -0.2.*positive"),
    (lambda: Section(1.0, -1.0, 1.0, 1.0), r"section: Iy = -1.*positive"),
    (lambda: arm().add_body("c", 1.0, ((1, 0, 0), (0, 1, 0))), r"inertia"),
    (spun_twice, r"rotor 'again': body 'rotor' spins already; add the speeds up"),
    (spun_point, r"rotor 'spin': body 'rotor' has no inertia that could spin"),
    (spun_maxwell, r"rotor 'spin': 'mx'.*a Maxwell element"),
    (turned_ground, r"base motion 'floor' turns the ground.*rotor 'spin'"),
    (at_a_pole, r"omega\[1\] = 2 rad/s is a pole of 'slide'"),
    (lambda: isolation.collocation(isolation.actuated(HEXAPOD, "platform"), []), r"pairs = \[\]; expected one"),
    (lambda: isolation.study(HEXAPOD, "platform", frequencies=[1.0]).under({"z": -1.0}), r"level = -1\.0; expected a"),
    (lambda: isolation.struts(legless(), "top"), r"struts: model 'table' has no line springs"),
    (on_the_axis, r"ring: start of leg 'leg' is on the axis, and has no direction to move in"),
    (lambda: studies.largest(), r"largest: quantities = \(\); expected at least one quantity"),
    (lambda: studies.placement({1: -3.0}), r"frequencies \[Hz\] above 0"),
    (lambda: studies.gain("a", "b", ["high"]), r"gain: frequencies = \['high'\]; expected frequencies \[Hz\]"),
    (lambda: studies.gain("a", "b", np.array([1j])), r"gain: frequencies = \[1j\]; expected.* Complex ones"),
    (lambda: studies.frequency(1) + np.array([1j]), r"quantity: value = \[1j\]; .*Complex ones are r"),
    (lambda: isolation.study(HEXAPOD, "platform", frequencies=np.array([1j])), r"from 0 on, .*\. Complex ones"),
    (lambda: closed().loop_gain(np.array([1j])), r"loop_gain: omega = \[1j\]; .*give omega, not 1j \* omega"),
    (lambda: closed().sensitivity(np.array([1j])), r"sensitivity: omega = \[1j\]; .*give omega, not 1j \* omega"),
    (lambda: isolation.shaped([1.0], [1.0, 1.0], "1_0"),  # type: ignore[arg-type]
     r"level = '1_0'; expected a density"),
    (lambda: closed().time_response([0.0, 1.0], [[0.0, 1.0]], hold=np.zeros(2)), r"hold = .*; expected 'zero'"),
    (lambda: isolation.ring(HEXAPOD, np.zeros(2)), r"ring: end = \[0\.0, 0\.0\]; expected 'start' or 'end'"),  # type: ignore[arg-type]
    (lambda: isolation.table([(1.0, 1.0), (2.0, 1.0)]).at(np.array([1j])), r"density: frequencies = \[1j\]; .*Complex"),
    (lambda: isolation.table([(1.0, 1.0), (2.0, 1.0)]).at(np.array([np.nan * 1j])), "Complex ones are refused"),
    (complex_quantity, r"given: function's value = .*; expected real numbers .* Complex ones are refused"),
    (lambda: studies.frequency(1) + "heavy", r"quantity: value = 'heavy'; expected a quantity or numbers"),
    (lambda: studies.frequency(1) + np.nan, r"expected a quantity or finite numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("ask", "message"), REFUSALS, ids=[told[:30] for _, told in REFUSALS])
def test_refusals_are_told(ask, message):
    with pytest.raises(mv.MbsvibError, match=message):
        ask()
