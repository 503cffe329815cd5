"""Stewart platforms and the cubic hexapod."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import isolation
from mbsvib.library import cubic_hexapod, stewart, stewart_isolator
from tests.isolation.scenes import stiff_isolator
from tests.support.exact import Exact

PLATFORM = ("x", "y", "z", "rx", "ry", "rz")


def compliance(system):
    """Displacements of the platform for unit forces on it, (6, 6)."""
    static = system.frequency_response([0.0])[:, :, 0].real
    return static[np.ix_([system.outputs.index(o) for o in PLATFORM], range(6))]


def test_stewart_against_the_published_modes():
    system = stewart().linearize()
    modes = system.modes()
    assert (system.dof, len(system.bodies), len(system.redundant)) == (6, 13, 0)
    # as printed by the Simscape study, and the energy method's digits
    assert_allclose(modes.frequencies, [780.6, 780.6, 903.9, 1061.4, 1061.4, 1269.6], atol=0.1)
    published = [780.601788, 780.601788, 903.888266, 1061.429376, 1061.429376, 1269.662820]
    assert_allclose(modes.frequencies, published, rtol=0, atol=0.51e-6)
    percent = [0.2452, 0.2452, 0.2840, 0.3335, 0.3335, 0.3989]
    assert_allclose(100 * modes.damping_ratios, percent, rtol=0, atol=0.51e-4)


@pytest.mark.few(1)
@pytest.mark.parametrize(("make", "dof"), [(stewart, 6), (stewart_isolator, 12)])
def test_modes_against_fifty_digits(make, dof):
    model = make(ports="none")
    modes, exact = model.linearize().modes(), Exact(model)
    assert len(modes.frequencies) == exact.dof == dof
    assert_allclose(2 * np.pi * np.repeat(modes.frequencies, 2), np.sort(abs(exact.eigenvalues)), rtol=1e-12)


def test_static_compliance_of_the_stewart_platform():
    static = compliance(stewart().linearize())
    published = [2.8371955207e-8, 2.8371955207e-8, 2.0990463026e-8, 5.1862720981e-6, 5.1862720981e-6, 1.7072960141e-6]
    assert_allclose(np.diag(static), published, rtol=5e-11)
    assert_allclose(abs(static[0, 4]), 6.1619349384e-8, rtol=1e-10)
    assert_allclose(static, static.T, rtol=0, atol=1e-19)


def test_static_compliance_is_that_of_six_struts():
    """With all joints ideal, compliance is (J^T k J)^-1 with a row of J for the elongation of each leg."""
    model = stewart(leg_stiffness=3e5, base_radius=0.2, platform_height=0.14, payload_height=0.2)
    jacobian = np.zeros((6, 6))
    for row, spring in zip(jacobian, model.springs.values(), strict=True):
        row[:3] = spring.line
        row[3:] = np.cross(np.array(spring.end) - (0, 0, 0.2), spring.line)
    expected = np.linalg.inv(jacobian.T @ (3e5 * jacobian))
    assert_allclose(compliance(model.linearize()), expected, rtol=1e-10, atol=1e-12 * abs(expected).max())


def test_mass_of_the_legs_matters():
    """A negative control: tools that leave it out find 935.1 ... 1722.6 Hz."""
    massless = stewart(part_mass=1e-9).linearize().modes().frequencies
    assert_allclose(massless[[0, -1]], [935.1, 1722.6], atol=0.05)


def test_stewart_joints_in_any_order():
    model = stewart(ports="none")
    other = mv.Model("shuffled")
    for body in model.bodies.values():
        other.add_body(**body.constructor_kwargs())
    for name in np.random.default_rng(1).permutation(list(model.joints)):
        other.add_joint(**model.joints[str(name)].constructor_kwargs())
    for spring in reversed(model.springs.values()):
        other.add_spring(**spring.constructor_kwargs())
    assert_allclose(other.linearize().modes().frequencies, model.linearize().modes().frequencies, rtol=1e-13)


def test_isolator_isolates_within_the_axes_of_the_chapters_figures():
    modes = stewart_isolator().linearize().modes()
    assert_allclose(modes.frequencies[[0, 5]], [9.58, 17.16], atol=0.01)
    assert_allclose(modes.damping_ratios[[0, 5]], [0.084, 0.152], atol=0.001)
    assert_allclose(modes.frequencies[6:], 318.3, atol=0.1)  # figure 13: up to 400 Hz
    assert_allclose(modes.damping_ratios[6:], 0.4, atol=0.001)  # and up to 0.8
    result = isolation.study(stewart_isolator(), "platform")
    assert result.crossover < 25.0
    # figure 15: 10 mm and 2 s, in which the free motion dies away
    assert np.exp(-2 * 2 * np.pi * (modes.damping_ratios * modes.frequencies).min()) < 1e-4


def test_isolator_has_six_leg_spins_below_the_platform_modes():
    system = stiff_isolator().linearize()
    modes = system.modes()
    assert (system.dof, len(system.bodies)) == (12, 13)
    spin = np.sqrt(2 * 5.0 / (2 * 0.5 * 0.1 * 0.005**2)) / (2 * np.pi)
    # flexures stiffen the platform a little, and couple it with the spins a little
    assert_allclose(modes.frequencies[:6], spin, rtol=1e-4)
    assert_allclose(modes.frequencies[6:], stewart().linearize().modes().frequencies, rtol=3e-4)


def test_heavy_payload_sits_on_springs_without_mass():
    """With a payload much heavier than the legs, omega^2 are the eigenvalues of its inverse mass times stiffness."""
    mass, inertia = 1e9, (2e6, 3e6, 4e6)
    system = stewart(payload_mass=mass, payload_inertia=inertia).linearize()
    heavy = np.diag([mass] * 3 + list(inertia))
    squares = 1 / np.linalg.eigvals(compliance(system) @ heavy).real
    assert_allclose((2 * np.pi * system.modes().frequencies) ** 2, np.sort(squares), rtol=1e-6)


def test_port_groups():
    assert not stewart(ports="none").inputs
    everything = stewart(ports="all")
    assert list(everything.inputs)[6:] == [f"leg{i}.f" for i in range(1, 7)] + ["ax", "ay", "az"]
    assert [o for o in everything.outputs if o.startswith("leg3")] == ["leg3.elongation", "leg3.force"]
    assert list(everything.outputs)[-6:] == [f"platform.a{d}" for d in PLATFORM]
    assert list(stewart(ports=("base", "legs")).inputs) == list(stewart(ports="all").inputs)[6:]


def test_elongation_of_one_leg_under_its_own_actuator():
    """Nothing else carries an actuator's force when it is at rest: it stretches its own spring and no other."""
    system = stewart(ports="legs").linearize()
    static = system.frequency_response([0.0])[:, :, 0].real
    assert_allclose(static[::2], np.eye(6) / 20e6, atol=1e-19)
    # the spring pulls with what the actuator pushes
    assert_allclose(static[1::2], np.eye(6), atol=1e-11)


def test_base_motion_reaches_the_platform_unchanged_at_low_frequency():
    system = stewart(ports="base").linearize()
    response = system.frequency_response([1e-3])[:, :, 0]
    assert_allclose(response[:3], np.eye(3), atol=1e-12)
    assert_allclose(response[3:], 0, atol=1e-10)


def test_cubic_hexapod_has_the_stiffness_of_the_closed_form():
    for edge, k in ((0.2, 1e6), (0.731, 3.3e5)):
        system = cubic_hexapod(edge=edge, stiffness=k).linearize()
        expected = k * np.array([2, 2, 2, edge**2 / 2, edge**2 / 2, 2 * edge**2])
        assert_allclose(np.diag(system.K), expected, rtol=1e-12)
        assert_allclose(system.K, np.diag(expected), atol=1e-12 * expected.min())
        assert system.dof == 6


def test_cubic_hexapod_is_orthogonal_in_threes():
    lines = np.array([s.line for s in cubic_hexapod().springs.values()])
    products = np.sort(abs(lines @ lines.T).round(12), axis=1)
    # every leg is perpendicular to four others and parallel to one
    assert_allclose(products, np.tile([0, 0, 0, 0, 1, 1], (6, 1)), atol=1e-12)
    lengths = [np.subtract(s.end, s.start) for s in cubic_hexapod(edge=0.3).springs.values()]
    assert_allclose(np.linalg.norm(lengths, axis=1), 0.3, rtol=1e-14)


@pytest.mark.parametrize(
    ("make", "words", "hint"),
    [(stewart, {"foot": "fixed"}, "'universal' or 'spherical'"),
     (stewart, {"ports": "plattform"}, "'platform', 'legs' or"),
     (stewart, {"base_angles": (0, 1, 2)}, "six angles"), (stewart, {"payload_mass": -1.0}, "platform"),
     (stewart, {"platform_radius": 0.115, "platform_height": 0.015, "platform_angles": (0.0,) * 6,
                "base_angles": (0.0,) * 6}, "change a radius"),
     (cubic_hexapod, {"edge": 0.0}, "positive length"), (cubic_hexapod, {"ports": 3}, "ports")],
)  # fmt: skip
def test_bad_arguments(make, words, hint):
    with pytest.raises(mv.ModelError, match=hint):
        make(**words)
