"""Flexures and beams have no first end: exchanged under any load, nothing changes; sensitivities to match."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.elements.test_flexure import STEEL

SHAPES = {
    "leaf": {"type": "leaf", "length": 0.05, "width": 0.02, "thickness": 0.001},
    "notch": {"type": "notch", "radius": 0.01, "width": 0.02, "thickness": 0.0015},
}
LOADS = {"pull": ((20.0, 0, 0), (0, 0, 0)), "shear": ((0, 5.0, -8.0), (0, 0, 0)),
         "moment": ((0, 0, 0), (0.1, 0.05, 0.02)), "all": ((5.0, 7.0, -9.0), (0.1, 0.05, 0.02))}  # fmt: skip
ALONG_X = np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])
SLANTED = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]) @ ALONG_X


def add_leaf(model, name, ends, position, axes, shape, exchanged):
    """A flexure, or a beam of two elements, along the third of the axes, perhaps with its ends exchanged."""
    first, second = ends[::-1] if exchanged else ends
    if shape != "beam":
        axes = axes @ np.diag([-1.0, 1.0, -1.0]) if exchanged else axes
        model.add_flexure(name, first, second, SHAPES[shape], STEEL, position=position, orientation=axes)
        return
    points = [np.array(position) + way * axes[:, 2] for way in (-0.025, 0.025)]
    model.add_beam(name, first, second, start=points[exchanged], end=points[not exchanged], elements=2,
                   y_axis=axes[:, 1], section={"type": "rectangle", "width": 0.02, "height": 0.001},
                   material=STEEL)  # fmt: skip


def stage(load, shape="leaf", exchanged=()):
    """A stage on two leaves at an angle to each other."""
    model = mv.Model("stage", gravity=(0.5, -1.0, -9.81))
    model.add_body("stage", 0.5, (1e-3, 2e-3, 1.5e-3), (0.05, 0.01, 0.02))
    model.add_load("load", "stage", *LOADS[load])
    add_leaf(model, "left", ("ground", "stage"), (0, 0, 0), ALONG_X, shape, "left" in exchanged)
    add_leaf(model, "right", ("ground", "stage"), (0, 0.04, 0.01), SLANTED, shape, "right" in exchanged)
    return model


def arm(load, shape="leaf", exchanged=()):
    """A stage on a leaf, and a tip on another leaf at the stage: statics gives all forces."""
    model = mv.Model("arm", gravity=(0.5, -1.0, -9.81))
    model.add_body("stage", 0.5, (1e-3, 2e-3, 1.5e-3), (0.05, 0.01, 0.02))
    model.add_body("tip", 0.1, (1e-4, 2e-4, 3e-4), (0.12, 0.05, 0.02))
    model.add_load("load", "tip", *LOADS[load])
    add_leaf(model, "left", ("ground", "stage"), (0, 0, 0), ALONG_X, shape, "left" in exchanged)
    add_leaf(model, "right", ("stage", "tip"), (0.08, 0.03, 0.02), SLANTED, shape, "right" in exchanged)
    return model


def eigenvalues(model, method="dense"):
    if method == "sparse":
        return model.linearize(method=method).modes(6, near=0.0).eigenvalues
    return model.linearize().modes().eigenvalues


@pytest.mark.few(2)
@pytest.mark.parametrize("load", list(LOADS))
@pytest.mark.parametrize("shape", ["leaf", "notch", "beam"])
@pytest.mark.parametrize("scene", [stage, arm])
def test_ends_may_be_exchanged(scene, shape, load):
    expected = eigenvalues(scene(load, shape))
    for exchanged in (("left",), ("left", "right")):
        assert_allclose(eigenvalues(scene(load, shape, exchanged)), expected, rtol=1e-12)


def test_ends_of_bent_flexures_may_be_exchanged():
    """In the pose to which loads bend and twist them; displacements are small ones in the frame of the first end."""
    force, torque = 0.1 * np.array(LOADS["all"])
    values = {f"load.{name}.{d}": six[i] for name, six in (("force", force), ("torque", torque))
              for i, d in enumerate("xyz")}  # fmt: skip

    def bent(exchanged):
        model = arm("all", exchanged=exchanged).with_parts(gravity=None).with_values(values)
        return eigenvalues(model.equilibrium())

    assert_allclose(bent(("left", "right")), bent(()), rtol=3e-7)


def test_ends_may_be_exchanged_in_sparse_equations():
    expected = eigenvalues(stage("all"))[:12]
    assert_allclose(eigenvalues(stage("all", exchanged=("left",)), "sparse"), expected, rtol=1e-10)


def sixth(of, step):
    """The slope of a function at zero by central differences of sixth order."""
    one, two, three = (of(k * step) - of(-k * step) for k in (1, 2, 3))
    return (45.0 * one - 9.0 * two + three) / (60.0 * step)


@pytest.mark.few(1)
@pytest.mark.slow
@pytest.mark.parametrize("shape", ["leaf", "beam", "notch"])
@pytest.mark.parametrize("scene", [stage, arm])
def test_sensitivities_under_shear(scene, shape):
    """To all numbers of a flexure, to loads and places, against differences of sixth order of the whole equations."""
    model = scene("all", shape, exchanged=("right",))
    system = model.linearize()
    values = system.parameters
    sizes = {"E": 1e11, "rho": 1e4, "nu": 1.0, "thickness": 1e-3, "height": 1e-3, "width": 0.02, "length": 0.05,
             "radius": 0.01, "position": 0.05, "start": 0.05, "end": 0.05}  # fmt: skip
    names = [name for name in values if name.startswith(("left.", "load.", "stage.mass", "stage.position", "gravity"))
             and not name.endswith(("alpha", "beta", "damping_ratio"))]  # fmt: skip
    assert {"load.force.y", "load.torque.z", "left.E", "gravity.x"} <= set(names)
    result = system.matrix_derivatives(names)
    scale = {key: np.sqrt(np.outer(*2 * [np.diag(getattr(system, key))])) for key in "MK"}
    for k, name in enumerate(names):
        size = next((sizes[field] for field in name.split(".")[1:] if field in sizes), abs(values[name]) or 1.0)

        def of(x, name=name):
            varied = model.with_values({name: values[name] + x}).linearize(independent=system.coordinates)
            return np.array([varied.M / scale["M"], varied.K / scale["K"]])

        slope = size * sixth(of, 1e-3 * size)
        assert_allclose(size * result.M[k] / scale["M"], slope[0], rtol=1e-9, atol=1e-9, err_msg=name)
        assert_allclose(size * result.K[k] / scale["K"], slope[1], rtol=1e-9, atol=1e-9, err_msg=name)
