"""Every parameter that is listed may be asked for, by name, in every way that there is."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library

# What takes a spinning body, or its bearing, off the axis: equations would change with time, there is no derivative.
INERTIA = [f"inertia.{entry}" for entry in ("xx", "yy", "xy", "xz", "yz")]
AXIS, TILT = ["position.x", "position.y"], ["orientation.rx", "orientation.ry"]
ASKEW = {
    "rotor_stator": [f"rotor.{each}" for each in INERTIA + AXIS + TILT] + [f"bearing.{each}" for each in AXIS + TILT],
    "sleeping_top": [f"top.{each}" for each in INERTIA + AXIS + TILT] + [f"tip.{each}" for each in AXIS],
}
T = np.linspace(0.0, 0.1, 5)
METHODS = {
    "matrices": lambda s, names: s.matrix_derivatives(names), "modes": lambda s, names: s.mode_sensitivities(names),
    "responses": lambda s, names: s.frequency_response_sensitivities([3.0], names),
    "time": lambda s, names: s.time_response_sensitivities(T, np.ones((len(s.inputs), len(T))), names),
    "compliance": lambda s, names: s.compliance_sensitivities(names),
    "H2": lambda s, names: s.h2_norm(parameters=names),
    "Hinf": lambda s, names: s.hinf_norm(parameters=names),
}  # fmt: skip


def asked(name):
    model = library.build(name)
    system = model.linearize()
    assert list(system.parameters) == list(model.parameters)
    return system, [item for item in system.parameters if item not in ASKEW.get(name, ())]


SLOW = {"cantilever", "singular_beam"}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else [])
                                  for name in library.models()])  # fmt: skip
def test_eigenvalues(name):
    system, names = asked(name)
    result = system.eigenvalue_sensitivities(names)
    assert result.shape == (len(names), 2 * system.dof)
    for askew in ASKEW.get(name, ()):
        with pytest.raises(mv.ModelError, match=f"do not change smoothly with '{askew}'"):
            system.eigenvalue_sensitivities(askew)


@pytest.mark.slow
@pytest.mark.parametrize("way", METHODS)
@pytest.mark.parametrize("name", list(library.models())[::3])
def test_all_other_ways(name, way):
    """Responses and norms that do not exist are refused in the same words whatever is asked of them."""
    system, names = asked(name)
    assert refusal(METHODS[way], system, names) == refusal(METHODS[way], system, [])


def refusal(method, system, names):
    try:
        method(system, names)
    except mv.ResponseError as error:
        return str(error)
    return ""


@pytest.mark.slow
def test_gravity_beside_a_relaxing_spring_that_holds_at_rest():
    """A static spring in parallel counts like one of its own: as differences of equilibria say."""
    def scene(apart):
        model = mv.Model("relaxing", gravity=(0.3, 0, -9.81))
        model.add_body("bob", 1.0, (0.1, 0.12, 0.1), position=(0.1, 0, -1))
        model.add_joint("hook", "universal", "ground", "bob", (0, 0, 0), axis=(0, 1, 0), axis2=(1, 0, 0))
        model.add_bushing("hold", "ground", "bob", (0, 0, 0), (0, 0, 0, 30, 20, 30))
        ends = {"start": (1, 0.3, -0.8), "end": (0, 0.1, -1), "stiffness": 100.0}
        model.add_maxwell("leg", "ground", "bob", damping=5.0, static_stiffness=0.0 if apart else 7.0, **ends)
        if apart:
            model.add_spring("static", "ground", "bob", **ends | {"stiffness": 7.0})
        return model.equilibrium(preload="hold")

    system, apart = scene(False).linearize(), scene(True)
    names = ["gravity.x", "gravity.y", "gravity.z", "bob.mass", "bob.position.x"]
    result = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        value, h = apart.parameters[name], 1e-3
        near, far = (apart.with_values({name: value + s * h}).equilibrium().linearize().K for s in (1, -1))
        assert result.K[k] == pytest.approx((near - far) / (2 * h), rel=1e-5, abs=1e-5 * np.abs(result.K[k]).max())


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["pendulum_chain", "four_bar", "slider_crank"])
def test_parts_have_the_parameters_that_they_list(name):
    """What ``reachable`` took out of a loaded mechanism, or of one with loops, changes as the whole does."""
    full = library.build(name).linearize()
    part = full.reachable(full.outputs[0], full.inputs[0])
    names = [item for item in part.parameters if item.startswith("gravity") or ".position.x" in item or "mass" in item]
    result, expected = part.eigenvalue_sensitivities(names), full.eigenvalue_sensitivities(names)
    assert part.dof == full.dof
    assert np.allclose(result, expected, rtol=1e-8, atol=1e-10 * np.nanmax(np.abs(expected)), equal_nan=True)


def test_a_part_has_the_derivatives_of_its_rows():
    model = mv.Model("two", gravity=(0, 0, -9.81))
    for k in range(2):
        model.add_body(f"bob{k}", 1.0, (0.1, 0.1, 0.1), position=(k, 0, -1 - k))
        model.add_joint(f"pin{k}", "revolute", "ground", f"bob{k}", position=(k, 0, 0), axis=(0, 1, 0))
        model.add_input(f"push{k}", f"bob{k}", "x")
        model.add_output(f"seen{k}", f"bob{k}", "x")
    part = model.linearize().reachable("seen1", "push1")
    assert part.dof == 1
    result = part.eigenvalue_sensitivities(["gravity.z", "bob1.position.z", "bob0.mass"])[:, 0].imag
    omega = np.sqrt(9.81 * 2 / (0.1 + 4))
    by_length = (9.81 / 4.1 - 9.81 * 2 * 4 / 4.1**2) / (2 * omega)
    assert result == pytest.approx([-omega / 9.81 / 2, -by_length, 0.0], rel=1e-9, abs=1e-12)


def test_damping_that_is_not_there_yet():
    """C is zero without dampers, so that its derivative is measured by itself: linear in the damping ratio."""
    result = library.cantilever(elements=3).linearize().matrix_derivatives("tube.damping_ratio").C[0]
    damped = library.cantilever(elements=3).with_values({"tube.damping_ratio": 1e-3}).linearize()
    assert result == pytest.approx(damped.C / 1e-3, rel=1e-9, abs=1e-11 * np.abs(damped.C).max() / 1e-3)
