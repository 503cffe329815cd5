"""A plant and controllers in python-control and as closed forms, for co-simulation."""

import control
import numpy as np

import mbsvib as mv

MASS, STIFFNESS, DAMPING, GAIN, ROLL_OFF = 2.0, 8e3, 4.0, 400.0, 900.0


def plant(quantity="velocity", disturbance=True, name="slider"):
    """m x'' + c x' + k x = F + d, measured: x, x' or x''; x besides."""
    model = mv.Model(name)
    model.add_body("mass", MASS, (1.0, 1.0, 1.0))
    model.add_joint("guide", "prismatic", "ground", "mass", axis=(0, 0, 1))
    model.add_spring("k", "ground", "mass", start=(0, 0, -1), end=(0, 0, 0), stiffness=STIFFNESS, damping=DAMPING)
    model.add_input("F", "mass", "z")
    if disturbance:
        model.add_input("d", "mass", "z")
    model.add_output("y", "mass", "z", quantity=quantity)
    model.add_output("z", "mass", "z")
    return model.linearize()


def controller(gain, through=0.0, inputs=("y",), outputs=("F",), name="law"):
    """F = (gain / (s / w + 1) + through) y, of the first of the inputs."""
    more = [0.0] * (len(inputs) - 1)
    return control.ss(
        [[-ROLL_OFF]], [[1.0, *more]], [[gain * ROLL_OFF]], [[through, *more]], inputs=list(inputs),
        outputs=list(outputs), name=name,
    )  # fmt: skip


def speed_feedback():
    """F = -g / (s / w + 1) y: damping, as y is a speed."""
    return controller(-GAIN)


def closed_poles(law):
    """Poles of the closed loop, by python-control alone."""
    mechanics = control.ss([[0, 1], [-STIFFNESS / MASS, -DAMPING / MASS]], [[0], [1 / MASS]], [[0, 1]], [[0]])
    loop = control.feedback(mechanics, law, sign=+1)
    return np.sort_complex(np.asarray(loop.poles()))
