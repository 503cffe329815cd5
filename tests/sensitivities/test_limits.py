"""Sensitivities under load, with couplers and spin: by rules of parts what enters by motions, by variants the rest."""

import numpy as np
import pytest
from hypothesis import assume, given

import mbsvib as mv
from tests.sensitivities.differences import assert_derivative, difference, eigenvalues, step_of
from tests.support.loaded_models import loaded
from tests.support.random_models import seeds
from tests.support.sizes import examples

MATRICES = ("M", "C", "K")


def known(system):
    """Names of parameters that enter by motions alone."""
    return [name for name in system.parameters if ".damping" in name or ".inertia" in name
            or (".stiffness" in name and not name.startswith("free"))]  # fmt: skip


@pytest.mark.slow
@examples(3, slow=8)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
def test_differences_of_random_mechanisms_under_load(seed):
    try:
        model = loaded(seed, 2, seed % 2, follower=seed % 3 == 0, couplers=seed % 4 == 1)
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0)
    names = known(system)
    result, values = system.matrix_derivatives(names), system.eigenvalue_sensitivities(names)
    for k in np.random.default_rng(seed).choice(len(names), size=4, replace=False):
        at = difference(model, system, names[k], lambda s: [getattr(s, key) for key in MATRICES])
        for key, expected in zip(MATRICES, at, strict=True):
            size = np.abs(getattr(system, key)).max() / step_of(system.parameters, names[k])
            assert np.abs(getattr(result, key)[k] - expected).max() <= 1e-8 * np.abs(expected).max() + 1e-12 * size
    assert np.isfinite(values).all()


def pendulum():
    """omega^2 = (k + m g r) / I: a spiral spring and gravity."""
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", 3.0, (0.1, 0.1, 0.1), position=(0, 0, -0.5))
    model.add_joint("hinge", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("spiral", "ground", "bob", (0, 0, 0), (0, 0, 0, 0, 40.0, 0))
    return model


def test_pendulum_in_closed_form():
    result = pendulum().linearize().eigenvalue_sensitivities(["spiral.stiffness.ry", "bob.inertia.yy"])
    inertia = 0.1 + 3.0 * 0.25
    omega = np.sqrt((40.0 + 3.0 * 9.81 * 0.5) / inertia)
    assert result[:, 0] == pytest.approx([1j / (2 * omega * inertia), -0.5j * omega / inertia], rel=1e-13)


def rotor():
    model = mv.Model("rotor")
    model.add_body("disc", 5.0, (0.25, 0.25, 0.4))
    model.add_bushing("bearing", "ground", "disc", (0, 0, 0.1), (3e4, 2e4, 5e4, 4e3, 3e3, 0.0),
                      damping=(3.0, 2.0, 5.0, 0.4, 0.3, 0.0))  # fmt: skip
    model.add_rotor("spin", "disc", 300.0, axis=(0, 0, 1))
    model.add_input("push", "disc", "x")
    model.add_output("tilt", "disc", "rx")
    return model


@pytest.mark.slow
def test_rotors_in_all_their_numbers():
    model = rotor()
    system = model.linearize()
    assert system.gyroscopic is not None
    names = ["bearing.stiffness.x", "bearing.stiffness.ry", "bearing.damping.rx", "disc.mass", "spin.speed",
             "disc.position.z", "disc.inertia.zz", "bearing.position.z"]  # fmt: skip
    result = system.eigenvalue_sensitivities(names)
    values = system.modes().eigenvalues
    for row, name in zip(result, names, strict=True):
        expected, step = difference(model, system, name, eigenvalues), step_of(system.parameters, name)
        assert_derivative(row, expected, values, step, 1e-7)
    w = np.array([5.0, 40.0, 200.0])
    for row, name in zip(system.frequency_response_sensitivities(w, names), names, strict=True):
        expected = difference(model, system, name, lambda s: s.frequency_response(w))
        assert np.abs(row - expected).max() <= 1e-7 * np.abs(expected).max() + 1e-15


@pytest.mark.slow
def test_shapes_norms_and_time_responses_beside_a_rotor():
    """A housing on dampers in all directions, with something that spins in it."""
    model = mv.Model("housing")
    model.add_body("disc", 5.0, (0.25, 0.25, 0.4))
    model.add_bushing("bearing", "ground", "disc", (0, 0, 0.1), (3e4, 2e4, 5e4, 4e3, 3e3, 2e3),
                      damping=(30.0, 20.0, 50.0, 4.0, 3.0, 5.0))  # fmt: skip
    model.add_rotor("spin", "disc", 300.0, axis=(0, 0, 1), inertia=0.05)
    model.add_input("push", "disc", "x")
    model.add_output("tilt", "disc", "rx")
    model.add_output("way", "disc", "x")
    system = model.linearize()
    names = ["disc.mass", "spin.speed", "bearing.stiffness.x", "bearing.damping.ry"]
    t = np.linspace(0.0, 0.3, 31)
    u = np.sin(40.0 * t)[None]
    result = system.time_response_sensitivities(t, u, names)
    start = system.modes().shapes

    def aligned(changed):
        shapes = changed.modes().shapes
        phase = np.einsum("im,ij,jm->m", start.conj(), system.M, shapes)
        return shapes * (np.abs(phase) / phase)

    for row, name in zip(system.mode_sensitivities(names).shapes, names, strict=True):
        expected = difference(model, system, name, aligned)
        assert np.abs(row - expected).max() <= 1e-7 * np.abs(start).max()
    norms = {"hinf_norm": system.hinf_norm(parameters=names), "h2_norm": system.h2_norm(parameters=names)}
    for k, name in enumerate(names):
        expected = difference(model, system, name, lambda s: s.time_response(t, u))
        assert np.abs(result[k] - expected).max() <= 1e-6 * np.abs(expected).max() + 1e-13
        for kind, norm in norms.items():
            slope = difference(model, system, name, lambda s, kind=kind: getattr(s, kind)(parameters=[]).value)
            assert norm.slopes[k] == pytest.approx(slope, rel=1e-5)


@pytest.mark.slow
def test_a_number_that_no_neighbour_has_is_none():
    """A rotor is round and turns about an axis of its own: what changes that has no neighbour."""
    system = rotor().linearize()
    with pytest.raises(mv.ModelError, match=r"do not change smoothly with 'disc\.inertia\.xx' \("):
        system.eigenvalue_sensitivities("disc.inertia.xx")
    every = dict(zip(system.parameters, system.eigenvalue_sensitivities(), strict=True))
    lost = {name.partition(".")[2] for name, row in every.items() if np.isnan(row).any() and name.startswith("disc")}
    assert {"inertia.xx", "inertia.xy", "orientation.rx", "position.x"} <= lost
    assert not lost & {"mass", "inertia.zz", "position.z", "orientation.rz"}


def test_numbers_that_change_together_have_a_neighbour():
    """Both moments of a rotor at once; many parameters of one variable cost no more than one."""
    model = rotor()
    system = model.linearize()
    both = {"across": {"disc.inertia.xx": 1.0, "disc.inertia.yy": 1.0, "bearing.stiffness.x": 1e4}}
    result = system.eigenvalue_sensitivities(both)[0]

    def at(change):
        values = {name: model.parameters[name] + rate * change for name, rate in both["across"].items()}
        return model.with_values(values).linearize().modes().eigenvalues

    h = 1e-4
    expected = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
    assert np.abs(result - expected).max() <= 1e-8 * np.abs(expected).max()
    assert len(system.sensitivity_basis.variants._slopes) == 1


def geared():
    """Two shafts on a gear, each with its spring."""
    model = mv.Model("geared")
    for k, at in enumerate((0.0, 1.0)):
        model.add_body(f"wheel{k}", 1.0, (0.2, 0.2, 0.2 + 0.1 * k), position=(at, 0, 0))
        model.add_joint(f"shaft{k}", "revolute", "ground", f"wheel{k}", position=(at, 0, 0), axis=(0, 0, 1))
        model.add_bushing(f"spring{k}", "ground", f"wheel{k}", (at, 0, 0), (0, 0, 0, 0, 0, 10.0 + k),
                          damping=(0, 0, 0, 0, 0, 0.1))  # fmt: skip
    model.add_gear("gear", "shaft0.rz", "shaft1.rz", ratio=-2.0)
    model.add_input("twist", "wheel0", "rz")
    model.add_output("turn", "wheel1", "rz")
    return model


def relaxing():
    """A mass on a spring, a Maxwell element beside it."""
    model = mv.Model("relaxing")
    model.add_body("mass", 2.0, (0.1, 0.1, 0.1))
    model.add_joint("way", "prismatic", "ground", "mass", position=(0, 0, 0), axis=(0, 0, 1))
    model.add_maxwell("leg", "ground", "mass", (0, 0, -1), (0, 0, 0), stiffness=300.0, damping=12.0,
                      static_stiffness=100.0)  # fmt: skip
    model.add_input("push", "mass", "z")
    model.add_output("move", "mass", "z")
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize(("make", "names"), [
    (geared, ["gear.ratio", "wheel0.mass", "wheel1.inertia.zz", "spring0.stiffness.rz", "shaft1.position.x"]),
    (relaxing, ["leg.stiffness", "leg.damping", "leg.static_stiffness", "mass.mass", "leg.start.z", "leg.start.x"]),
])  # fmt: skip
def test_couplers_and_relaxation(make, names):
    model = make()
    system = model.linearize()
    result, values = system.eigenvalue_sensitivities(names), system.modes().eigenvalues
    w = np.array([0.0, 2.0, 9.0, 30.0])
    responses = system.frequency_response_sensitivities(w, names)
    for k, name in enumerate(names):
        step = step_of(system.parameters, name)
        assert_derivative(result[k], difference(model, system, name, eigenvalues), values, step, 1e-7)
        expected = difference(model, system, name, lambda s: s.frequency_response(w))
        assert np.abs(responses[k] - expected).max() <= 1e-7 * np.abs(expected).max() + 1e-12


def test_gear_in_closed_form():
    """lambda^2 (I0 + I1 r^2) + lambda (c0 + c1 r^2) + k0 + k1 r^2 = 0, r = 1 / ratio or the ratio itself."""
    system = geared().linearize()
    turns = system.body_motion[:, 5, 0]
    square = float(turns[1] / turns[0]) ** 2
    assert square == pytest.approx(0.25) or square == pytest.approx(4.0)
    rate = 2 * square / -2.0 * (1.0 if square > 1.0 else -1.0)  # of r^2 with the ratio, -2
    for lead, result in zip(system.modes().eigenvalues, system.eigenvalue_sensitivities("gear.ratio")[0], strict=True):
        full = lead**2 * (0.2 + 0.3 * square) + lead * (0.1 + 0.1 * square) + 10.0 + 11.0 * square
        assert abs(full) < 1e-12
        along = lead**2 * 0.3 + lead * 0.1 + 11.0
        slope = 2 * lead * (0.2 + 0.3 * square) + 0.1 + 0.1 * square
        assert result == pytest.approx(-along * rate / slope, rel=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("start", [None, ([0.01], [0.2])])
def test_relaxation_in_time_and_norms(start):
    """The Maxwell element's force has a state of its own, without a velocity."""
    model = relaxing()
    model.add_output("rate", "mass", "z", quantity="velocity")
    model.add_force_output("pull", "leg")
    system = model.linearize()
    assert system.massless == 1
    names = ["leg.stiffness", "leg.damping", "leg.static_stiffness", "mass.mass", "leg.start.x"]
    t = np.linspace(0.0, 2.0, 41)
    u = np.sin(7.0 * t)[None]
    if start is not None:
        at = dict(zip(system.coordinates, (0.01, 0.004), strict=True))
        start = [at[name] for name in system.coordinates], [0.2, 0.0]
    result = system.time_response_sensitivities(t, u, names, initial=start)
    for k, name in enumerate(names):
        expected = difference(model, system, name, lambda s: s.time_response(t, u, initial=start))
        assert np.abs(result[k] - expected).max() <= 1e-7 * np.abs(expected).max() + 1e-9
    for kind in ("hinf_norm", "h2_norm") if start is None else ():
        norm = getattr(system, kind)("move", "push", names)
        for k, name in enumerate(names):
            slope = difference(model, system, name, lambda s, kind=kind: getattr(s, kind)("move", "push", []).value)
            assert norm.slopes[k] == pytest.approx(slope, rel=1e-6, abs=1e-12)


def nodes():
    """Two nodes without mass between springs and dampers, beside a mass that they never move."""
    model = mv.Model("nodes")
    model.add_body("mass", 2.0, (0.1, 0.1, 0.1))
    model.add_joint("way", "prismatic", "ground", "mass", position=(0, 0, 0), axis=(0, 0, 1))
    model.add_spring("leg", "ground", "mass", (0, 0, -1), (0, 0, 0), 300.0)
    for k in (1, 2):
        model.add_body(f"node{k}", 0.0, (0, 0, 0), position=(k, 0, 0))
        model.add_joint(f"way{k}", "prismatic", "ground", f"node{k}", position=(k, 0, 0), axis=(0, 0, 1))
        model.add_spring(f"foot{k}", "ground", f"node{k}", (k, 0, -1), (k, 0, 0), 100.0 * k * k, damping=5.0 * k)
    model.add_spring("tie", "node1", "node2", (1, 0, 0), (2, 0, 0.5), 80.0, damping=2.0)
    return model


@pytest.mark.parametrize(("make", "names"), [
    (relaxing, ["leg.stiffness", "leg.damping", "mass.mass"]), (nodes, ["foot1.damping", "tie.stiffness", "mass.mass"]),
])  # fmt: skip
def test_shapes_with_motions_without_mass(make, names):
    """With x^H M x and the phase kept; where no mass moves, the largest entry."""
    model = make()
    system = model.linearize()
    modes, result = system.modes(), system.mode_sensitivities(names).shapes
    x = modes.shapes
    norm = np.einsum("im,ij,jm->m", x.conj(), system.M, x).real
    for k, name in enumerate(names):
        expected = difference(model, system, name, lambda s: s.modes().shapes)
        with np.errstate(all="ignore"):  # shapes() turns each to have its largest entry real
            turned = np.einsum("im,ij,jm->m", x.conj(), system.M, expected).imag / norm
        expected = expected - 1j * x * np.where(norm > 0.5, turned, 0.0)
        assert np.abs(result[k] - expected).max() <= 1e-9 * max(np.abs(expected).max(), 1.0)


def test_matrices_in_coordinates_that_massless_motions_move():
    """A mass rides on a node without mass: one coordinate stays, whose share of the motion springs decide."""
    model = mv.Model("riding")
    model.add_body("node", 0.0, (0, 0, 0))
    model.add_body("mass", 2.0, (0.1, 0.1, 0.1), position=(0, 0, 1))
    model.add_joint("foot", "prismatic", "ground", "node", position=(0, 0, 0), axis=(0, 0, 1))
    model.add_joint("ride", "prismatic", "node", "mass", position=(0, 0, 0.5), axis=(0, 0, 1))
    model.add_spring("low", "ground", "node", (0, 0, -1), (0, 0, 0), 300.0)
    model.add_spring("high", "node", "mass", (0, 0, 0), (0, 0, 1), 200.0)
    model.add_output("rise", "mass", "z")
    system = model.linearize()
    own, other = (300.0, 200.0) if system.coordinates == ("foot.z",) else (200.0, 300.0)
    share = (own + other) / other  # of the mass's motion in the coordinate's
    assert system.M[0, 0] == pytest.approx(2.0 * share**2)
    changes = system.matrix_derivatives(["low.stiffness", "high.stiffness"])
    rates = np.array([1.0, -own / other]) / other
    if system.coordinates != ("foot.z",):
        rates = rates[::-1]
    assert changes.M[:, 0, 0] == pytest.approx(4.0 * share * rates, rel=1e-9)
    assert changes.Cq[:, 0, 0] == pytest.approx(rates, rel=1e-9)
    stiffness = own * (own + other) / other
    assert system.K[0, 0] == pytest.approx(stiffness)
    ahead = np.array([2.0 * own / other + 1.0, -((own / other) ** 2)])
    assert changes.K[:, 0, 0] == pytest.approx(ahead if system.coordinates == ("foot.z",) else ahead[::-1], rel=1e-9)
    values = system.eigenvalue_sensitivities(["low.stiffness", "high.stiffness"])[:, 0]
    both = 1.0 / (1.0 / 300.0 + 1.0 / 200.0)
    expected = 0.5j * np.sqrt(both / 2.0) * both / np.array([300.0, 200.0]) ** 2
    assert np.abs(values) == pytest.approx(np.abs(expected), rel=1e-12)
