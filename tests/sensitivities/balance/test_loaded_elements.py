"""Inerters, torsion springs and rotors under loads: derivatives through the equilibrium, without variants."""

import numpy as np
import pytest
from hypothesis import assume, example, given

import mbsvib as mv
from mbsvib.api.in_equilibrium import in_equilibrium
from mbsvib.sensitivities.variants import Variants
from tests.hunt.generate import example as scene_with
from tests.sensitivities.balance.test_loaded_network import NOISE, QUIET, RTOL, balanced, with_ports
from tests.sensitivities.balance.test_reference_pose import check, hanging, off_balance
from tests.sensitivities.differences import assert_as_variants, of_variants
from tests.support.loaded_models import stiffened
from tests.support.random_models import seeds
from tests.support.sizes import examples

OWN = ("inerter", "torsion", "rotor")


def with_elements(model, rng, moment=True):
    """Two of each kind between any two bodies; the moment of a preloaded torsion spring is balanced by loads."""
    names = ["ground", *model.bodies]
    for k in range(2):
        first, second = (names[i] for i in rng.choice(len(names), 2, replace=False))
        axis, preload = rng.normal(size=3), 1e2 * rng.normal() if k and moment else None
        model.add_inerter(f"inerter{k}", second, first, *rng.normal(size=(2, 3)), 0.1 + rng.random())
        model.add_torsion_spring(f"torsion{k}", first, second, axis, 1e3 * rng.random(), 10 * rng.random(), preload)
        model.add_rotor(f"rotor{k}", first if first in model.bodies else second, 1e2 * rng.normal(), axis[::-1],
                        inertia=rng.random())  # fmt: skip
        for body, sign in ((first, 1), (second, -1)) if preload is not None else ():
            if body != "ground":
                moment = sign * preload * axis / np.linalg.norm(axis)
                model.add_load(f"back {body}", body, torque=moment)
    return model


@pytest.mark.slow
@examples(1, slow=7)
@QUIET
@given(seeds())
@example(4775747)  # a torsion spring turns by rounding only
def test_differences_of_whole_equations(seed):
    rng = np.random.default_rng(seed)
    system = with_ports(with_elements(balanced(seed, stiffened)[0], rng), rng).linearize()
    assume(np.linalg.cond(system.K) < 1e8)
    assert system.sensitivity_basis.loaded is not None
    names = list(system.parameters)
    own = [name for name in names if name.startswith(OWN)]
    chosen = [str(name) for some, count in ((own, 4), (names, 3)) for name in rng.choice(some, count, replace=False)]
    found = system.matrix_derivatives(chosen)
    for k, name in enumerate(chosen):
        assert_as_variants(found, k, system, of_variants(system, name), system.parameters[name], RTOL, NOISE)


@pytest.mark.slow
@examples(1, slow=7)
@QUIET
@given(seeds())
@example(0)
def test_differences_of_equilibria_found_for_every_variant(seed):
    """Torsion springs whose bodies have turned across their axis there are left out: they are differenced."""
    rng = np.random.default_rng(seed)
    try:
        model = with_elements(off_balance(seed), rng, moment=False)
        _, system = in_equilibrium(model.with_parts(springs={name: spring for name, spring in model.springs.items()
                                                      if not name.startswith("torsion")}))  # fmt: skip
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0 and system.provenance.moved_to_equilibrium)
    assert system.sensitivity_basis.loaded is not None
    own = [name for name in system.parameters if name.startswith(OWN)]
    check(system.provenance.origin, system, [str(name) for name in rng.choice(own, 3, replace=False)])


@pytest.mark.slow
def test_torsion_springs_that_an_equilibrium_has_turned(monkeypatch):
    """Two pendulums, one on the other, which turn about the axes of their torsion springs."""
    model = hanging(0.7)
    model.add_torsion_spring("spiral", "ground", "bob", (0, 1, 0), 20.0, 0.3, 1.0)
    model.add_body("end", 1.0, (0.1, 0.2, 0.3), position=(0.9, 0.1, -0.5))
    model.add_joint("elbow", "revolute", "bob", "end", position=(0.5, 0, -0.4), axis=(0, 1, 0))
    model.add_torsion_spring("spring", "end", "bob", (0, 1, 0), 7.0, 0.2)
    model.add_rotor("wheel", "end", 30.0, (0.3, 0.2, 1.0), inertia=0.01)
    _, system = in_equilibrium(model)
    assert system.provenance.moved_to_equilibrium
    names = ["spiral.stiffness", "spiral.preload", "spring.stiffness", "spring.damping", "wheel.speed", "bob.mass",
             "elbow.position.x", "end.orientation.rz"]  # fmt: skip
    check(model, system, names)
    monkeypatch.setattr(Variants, "slopes", lambda *_: pytest.fail("a variant was asked for"))
    assert np.isfinite(system.eigenvalue_sensitivities(names)).all()


def test_a_torsion_spring_in_closed_form():
    """k phi holds a pendulum at the angle a: omega^2 = (k + m g r cos a) / (I + m r^2), k (a - a0) = -m g r sin a."""
    m, r, g, k, a = 3.0, 0.5, 9.81, 50.0, 0.6
    model = hanging(a)
    model.add_torsion_spring("spiral", "ground", "bob", (0, 1, 0), k, preload=-m * g * r * np.sin(a))
    system = model.linearize()
    inertia, stiffness = 0.1 + m * r * r, k + m * g * r * np.cos(a)
    angle = {"spiral.preload": -1 / stiffness, "spiral.stiffness": 0.0, "gravity.z": m * r * np.sin(a) / stiffness}
    direct = {"spiral.preload": 0.0, "spiral.stiffness": 1.0, "gravity.z": -m * r * np.cos(a)}
    slopes = [(direct[name] - m * g * r * np.sin(a) * angle[name]) / (2 * np.sqrt(stiffness * inertia))
              for name in angle]  # fmt: skip
    found = system.eigenvalue_sensitivities(list(angle))[:, 0].imag
    assert found == pytest.approx(slopes, rel=1e-12)


@pytest.mark.few(2)
@pytest.mark.parametrize("feature", ["inerter", "preloaded torsion spring", "rotor on body"])
@pytest.mark.parametrize("hold", ["held by bushings", "held by loads"])
def test_no_variant_is_made(monkeypatch, feature, hold):
    system = scene_with(2, frozenset((feature, "gravity", "follower force", hold))).scene.model().linearize()
    monkeypatch.setattr(Variants, "slopes", lambda *_: pytest.fail("a variant was asked for"))
    assert not np.isnan(system.eigenvalue_sensitivities()).all(axis=1).any()
