"""What parameters do to the equations: derivatives against closed forms and the toolbox's own, and what is refused."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library
from mbsvib.equations.matrices import MATRICES
from mbsvib_export.affine import affine
from tests.export.plants import slider, stewart


def test_a_slider():
    result = affine(slider(), ["k.stiffness", "k.damping", "mass.mass"], "test")
    assert result.units == ("N/m", "N s/m", "kg")
    assert result.values.tolist() == [1e4, 3.0, 2.0]
    for i, label in enumerate("KCM"):
        assert result.slopes[label][i] == pytest.approx(np.eye(1), rel=1e-14)
        assert not any(result.slopes[other][i].any() for other in MATRICES if other != label)


def test_a_slider_of_a_picogram():
    """Rounding is judged against the entries: no slope of a micromechanism is lost."""
    model = mv.Model("micro")
    model.add_body("mass", 1e-15, (1e-27, 1e-27, 1e-27), (0, 0, 1e-6))
    model.add_joint("guide", "prismatic", "ground", "mass", (0, 0, 0))
    model.add_spring("k", "ground", "mass", (0, 0, 0), (0, 0, 1e-6), stiffness=1e-9, damping=1e-17)
    result = affine(model.linearize(), ["k.stiffness", "k.damping", "mass.mass"], "test")
    for i, label in enumerate("KCM"):
        assert result.slopes[label][i] == pytest.approx(np.eye(1), rel=1e-14)


def test_derivatives_are_those_of_the_sensitivities():
    names = ("leg1.k.stiffness", "leg2.k.damping", "platform.mass", "platform.inertia.xy")
    result, truth = affine(stewart(), names, "test"), stewart().matrix_derivatives(names)
    for label in MATRICES:
        size = np.abs(getattr(truth, label)).max(axis=(1, 2), keepdims=True)
        assert (np.abs(result.slopes[label] - getattr(truth, label)) <= 1e-10 * size).all(), label


def test_parameters_that_are_zero_now():
    result = affine(library.stewart(leg_damping=0.0).linearize(), ["leg*.k.damping"], "test")
    assert result.slopes["C"] == pytest.approx(affine(stewart(), ["leg*.k.damping"], "test").slopes["C"], abs=1e-12)


def two_sliders():
    model = mv.Model("two")
    for name in "ab":
        model.add_body(name, 2.0, (1, 1, 1), (0, 0, 1))
        model.add_joint(f"{name}.guide", "prismatic", "ground", name, (0, 0, 0))
    model.add_input("F", "a", "z")
    model.add_output("z", "a", "z")
    return model.linearize()


@pytest.mark.parametrize(
    ("make", "name", "message"),
    [
        (stewart, "leg1.head.position.x", r"not affine in it.*in stiffness, damping, mass.*with_values\({'leg1.head"),
        (lambda: library.engine_on_mounts().linearize(), "engine.mass",
         "'engine.mass' cannot be tuned, as changed alone it gives no system: .*unbalanced force on body 'engine'"),
        (lambda: two_sliders().reachable(inputs="F"), "k.stiffness", "not a system that model.linearize"),
    ],
)  # fmt: skip
def test_what_is_refused(make, name, message):
    with pytest.raises(mv.ExportError, match=message):
        affine(make(), [name], "test")


def test_parameters_that_are_affine_alone_and_not_together():
    """A tensioned string across a guide holds with k (L - L0) / L: straight in k and in L0, not in both."""
    model = mv.Model("string")
    model.add_body("mass", 2.0, (1, 1, 1), (0, 0, 1))
    model.add_joint("guide", "prismatic", "ground", "mass", (0, 0, 1), axis=(1, 0, 0))
    model.add_spring("k", "ground", "mass", start=(0, 0, 0), end=(0, 0, 1), stiffness=1e4, free_length=0.9)
    system = model.linearize()
    assert affine(system, ["k.stiffness"], "test").slopes["K"][0] == pytest.approx(0.1)
    assert affine(system, ["k.free_length"], "test").slopes["K"][0] == pytest.approx(-1e4)
    with pytest.raises(mv.ExportError, match=r"K is not affine in k\.stiffness, k\.free_length together"):
        affine(system, ["k.stiffness", "k.free_length"], "test")
