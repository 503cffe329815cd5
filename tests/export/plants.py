"""Mechanisms that the tests of the exporters share."""

from functools import cache

import numpy as np

import mbsvib as mv
from mbsvib import library

INERTIA = (1.0, 1.0, 1.0)


@cache
def stewart():
    return library.stewart(ports="all").linearize()


def stiff_model():
    """Two masses whose joints' stiffness is 1e2 and 1e14: A holds entries of 1 and of 2e14."""
    model = mv.Model("stiff")
    model.add_body("a", 1.0, INERTIA, (0, 0, 1))
    model.add_body("b", 1.0, INERTIA, (0, 0, 2))
    model.add_joint("ja", "prismatic", "ground", "a", axis=(0, 0, 1))
    model.add_joint("jb", "prismatic", "a", "b", axis=(0, 0, 1))
    model.add_spring("ka", "ground", "a", start=(0, 0, 0), end=(0, 0, 1), stiffness=1e2, damping=0.02)
    model.add_spring("kb", "a", "b", start=(0, 0, 1), end=(0, 0, 2), stiffness=1e14, damping=1e4)
    model.add_input("F", "b", "z")
    model.add_output("z", "b", "z")
    model.add_output("stretch", "b", "z", relative_to="a")
    model.add_output("acceleration", "b", "z", quantity="acceleration")
    return model


def slider(inputs=("F",), outputs=("z",), name="slider", locked=False, stiffness=1e4):
    """One mass of 2 kg on a spring and a damper of 3 N s/m, with ports of any names."""
    model = mv.Model(name)
    model.add_body("mass", 2.0, INERTIA, (0, 0, 1))
    model.add_joint("guide", "fixed" if locked else "prismatic", "ground", "mass", (0, 0, 0))
    model.add_spring("k", "ground", "mass", start=(0, 0, 0), end=(0, 0, 1), stiffness=stiffness, damping=3.0)
    for port in inputs:
        model.add_input(port, "mass", "z")
    for port in outputs:
        model.add_output(port, "mass", "z")
    return model.linearize()


def block_error(response, truth, system):
    """Largest relative error of the response, block by block of outputs and inputs of the same units."""
    worst = 0.0
    for output in set(system.output_units):
        rows = [i for i, unit in enumerate(system.output_units) if unit == output]
        for given in set(system.input_units):
            block = np.ix_(rows, [i for i, unit in enumerate(system.input_units) if unit == given])
            size = np.linalg.norm(truth[block], axis=(0, 1))
            worst = max(worst, np.max(np.linalg.norm((response - truth)[block], axis=(0, 1)) / size))
    return worst


def resonances(system):
    """Damped angular frequencies of the three lowest modes and of the highest."""
    return 2 * np.pi * np.unique(system.modes().damped_frequencies)[[0, 1, 2, -1] if system.dof > 3 else slice(None)]


def same_bits(first, second):
    """Whether two arrays agree in shape and in every bit, signs of zeros among them."""
    return first.shape == second.shape and first.dtype == second.dtype and first.tobytes() == second.tobytes()
