"""Maxwell elements as parts of the network: their own numbers and all others, unloaded and under load."""

import numpy as np
import pytest
from hypothesis import assume, given

import mbsvib as mv
from mbsvib.sensitivities.variants import Variants
from tests.sensitivities.differences import assert_as_variants, of_variants
from tests.support.loaded_models import stiffened
from tests.support.random_models import seeds, spatial
from tests.support.sizes import examples


def relaxing(seed, under_load):
    """A random mechanism with two Maxwell elements; under load without static springs, which would carry a force."""
    rng = np.random.default_rng(seed)
    model = stiffened(seed, 2, seed % 3, torque=seed % 2 == 1) if under_load else spatial(seed, 2, seed % 3)
    bodies = list(model.bodies)
    for k in range(2):
        body, other = str(rng.choice(bodies)), "ground"
        if k == 0 and len(bodies) > 1:
            other = next(name for name in bodies if name != body)
        ends = (body, other) if rng.random() < 0.5 else (other, body)
        static = 0.0 if under_load or k else 100.0
        model.add_maxwell(f"relax{k}", *ends, *rng.normal(size=(2, 3)), stiffness=300 * rng.random() + 50,
                          damping=10 * rng.random() + 0.1, static_stiffness=static)  # fmt: skip
    model.add_force_output("relaxed", "relax0", "z")
    return model


@pytest.mark.slow
@examples(1, slow=6)
@pytest.mark.parametrize("under_load", [False, True])
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seed=seeds())
def test_differences_of_random_mechanisms_with_maxwell_elements(seed, under_load):
    try:
        model = relaxing(seed, under_load)
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 2)
    names = list(system.parameters)
    own = [name for name in names if name.startswith("relax")]
    rng = np.random.default_rng(seed)
    for name in [*map(str, rng.choice(own, 3, replace=False)), *map(str, rng.choice(names, 3, replace=False))]:
        try:
            expected = of_variants(system, name)
        except mv.ModelError:
            continue
        result = system.matrix_derivatives(name)
        assert_as_variants(result, 0, system, expected, system.parameters[name], 1e-8, 1e-10)


def test_dynamic_stiffness_in_closed_form(monkeypatch):
    """k0 + k1 c s / (k1 + c s) along a line that the mass leaves at an angle a: its cosine squared counts."""
    k0, k1, c, m = 100.0, 300.0, 12.0, 2.0
    model = mv.Model("leg")
    model.add_body("mass", m, (0.1, 0.1, 0.1))
    model.add_joint("way", "prismatic", "ground", "mass", position=(0, 0, 0), axis=(0, 0, 1))
    model.add_maxwell("leg", "ground", "mass", (0.75, 0, -1), (0, 0, 0), k1, c, k0)
    model.add_input("push", "mass", "z")
    model.add_output("move", "mass", "z")
    model.add_force_output("felt", "leg", "z")
    system = model.linearize()
    monkeypatch.setattr(Variants, "slopes", lambda *_: pytest.fail("a variant was asked for"))
    s, cosine = 9j, 0.8
    names = ["leg.stiffness", "leg.damping", "leg.static_stiffness", "mass.mass", "leg.start.x"]
    result = system.frequency_response_sensitivities([9.0], names)[..., 0]
    z = k0 + k1 * c * s / (k1 + c * s)
    slopes = np.array([(c * s / (k1 + c * s)) ** 2, s * (k1 / (k1 + c * s)) ** 2, 1.0, 0.0, 0.0])
    turned = np.array([0, 0, 0, 0, -0.75 / (1 + 0.75**2) ** 1.5])  # d cos / dx
    full = m * s * s + z * cosine**2
    stiff = slopes * cosine**2 + 2 * z * cosine * turned + np.array([0, 0, 0, s * s, 0])
    assert result[:, 0, 0] == pytest.approx(-stiff / full**2, rel=1e-12)
    rows = slopes * cosine / full + z * turned / full - z * cosine * stiff / full**2
    sign = np.sign((system.frequency_response([9.0])[1, 0, 0] / (z * cosine / full)).real)
    assert result[:, 1, 0] == pytest.approx(sign * rows, rel=1e-11)


def test_what_nothing_holds_stays_where_a_maxwell_element_relaxes():
    model = mv.Model("slider")
    model.add_body("arm", mass=2.0, inertia=[0.1, 0.2, 0.3], position=(0.4, 0.3, 0.0))
    model.add_body("slider", mass=1.5, inertia=[0.1, 0.1, 0.1], position=(1.0, 1.2, 0.0))
    model.add_joint("hinge", "revolute", "ground", "arm", position=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    model.add_joint("way", "prismatic", "ground", "slider", axis=(1.0, 0.3, 0.0))
    model.add_bushing("spring", "ground", "arm", position=(0.0, 0.0, 0.0), stiffness=[0, 0, 0, 0, 0, 80.0],
                      preload=[0, 0, 0, 0, 0, -0.1])  # fmt: skip
    model.add_maxwell("link", "arm", "slider", (0.8, 0.5, 0.0), (1.0, 1.2, 0.0), stiffness=300.0, damping=4.0)
    model.add_load("pull", "arm", force=(3.0, 2.0, 0.0), position=(0.8, 0.5, 0.0))
    result = model.linearize().mode_sensitivities(["pull.force.x"]).eigenvalues[0]
    step = 1e-3
    plus, minus = (model.with_values({"pull.force.x": 3.0 + change}).equilibrium().linearize().modes().eigenvalues
                   for change in (step, -step))  # fmt: skip
    np.testing.assert_allclose(result, (plus - minus) / (2 * step), rtol=0, atol=1e-6 * np.abs(result).max())
