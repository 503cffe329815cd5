"""Sensitivities of loaded scenes through their equilibrium: parameters move the pose, and it moves the equations."""

import numpy as np
import pytest
from hypothesis import assume, given

import mbsvib as mv
from tests.sensitivities.differences import eigenvalues, of_variants, step_of
from tests.sensitivities.test_limits import pendulum
from tests.support.loaded_models import stiffened
from tests.support.random_models import seeds
from tests.support.sizes import examples

# What differences of whole equilibria can tell: their poses are found to some 1e-12.
RTOL, NOISE = 3e-6, 1e-10


def settled(model, system, name, of):
    """d of(system) / d name by differences of models in their own equilibria."""
    value, h = model.parameters[name], step_of(model.parameters, name)

    def at(change):
        there = model.with_values({name: value + change}).equilibrium()
        return of(there.linearize(independent=system.coordinates, cut=system.cut_joints))

    return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h), h


@pytest.mark.slow
@examples(1, slow=7)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
def test_differences_of_random_equilibria(seed):
    try:
        model = stiffened(seed, 2, seed % 2)
        system = model.linearize()
        assume(system.dof > 0)
        assume(np.linalg.eigvalsh(system.K)[0] > 1e3)
        rng = np.random.default_rng(seed)
        fields = (".mass", ".position.", ".start.", ".free_length", ".preload", ".force.", "gravity.", ".orientation.")
        names = [str(rng.choice([name for name in model.parameters if field in name])) for field in fields
                 if any(field in name for name in model.parameters)]  # fmt: skip
        names = [str(name) for name in rng.choice(names, 4, replace=False)]
        result = system.eigenvalue_sensitivities(names)
        assume(np.isfinite(result).all())
        pairs = [settled(model, system, name, lambda s: np.sort_complex(eigenvalues(s) ** 2)) for name in names]
    except (mv.SingularPoseError, mv.EquilibriumError):
        assume(False)
    values = eigenvalues(system)
    squares = np.sort_complex(values**2)
    order = np.argsort(values**2)
    for row, name, (expected, h) in zip(result, names, pairs, strict=True):
        slopes = (2 * values * row)[order]
        noise = NOISE * np.abs(squares).max() / h
        assert np.abs(slopes - expected).max() <= RTOL * np.abs(expected).max() + noise, name


def test_pendulum_in_closed_form():
    """omega^2 = (k + m g r) / (I + m r^2), at rest below its hinge; any of its numbers."""
    model = pendulum()
    m, r, g, k, inertia = 3.0, 0.5, 9.81, 40.0, 0.1
    full, torque = inertia + m * r * r, k + m * g * r
    omega = np.sqrt(torque / full)
    slopes = {"bob.mass": (g * r - torque / full * r * r) / full,
              "bob.position.z": -(m * g - torque / full * 2 * m * r) / full,
              "hinge.position.z": (m * g - torque / full * 2 * m * r) / full,
              "gravity.z": -m * r / full, "gravity.x": 0.0, "spiral.stiffness.ry": 1 / full,
              "bob.inertia.yy": -torque / full**2}  # fmt: skip
    result = model.linearize().eigenvalue_sensitivities(list(slopes))
    assert result[:, 0].imag / (0.5 / omega) == pytest.approx(list(slopes.values()), rel=1e-14, abs=1e-14)
    assert np.abs(result.real).max() == 0.0


def test_a_spring_hangs_lower_under_more_mass():
    """Two springs of free length L, from both sides: x'' stiffness k, along y 2 T / l, which the sag changes."""
    k, free, half, m, g = 2e3, 0.2, 0.3, 1.5, 9.81

    def model(mass):
        result = mv.Model("string", gravity=(0, 0, -g))
        result.add_body("bob", mass, (0.01, 0.01, 0.01), position=(0, 0, -0.1))
        result.add_joint("way", "planar", "ground", "bob", position=(0, 0, -0.1), axis=(1, 0, 0))
        for side in (-1, 1):
            result.add_spring(f"cord{side}", "ground", "bob", (0, side * half, 0), (0, 0, -0.1), k, free_length=free)
        return result.equilibrium()

    import mpmath as mp

    mp.mp.dps = 40

    def square(mass):
        """Frequency along z: k sums of (z / l)^2 + T / l (y / l)^2 at the sag under this mass."""
        tension = lambda z: k * (mp.sqrt(half**2 + z**2) - free)  # noqa: E731
        z = mp.findroot(lambda z: 2 * tension(z) * z / mp.sqrt(half**2 + z**2) - mass * mp.mpf(g), 0.1)
        length = mp.sqrt(half**2 + z**2)
        return 2 * (k * (z / length) ** 2 + tension(z) / length * (half / length) ** 2) / mass

    system = model(m).linearize()
    expected = [float(mp.diff(square, mp.mpf(m)))]
    lead = system.modes().eigenvalues
    actual = 2 * lead * system.eigenvalue_sensitivities("bob.mass")[0]
    at = int(np.argmin(np.abs(lead**2 + float(square(mp.mpf(m))))))
    assert actual[at] == pytest.approx(-expected[0], rel=1e-12)


@pytest.mark.slow
def test_responses_and_matrices_follow_the_equilibrium():
    """A crank under gravity, held by a spring: its compliance, and D of what joints carry."""
    model = mv.Model("crank", gravity=(0, 0, -9.81))
    model.add_body("arm", 2.0, (0.02, 0.02, 0.02), position=(0.3, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "arm", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_spring("cord", "ground", "arm", (0.2, 0, 0.5), (0.4, 0, 0), 800.0, damping=3.0, free_length=0.45)
    model.add_input("push", "arm", "z", position=(0.6, 0, 0))
    model.add_output("tip", "arm", "z", position=(0.6, 0, 0))
    model.add_force_output("bearing", "hinge", "x")
    model = model.equilibrium()
    system = model.linearize()
    names = ["arm.mass", "cord.free_length", "cord.stiffness", "cord.start.x", "hinge.position.z", "arm.position.x"]
    w = np.array([0.0, 10.0, 40.0])
    result = system.frequency_response_sensitivities(w, names)
    matrices = system.matrix_derivatives(names)
    keys = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
    parts = lambda s: [s.frequency_response(w), *(getattr(s, key) for key in keys)]  # noqa: E731
    ends = np.cumsum([part.size for part in parts(system)])[:-1]
    for k, name in enumerate(names):
        change, h = settled(model, system, name, lambda s: np.concatenate([part.ravel() for part in parts(s)]))
        expected, *slopes = np.split(change, ends)
        assert np.abs(result[k].ravel() - expected).max() <= 1e-6 * np.abs(expected).max()
        for key, at in zip(keys, slopes, strict=True):
            size = np.abs(getattr(system, key)).max(initial=0.0) / h
            off = np.abs(getattr(matrices, key)[k].ravel() - at).max()
            assert off <= 1e-6 * np.abs(at).max() + 1e-10 * size, (name, key)


def test_what_nothing_holds_is_refused_by_name():
    """A body on a guide across gravity has no equilibrium once gravity is tilted."""
    model = mv.Model("sledge", gravity=(0, 0, -9.81))
    model.add_body("box", 2.0, (0.1, 0.1, 0.1))
    model.add_joint("way", "prismatic", "ground", "box", position=(0, 0, 0), axis=(1, 0, 0))
    system = model.linearize()
    with pytest.raises(mv.ModelError, match=r"'gravity\.x' moves the equilibrium of 'sledge' along a motion that no"):
        system.eigenvalue_sensitivities("gravity.x")
    every = system.matrix_derivatives()
    lost = [name for name, change in zip(every.variables, every.M, strict=True) if np.isnan(change).any()]
    assert lost == ["gravity.x", "way.orientation.ry"]


@pytest.mark.slow
def test_forces_that_are_zero_move_the_pose_once_they_are_not():
    """A preload of 0 N on a slanted spring turns its arm, whose other spring then pulls from elsewhere."""
    model = mv.Model("arm", gravity=(0, 0, 0))
    model.add_body("arm", 2.0, (0.02, 0.03, 0.02), position=(0.3, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "arm", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_spring("stay", "ground", "arm", (0.1, 0, 0.5), (0.4, 0, 0), 800.0)
    model.add_spring("line", "ground", "arm", (0.5, 0, 0.3), (0.6, 0, 0), 300.0, preload=0.0)
    system = model.linearize()
    assert system.provenance.statics is None
    names = ["line.preload", "gravity.z", "arm.mass", "stay.start.x"]
    for row, name in zip(system.eigenvalue_sensitivities(names), names, strict=True):
        expected, _ = settled(model, system, name, eigenvalues)
        np.testing.assert_allclose(row, expected, rtol=RTOL)
        assert np.abs(row).max() > 0.0


@pytest.mark.slow
def test_stiffness_beside_a_condensed_node_under_a_dead_torque():
    """K is not symmetric, so that what condenses the node acts from the left in another way than from the right."""
    model = mv.Model("node")
    model.add_body("body", 2.0, (0.2, 0.3, 0.25), position=(0.1, 0.2, 0.3))
    model.add_body("node", 0.0, (0, 0, 0), position=(0.4, 0.1, 0.3))
    model.add_bushing("inner", "body", "node", (0.4, 0.1, 0.3), (900, 800, 700, 60, 50, 40))
    model.add_bushing("outer", "ground", "node", (0.45, 0.2, 0.3), (400, 500, 600, 30, 40, 50))
    model.add_bushing("hold", "ground", "body", (0.0, 0.1, 0.2), (500, 700, 600, 50, 60, 40))
    model.add_load("twist", "body", torque=(5.0, -3.0, 4.0))
    model.add_load("turn", "node", torque=(-2.0, 1.0, 3.0))
    system = model.equilibrium(preload=True).linearize()
    assert system.provenance.separation.transform is not None
    names = ["inner.stiffness.rx", "outer.stiffness.y", "hold.stiffness.rz", "body.mass", "outer.position.x"]
    found = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        np.testing.assert_allclose(found.K[k], of_variants(system, name)["K"], rtol=1e-7, atol=1e-9)


@pytest.mark.slow
def test_directions_of_ports_turn_as_the_equilibrium_moves():
    model = mv.Model("arm", gravity=(0, 0, -9.81))
    model.add_body("a", 2.0, (0.02, 0.03, 0.04), (0.3, 0, -0.1))
    model.add_joint("pin", "revolute", "ground", "a", (0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("k", "ground", "a", (0, 0, 0), (0, 0, 0, 0, 60, 0), (0, 0, 0, 0, 0.2, 0))
    model.add_body("b", 1.0, (0.01, 0.01, 0.02), (0.8, 0.1, 0))
    model.add_bushing("soft", "a", "b", (0.6, 0, 0), (900, 800, 700, 40, 50, 60), (1, 1, 1, 0.1, 0.1, 0.1))
    model.add_input("f", "b", (1, 2, -1, 0.3, 0.2, 0.1), (0.7, 0.05, 0.02), "a")
    model.add_output("y", "b", (1, -2, 1, 0.5, 0.2, 1), (0.65, 0.05, 0.02), "a")
    model.add_force_output("r", "pin", (1, 0, 2, 0.5, 0, 0))
    model, omega = model.equilibrium(), [5.0, 20.0]
    system = model.linearize()
    names = ["b.mass", "k.stiffness.ry", "soft.position.x"]
    slopes = system.frequency_response_sensitivities(omega, names)
    for slope, name in zip(slopes, names, strict=True):
        expected, _ = settled(model, system, name, lambda s: s.frequency_response(omega))
        np.testing.assert_allclose(slope, expected, rtol=0, atol=3e-6 * np.abs(expected).max())
