"""Beams and superelements in their loaded shape: derivatives through the equilibrium, without variants."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.sensitivities.variants import Variants
from tests.hunt.generate import example as scene_with
from tests.sensitivities.differences import assert_as_variants, of_variants
from tests.superelements.test_loaded import NODES, Reference
from tests.support.random_models import rotation

RTOL, NOISE = 1e-8, 1e-11
SECTION = {"A": 6e-4, "Iy": 4.5e-8, "Iz": 2e-8, "J": 5e-8, "ky": 0.83, "kz": 0.8}
MATERIAL = {"E": 2e11, "rho": 7800.0, "G": 0.77e11}


def hub_and_tip(hinged=True):
    """A tip under forces on something flexible, which a hub on a hinge or the ground carries."""
    model = mv.Model("flexible", gravity=(1.0, -2.0, -9.81))
    model.add_body("tip", 3.0, (0.1, 0.2, 0.15), position=(1.2, 0.3, 0.2))
    model.add_load("push", "tip", (10, 20, 30), (1, 2, 3), position=(1.1, 0.3, 0.4))
    if hinged:
        model.add_body("hub", 2.0, (0.1, 0.2, 0.15), position=(0.05, 0.1, 0.0))
        model.add_joint("hinge", "revolute", "ground", "hub", position=(0.02, 0, 0.01), axis=(0.1, 1, 0.2))
        model.add_bushing("hold", "ground", "hub", (0.3, 0, 0), (1e4, 2e4, 3e4, 100, 200, 300))
    return model, "hub" if hinged else "ground"


def with_beam(hinged, **words):
    model, held = hub_and_tip(hinged)
    model.add_beam("beam", held, "tip", start=(0.1, 0, 0), end=(0.9, 0.2, 0.1), section=SECTION, material=MATERIAL,
                   y_axis=(0, 1, 0.2), **{"elements": 2} | words)  # fmt: skip
    return model


def with_superelement(hinged, damped=False):
    """Its axes are turned: matrices that see the nodes in axes of their own are those of another model there."""
    model, held = hub_and_tip(hinged)
    reference, turn = Reference(hinged), rotation(np.random.default_rng(0))
    nodes = {name: turn @ point for name, point in NODES.items()}
    damping = 1e-3 * reference.k if damped else None
    model.add_superelement("part", reference.m, damping, reference.k, nodes, bodies={"mid": held, "right": "tip"},
                           orientation=turn)  # fmt: skip
    model.add_load("pull", "part.left", (2, 1, -3))
    return model


BEAMS = {
    "euler": lambda: with_beam(True), "held by the ground": lambda: with_beam(False, elements=3),
    "timoshenko, damped": lambda: with_beam(True, shear=True, alpha=0.3, beta=1e-4, damping_ratio=0.02),
}  # fmt: skip
SUPERELEMENTS = {
    "hinged": lambda: with_superelement(True), "held by the ground": lambda: with_superelement(False),
    "damped": lambda: with_superelement(True, damped=True),
}  # fmt: skip


def check(model, names=None):
    model.add_input("force", "tip", (1, 2, 3), position=(0.9, 0.2, 0.3))
    model.add_output("seen", "tip", (1, 2, 3), position=(0.9, 0.2, 0.3), quantity="acceleration")
    node = "beam.1" if model.beams else "part.left"
    model.add_input("force on node", node, (3, 2, -1))
    model.add_output("seen on node", node, (1, -2, 3))
    if "hold" in model.springs:
        model = model.equilibrium(preload=True)
    system = model.linearize()
    assert system.sensitivity_basis.loaded is not None
    names = [name for name in system.parameters if names is None or name in names]
    found = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        assert_as_variants(found, k, system, of_variants(system, name), system.parameters[name], RTOL, NOISE)


@pytest.mark.slow
def test_some_parameters_of_a_scene_with_a_beam():
    names = ("beam.E", "beam.end.y", "beam.rho", "tip.mass", "gravity.x", "hinge.orientation.rz")
    check(BEAMS["timoshenko, damped"](), names)


@pytest.mark.slow
def test_some_parameters_of_a_scene_with_a_superelement():
    check(SUPERELEMENTS["damped"](), ("push.force.y", "pull.force.x", "tip.mass", "gravity.x", "hinge.orientation.rz"))


@pytest.mark.slow
@pytest.mark.parametrize("scene", [*BEAMS.values(), *SUPERELEMENTS.values()], ids=[*BEAMS, *SUPERELEMENTS])
def test_all_parameters(scene):
    check(scene())


@pytest.mark.slow
@pytest.mark.parametrize("feature", ["beam", "timoshenko beam"])
def test_no_variant_is_made(monkeypatch, feature):
    features = frozenset((feature, "gravity", "follower force", "held by loads"))
    system = scene_with(2, features).scene.model().linearize()
    monkeypatch.setattr(Variants, "slopes", lambda *_: pytest.fail("a variant was asked for"))
    assert not np.isnan(system.eigenvalue_sensitivities()).all(axis=1).any()
