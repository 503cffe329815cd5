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


def at_a_pole():
    model = mv.Model("slide")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b")
    model.add_bushing("k", "ground", "b", (0, 0, 0), (0, 0, 4.0, 0, 0, 0))
    model.add_input("F", "b", "z")
    model.add_output("x", "b", "z")
    return model.linearize().frequency_response_sensitivities([1.0, 2.0], "b.mass")


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
    (lambda: isolation.collocation(isolation.actuated(HEXAPOD, "platform"), []), r"no pairs; give at least one"),
    (lambda: isolation.study(HEXAPOD, "platform", frequencies=[1.0]).under({"z": -1.0}), r"level = -1; expected a"),
    (lambda: isolation.struts(legless(), "top"), r"struts: model 'table' has no line springs"),
    (on_the_axis, r"ring: start of leg 'leg' is on the axis, and has no direction to move in"),
    (lambda: studies.largest(), r"largest: quantities = \(\); expected at least one quantity"),
    (lambda: studies.placement({1: -3.0}), r"frequencies \[Hz\] above 0"),
    (lambda: studies.gain("a", "b", ["high"]), r"gain: frequencies = \['high'\]; expected frequencies \[Hz\]"),
    (lambda: studies.frequency(1) + "heavy", r"quantity: value = 'heavy'; expected a quantity or numbers"),
    (lambda: studies.frequency(1) + np.nan, r"expected a quantity or finite numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("ask", "message"), REFUSALS, ids=[told[:30] for _, told in REFUSALS])
def test_refusals_are_told(ask, message):
    with pytest.raises(mv.MbsvibError, match=message):
        ask()
