"""Forces in joints as outputs: against equilibria under small loads, Newton's law, and closed forms."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.common.arguments import frame_along
from tests.loads.test_closed_forms import balanced, four_bar
from tests.support import overconstrained
from tests.support.loaded_models import held, loaded
from tests.support.random_models import spatial
from tests.support.sizes import few

# redundant constraints are welcome here: what they leave open is compared as well
pytestmark = pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")
SIX = ("x", "y", "z", "rx", "ry", "rz")


def with_all_joint_forces(model):
    for joint in model.joints:
        for direction in SIX:
            model.add_force_output(f"{joint}.{direction}", joint, direction)
    return model


def in_axes(start, model, reactions):
    """Reactions in another pose in the axes of the joints, as their first bodies carry them since the start."""
    result = []
    for name, wrench in reactions.items():
        first, axes = start.joints[name].first, np.array(start.joints[name].axes)
        if first != "ground":
            axes = np.array(model.bodies[first].orientation) @ np.array(start.bodies[first].orientation).T @ axes
        result += [*(-axes.T @ wrench[:3]), *(-axes.T @ wrench[3:])]
    return np.array(result)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", few((3, 0, 1, 2, 4, 5), 1))  # 3 has universal joints in a loop
@pytest.mark.parametrize("loops", [0, 1])
@pytest.mark.parametrize("under_load", [False, True])
def test_a_small_load_changes_reactions_as_the_static_response_says(seed, loops, under_load):
    make = loaded if under_load else lambda *a, **words: spatial(*a, ports=False, **words)
    model = make(seed, bodies=3, loops=loops, kinds=("revolute", "universal", "cylindrical", "spherical", "planar"))
    for k, body in enumerate(model.bodies):
        stiff = 1e5 * np.array([1, 1, 1, 0.3, 0.3, 0.3])
        model.add_bushing(f"ground{k}", "ground", body, model.bodies[body].position, stiff)
    assert_static_response(model)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["x rx rz", "y z rx"])
@pytest.mark.parametrize("seed", few((3, 0, 1, 2), 1))
def test_couplers_that_measure_the_joint_at_which_a_loop_is_cut(kind, seed):
    model = loaded(seed, bodies=3, loops=1, couplers=1, kinds=("cylindrical",), closing_kinds=(kind,))
    for k, body in enumerate(model.bodies):
        stiff = 1e5 * np.array([1, 1, 1, 0.3, 0.3, 0.3])
        model.add_bushing(f"ground{k}", "ground", body, model.bodies[body].position, stiff)
    assert model.linearize().cut_joints == ("j3",)
    assert_static_response(model)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bennett", "cardan", "locomotive", "wedge", "differential screw"])
def test_forces_that_redundant_constraints_leave_open_change_with_the_pose(name):
    """They are of least norm in every pose, and so are self-stress and the mechanism's length other ones in each."""
    assert_static_response(held(overconstrained.ALL[name]()[0]))


def assert_static_response(model):
    """Reactions change under a small load as the static response of the outputs says."""
    body = list(model.bodies)[-1]
    force = np.array([30.0, -20.0, 50.0])
    with_all_joint_forces(model).add_input("f", body, force)
    try:
        system = model.linearize()
    except mv.SingularPoseError:
        pytest.skip("the random bodies are locked")
    if not system.dof:
        pytest.skip("the random bodies are locked")
    moved = []
    for sign in (1e-2, -1e-2):
        pushed = model.replace("f", body=body)
        pushed.add_load("push", body, force=sign * force)
        at = pushed.equilibrium()
        moved.append(in_axes(model, at, at.linearize().reactions))
    expected = (moved[0] - moved[1]) / 2e-2
    result = system.Cq @ np.linalg.solve(system.K, system.B[:, 0]) + system.D[:, 0]
    assert np.abs(result - expected).max() < 3e-5 * np.abs(expected).max()


def test_pendulum_in_closed_form():
    """A rod turned by q about x: sideways in its own axes m (d q'' + g q), of which the rod's axes hide g q."""
    mass, d, g = 3.0, 0.4, 9.81
    model = mv.Model("pendulum", gravity=(0, 0, -g))
    model.add_body("rod", mass, (0.2, 0.2, 0.01), position=(0, 0, -d))
    model.add_joint("hinge", "revolute", "rod", "ground", position=(0, 0, 0), orientation=np.eye(3)[:, [1, 2, 0]])
    model.add_input("push", "rod", "y", position=(0, 0, -1.0))
    model.add_force_output("across", "hinge", "x")
    model.add_force_output("along", "hinge", "y")
    model.add_force_output("ground.y", "ground", "y")
    model.add_force_output("ground.rx", "ground", "rx")
    model.add_force_output("rod.y", "rod", "y")
    s = model.linearize()
    # the hinge's angle is that of ground against the rod: q = -angle of the rod; y moves by +d * angle
    assert s.coordinates == ("hinge.rz",)
    assert s.Ca[:, 0] == pytest.approx([-mass * d, 0, mass * d, 0.2 + mass * d * d, -mass * d], abs=1e-12)
    assert s.Cq[:, 0] == pytest.approx([-mass * g, 0, 0, mass * g * d, 0], abs=1e-12)
    assert s.D[:, 0] == pytest.approx([-1.0, 0, 0, 0, 0], abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_shaking_forces_are_those_of_all_that_touches_the_ground(seed):
    """In a tree without loads: sums of joints and springs to ground, in world axes, about the origin."""
    model = spatial(seed, bodies=4, ports=False, damped=True)
    at_ground = []
    for joint in list(model.joints.values()):
        if "ground" in (joint.first, joint.second):
            at_ground.append(joint)
    with_all_joint_forces(model)
    model.add_input("u", list(model.bodies)[1], (1, 2, 3, 0.3, 0.2, 0.1), relative_to=next(iter(model.bodies)))
    model.add_base_motion("a", "x")
    springs = [s for s in model.springs.values() if "ground" in (s.first, s.second)]
    for spring in springs:
        for direction in SIX if hasattr(spring, "position") else ("z",):
            model.add_force_output(f"{spring.name}.{direction}", spring.name, direction)
    for direction in SIX:
        model.add_force_output(f"shake.{direction}", "ground", direction)
    s = model.linearize()
    if not s.dof:
        pytest.skip("the random bodies are locked")
    omega = np.array([3.0, 40.0])
    response = dict(zip(s.outputs, s.frequency_response(omega), strict=True))
    total = 0
    for part in [*at_ground, *springs]:
        line = hasattr(part, "line")
        axes = frame_along(part.line) if line else getattr(part, "axes", None) or part.orientation
        none = np.zeros((len(s.inputs), len(omega)), dtype=complex)
        six = np.array([response.get(f"{part.name}.{d}", none) for d in SIX])
        sign = 1 if part.first == "ground" else -1
        force, moment = (sign * np.einsum("ij,j...->i...", np.array(axes), half) for half in (six[:3], six[3:]))
        at = part.start if line else getattr(part, "point", None) or part.position
        if at is None:
            at = model.bodies[part.first if part.second == "ground" else part.second].position
        total = total + np.concatenate((force, moment + np.cross(at, force, axisb=0, axisc=0)))
    shake = np.array([response[f"shake.{d}"] for d in SIX])
    assert np.abs(shake - total).max() < 1e-9 * np.abs(shake).max()


def test_forces_in_a_loop_hold_its_bodies():
    """The coupler of a loaded four-bar: pins and spring make its mass times acceleration, in world axes."""
    model = with_all_joint_forces(balanced(four_bar(), "spring"))
    s = model.linearize()
    motion = s.body_motion[1, :, 0]
    rotation = s.body_motion[:, 5, 0]
    index = {name: k for k, name in enumerate(s.outputs)}
    acceleration = sum(sign * np.array([s.Ca[index[f"{pin}.{d}"], 0] for d in "xy"])
                       for pin, sign in (("pin1", -1), ("pin2", 1)))  # fmt: skip
    # on a solution z'' = -(K / M) z the stiffness terms count as well
    static = np.zeros(2)
    for pin, sign, carrier in (("pin1", -1, 0), ("pin2", 1, 1)):
        reaction = s.reactions[pin]
        static += sign * np.array([s.Cq[index[f"{pin}.{d}"], 0] for d in "xy"])
        static += -sign * rotation[carrier] * np.array([-reaction[1], reaction[0]])
    spring = model.springs["spring"]
    end = np.subtract(spring.end, model.bodies["coupler"].position)
    moved = motion[:2] + motion[5] * np.array([-end[1], end[0]])
    e = np.array(spring.line)[:2]
    pull = -(spring.stiffness * e * (e @ moved) + spring.tension / spring.length * (moved - e * (e @ moved)))
    z2 = -s.K[0, 0] / s.M[0, 0]
    mass = model.bodies["coupler"].mass
    assert acceleration * z2 + static + pull == pytest.approx(mass * motion[:2] * z2, rel=1e-9, abs=1e-9)


def test_variants_have_forces_of_their_own_in_joints():
    model = mv.library.stewart()
    joint = next(iter(model.joints))
    model.add_force_output("f", joint, "x")
    leg = next(name for name in model.parameters if name.endswith(".stiffness"))
    batch = model.linearize(values={leg: [1e6, 2e6]})
    for i, value in enumerate((1e6, 2e6)):
        single = model.with_values({leg: value}).linearize()
        for key in ("M", "C", "K", "Cq", "Ca", "D"):
            expected = getattr(single, key)
            np.testing.assert_allclose(getattr(batch, key)[i], expected, rtol=0, atol=1e-14 * abs(expected).max())
    assert abs(batch.Cq[1] - batch.Cq[0]).max() > 1.0
