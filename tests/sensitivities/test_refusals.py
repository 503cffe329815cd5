"""What derivatives refuse, or say to be not a number: parameters along which nothing changes smoothly."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

import mbsvib as mv
from tests.superelements.craig_bampton import NODES, reduced


def spinning():
    """A rotor with a plate of no mass on a damper."""
    model = mv.Model("wheel")
    model.add_body("rotor", 2.0, (0.1, 0.1, 0.2))
    model.add_joint("shaft", "free", "ground", "rotor", (0, 0, 0))
    model.add_bushing("k", "ground", "rotor", (0, 0, 0), (1e3, 1e3, 1e3, 10, 10, 10), (1, 1, 1, 1, 1, 1))
    model.add_rotor("spin", "rotor", 50.0, (0, 0, 1), inertia=0.1)
    model.add_body("plate", 0.0, (0, 0, 0), (0, 0, 1))
    model.add_joint("rail", "prismatic", "rotor", "plate", axis=(0, 0, 1))
    model.add_bushing("pad", "rotor", "plate", (0, 0, 1), (0, 0, 9, 0, 0, 0), (0, 0, 1, 0, 0, 0))
    model.add_input("F", "rotor", "x")
    model.add_output("x", "rotor", "x")
    return model.linearize()


def sliding():
    """A weight that slides freely on a body beside a beam whose damping makes derivatives differences."""
    model = mv.Model("sliding")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", "free", "ground", "b", (0, 0, 0))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (4e3,) * 6)
    model.add_beam("beam", "b", "ground", {"type": "tube", "radius": 0.02, "wall": 0.002},
                   {"E": 2e11, "nu": 0.3, "rho": 7800.0}, (0, 0, 0), (0, 1, 0), elements=1, damping_ratio=0.01)
    model.add_body("g", 1.0, (1, 1, 1), (0, 0, 3))
    model.add_joint("rail", "prismatic", "b", "g", axis=(1, 0, 0))
    model.add_load("weight", "g", force=(0, 0, -1.0))
    return model.linearize()


def followed():
    """A double pendulum upside down under a force that turns with it."""
    model = mv.Model("follower")
    for k, (below, body) in enumerate((("ground", "a"), ("a", "b"))):
        model.add_body(body, 1.0, (0.1, 0.1, 0.1), (0, 0, k + 0.5))
        model.add_joint(f"j{k}", "revolute", below, body, (0, 0, k), axis=(0, 1, 0))
        model.add_bushing(f"k{k}", below, body, (0, 0, k), (0, 0, 0, 0, 50, 0))
    model.add_load("f", "b", force=(0, 0, -1.0), follower=True, position=(0, 0, 2))
    return model.linearize()


@pytest.mark.few(1)
@pytest.mark.parametrize(("ask", "message"), [
    (lambda: spinning().h2_norm(parameters="rotor.mass"),
     r"'plate' makes motions without mass in a mechanism that spins .*with_values"),
    (lambda: sliding().matrix_derivatives(["weight.force.x"]),
     r"'weight\.force\.x' moves the equilibrium of 'sliding' along a motion that no stiffness holds, .*Name other"),
    (lambda: followed().matrix_derivatives().factors("f.force.z", "K"),
     r"the derivative of K to 'f\.force\.z' is not symmetric, .*take the matrix itself"),
])  # fmt: skip
def test_refusals_are_told(ask, message):
    with pytest.raises(mv.ModelError, match=message):
        ask()


def test_a_mass_that_comes_beside_a_superelement():
    """It makes another coordinate, but responses go on smoothly; the stiffness beside it in closed form."""
    m, k = reduced(1)
    model = mv.Model("table")
    model.add_superelement("pipe", m, 0.0 * k, k, {"left": NODES[0], "right": NODES[-1]})
    model.add_bushing("foot", "ground", "pipe.left", NODES[0], (1e4,) * 6)
    model.add_body("n", 0.0, (0, 0, 0), NODES[-1])
    model.add_joint("rail", "prismatic", "pipe.right", "n", axis=(0, 0, 1))
    model.add_bushing("low", "pipe.right", "n", NODES[-1], (0, 0, 9.0, 0, 0, 0))
    model.add_bushing("high", "ground", "n", NODES[-1], (0, 0, 3.0, 0, 0, 0))
    model.add_input("F", "pipe.right", "z")
    model.add_output("end", "pipe.right", "z")
    system = model.linearize()
    mass, stiffness = system.frequency_response_sensitivities([3.0], ["n.mass", "high.stiffness.z"])
    step, before = 1e-6, system.frequency_response([3.0])
    after = model.with_values({"n.mass": step}).linearize().frequency_response([3.0])
    np.testing.assert_allclose(mass, (after - before) / step, rtol=1e-5)
    # springs one behind the other: d (k1 k2 / (k1 + k2)) / d k2 along the pipe's end
    expected = -(system.frequency_response([3.0]) ** 2) * (9.0 / 12.0) ** 2
    np.testing.assert_allclose(stiffness, expected, rtol=1e-7)


def test_the_norm_of_a_rotor_with_a_maxwell_element_has_a_value_but_no_derivatives():
    """H2 of states by hand; it was refused with its derivatives."""
    model = mv.Model("rotor")
    model.add_body("disk", 3.0, (0.02, 0.01, 0.01))
    model.add_joint("rest", None, "ground", "disk", (0, 0, 0), free=("y", "z", "ry", "rz"))
    for name, x in (("left", 0.1), ("right", -0.2)):
        model.add_bushing(name, "ground", "disk", (x, 0, 0), (0, 2e4, 3e4, 0, 0, 0), (0, 1.0, 1.0, 0, 0, 0))
    model.add_maxwell("damper", "ground", "disk", (0.1, -1, 0), (0.1, 0, 0), stiffness=1e4, damping=20.0)
    model.add_rotor("spin", "disk", speed=300.0, axis=(1, 0, 0), inertia=0.02)
    model.add_input("F", "disk", "y", position=(0.1, 0, 0))
    model.add_output("z", "disk", "z", position=(0.1, 0, 0))
    system = model.linearize()
    space = system.state_space()
    covariance = solve_continuous_lyapunov(space.A, -space.B @ space.B.T)
    norm = system.h2_norm()
    assert norm.value == pytest.approx(float(np.sqrt(space.C @ covariance @ space.C.T)[0, 0]), rel=1e-9)
    assert norm.variables == ()
    with pytest.raises(mv.ModelError, match="'damper' makes motions without mass"):
        system.h2_norm(parameters="disk.mass")
