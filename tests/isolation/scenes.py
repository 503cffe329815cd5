"""Mechanisms of the isolation tests whose figures are known in closed form."""

import numpy as np

import mbsvib as mv
from mbsvib import library

MASS, FREQUENCY, RATIO = 12.0, 5.0, 0.03
OMEGA = 2 * np.pi * FREQUENCY


def one_axis(ratio=RATIO, frequency=FREQUENCY, mass=MASS):
    """A payload on a guided spring-damper."""
    w = 2 * np.pi * frequency
    model = mv.Model("one axis")
    model.add_body("payload", mass, (0.2, 0.2, 0.2), (0, 0, 0.3))
    model.add_joint("guide", "prismatic", "ground", "payload", axis=(0, 0, 1))
    model.add_spring("mount", "ground", "payload", (0, 0, 0), (0, 0, 0.2), mass * w * w, 2 * ratio * w * mass)
    return model


def stiff_isolator(**values):
    """A Stewart isolator on stiff legs, hardly damped: platform modes far above those of its spinning legs."""
    stiff = {"leg_stiffness": 20e6, "leg_damping": 20.0, "payload_mass": 1.0, "torsion_damping": 5e-5}
    return library.stewart_isolator(**stiff | values)


def two_masses(m1=4.0, m2=9.0, k1=3e4, k2=1e4, c1=20.0, c2=35.0):
    """A payload 2 on a stage 1 on the ground."""
    model = mv.Model("two masses")
    model.add_body("stage", m1, (0.1, 0.1, 0.1), (0, 0, 0.2))
    model.add_body("payload", m2, (0.1, 0.1, 0.1), (0, 0, 0.5))
    model.add_joint("low", "prismatic", "ground", "stage", axis=(0, 0, 1))
    model.add_joint("high", "prismatic", "stage", "payload", axis=(0, 0, 1))
    model.add_spring("lower", "ground", "stage", (0, 0, 0), (0, 0, 0.2), k1, c1)
    model.add_spring("upper", "stage", "payload", (0, 0, 0.2), (0, 0, 0.5), k2, c2)
    return model


def active_strut(leg=9e4, beside=3e4, mass=MASS, damping=0.0, turned=False):
    """A payload on a leg with an actuator, with a soft spring beside it: force feedback has the zero sqrt(beside/m)."""
    model = mv.Model("strut")
    model.add_body("payload", mass, (0.2, 0.2, 0.2), (0, 0, 0.3))
    model.add_joint("guide", "prismatic", "ground", "payload", axis=(0, 0, 1))
    ends = ("payload", "ground", (0, 0, 0.2), (0, 0, 0)) if turned else ("ground", "payload", (0, 0, 0), (0, 0, 0.2))
    model.add_spring("leg", *ends, leg, damping)
    model.add_spring("beside", "ground", "payload", (0.1, 0, 0), (0.1, 0, 0.2), beside)
    return model


def relaxing_hexapod():
    """The cubic hexapod with Maxwell elements as legs."""
    model = library.cubic_hexapod(damping=0.0)
    legs = list(model.springs.values())
    model = model.with_parts(springs={})
    for leg in legs:
        model.add_maxwell(leg.name, leg.first, leg.second, leg.start, leg.end, 3e6, 2000.0, 1e6)
    return model
