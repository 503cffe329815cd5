"""Bushings whose stiffness depends on frequency, in every engine, against K(w) itself."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements.dynamic_bushing import DynamicBushing
from mbsvib.errors import ModelError

OMEGA = 2 * np.pi * np.geomspace(0.1, 300.0, 40)
FACTOR = mv.Dynamic.of_words({"static": 0.9, "viscous": 1e-4, "weights": [0.8, 0.3], "times": [0.02, 1e-3]})
SIX = (6e3, 4e3, 5e3, 30.0, 40.0, 50.0)
DAMPING = (1.0, 1.0, 1.0, 0.1, 0.1, 0.1)
AXES = (0.1, 0.2, 0.3)
FORCE = np.array((1.0, 2.0, 3.0, 0.1, 0.2, 0.3))  # direction of the force that is an output
SIZES = np.array([30.0] * 3 + [3.0] * 3)


def _square(rank, seed):
    """A matrix of this rank without negative eigenvalues."""
    root = np.random.default_rng(seed).standard_normal((6, rank)) * SIZES[:, None]
    return root @ root.T


KINDS = {"six": (SIX, None), "matrix": (_square(6, 1), None), "part of it": (SIX, _square(3, 2)),
         "all of a part": (SIX, _square(6, 3)), "along two axes": ((6e3, 0.0, 5e3, 0.0, 0.0, 0.0), None)}  # fmt: skip


def hinged(**mount):
    """Two hinged bodies on a soft bushing, with a mount between them."""
    model = mv.Model("hinged", gravity=mount.pop("gravity", None))
    model.add_body("b", 2.0, (0.01, 0.02, 0.03), position=(0.1, 0.2, 0.3))
    model.add_body("c", 1.0, (0.01, 0.02, 0.03), position=(0.4, 0.2, 0.3))
    model.add_joint("j", "revolute", "b", "c", position=(0.25, 0.2, 0.3), axis=(0, 1, 0))
    model.add_bushing("base", "ground", "b", (0, 0, 0), (1e4, 1e4, 1e4, 100, 100, 100))
    model.add_bushing("mount", "b", "c", (0.3, 0.1, 0.3), orientation=AXES, **mount)
    model.add_input("F", "b", "x")
    model.add_input("T", "c", "ry")
    model.add_output("x", "c", "x")
    model.add_force_output("f", "mount", FORCE)
    return model


def mounted(kind, **more):
    stiffness, acting = KINDS[kind]
    return hinged(stiffness=stiffness, damping=DAMPING, dynamic=FACTOR, dynamic_stiffness=acting, **more)


def expected(kind):
    """Responses by K(w) on the six relative displacements of the mount."""
    stiffness, acting = KINDS[kind]
    k = np.diag(stiffness) if np.ndim(stiffness) == 1 else stiffness
    acting = k if acting is None else acting
    model = hinged(stiffness=(1.0,) * 6)
    for direction in ("x", "y", "z", "rx", "ry", "rz"):
        model.add_force_output(f"f{direction}", "mount", direction)
    unit = model.linearize()
    rows = unit.Cq[2:]  # forces of unit stiffness: displacements
    bare, result = unit.K - rows.T @ rows, []
    for w in OMEGA:
        s = 1j * w
        factor = 0.9 + 1e-4 * s + 0.8 * 0.02 * s / (1 + 0.02 * s) + 0.3 * 1e-3 * s / (1 + 1e-3 * s)
        dynamic = k + s * np.diag(DAMPING) + (factor - 1.0) * acting
        q = np.linalg.solve(bare - w**2 * unit.M + rows.T @ dynamic @ rows, unit.B)
        result.append(np.vstack((unit.Cq[:1] @ q, FORCE @ dynamic @ rows @ q)))
    return np.array(result).transpose(1, 2, 0)


def test_a_mass_on_rubber_has_the_closed_form():
    model = mv.Model("mass")
    model.add_body("b", 2.0, (0.01, 0.02, 0.03))
    model.add_bushing("mount", "ground", "b", (0, 0, 0), SIX, DAMPING, dynamic=FACTOR)
    model.add_input("F", "b", "x")
    model.add_output("x", "b", "x")
    model.add_force_output("f", "mount", "x")
    system = model.linearize()
    z = SIX[0] * FACTOR.factor(OMEGA) + 1j * OMEGA * DAMPING[0]
    x = 1.0 / (z - 2.0 * OMEGA**2)
    np.testing.assert_allclose(system.frequency_response(OMEGA)[:, 0], [x, z * x], rtol=1e-12)
    assert (system.dof, system.massless) == (18, 12)
    assert system.coordinates[:3] == ("mount.1.x", "mount.1.y", "mount.1.z")
    assert (system.modes().eigenvalues.real < 0.0).all()


@pytest.mark.few(3)
@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("kind", KINDS)
def test_responses_are_those_of_the_stiffness_over_frequency(kind, method):
    found = mounted(kind).linearize(method=method).frequency_response(OMEGA)
    reference = expected(kind)
    size = np.abs(reference).max(axis=2, keepdims=True)
    np.testing.assert_allclose(found / size, reference / size, rtol=0.0, atol=1e-12)


# Storage and loss modulus [MPa] of an encapsulant of solar cells at frequencies [Hz], and relaxations that ANSYS fitted
# to 207 such lines, of 10 GPa at infinite rates: NREL, pyvisco (BSD), verification/freq_master. Slower relaxations are
# springs in this band, faster ones nothing.
MEASURED = ((0.054954087, 236.74371, 77.787201), (0.54954087, 332.74039, 133.61940), (7.3564244, 535.78745, 230.26821),
            (100.0, 980.64568, 399.74809), (1764.6833, 1873.9996, 626.09584))  # fmt: skip
TIMES = 10.0 ** np.arange(-7, 3)
WEIGHTS = (1.278265e-01, 1.122721e-01, 1.058426e-01, 8.257810e-02, 5.878237e-02, 3.324423e-02, 1.689701e-02,
           8.525463e-03, 5.128475e-03, 2.758083e-03)  # fmt: skip
SLOWER = (1.795369e-03, 1.273037e-03, 7.458665e-04, 6.517169e-04, 4.336524e-04, 1.917254e-04, 2.279449e-04,
          8.885844e-04, 8.961819e-03)  # fmt: skip


@pytest.mark.parametrize("own", [False, True])
def test_a_published_table_of_relaxations_and_a_fit_of_our_own_have_the_measured_stiffness(own):
    f, storage, loss = np.array(MEASURED).T
    modulus = 1e6 * (storage + 1j * loss)
    rubber = mv.Dynamic.of_words({"static": sum(SLOWER), "weights": WEIGHTS, "times": TIMES})
    rubber = mv.Dynamic.table(f, modulus / 1e10).rational((f[0], f[-1])) if own else rubber
    model = mv.Model("block")
    model.add_body("b", 2.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "b", position=(0, 0, 0), axis=(0, 0, 1))
    model.add_bushing("pad", "ground", "b", (0, 0, 0), (0, 0, 1e7, 0, 0, 0), dynamic=rubber)  # 1 mm by 1 mm and 1 m
    model.add_input("F", "b", "z")
    model.add_output("z", "b", "z")
    response = model.linearize().frequency_response(2 * np.pi * f)[0, 0]
    stiffness = 1.0 / response + 2.0 * (2 * np.pi * f) ** 2
    np.testing.assert_allclose(stiffness, 1e-3 * modulus, rtol=1.001 * rubber.error if own else 0.13)


@pytest.mark.slow
def test_runs_take_the_energy_that_the_input_gives_and_follow_the_linear_model():
    model = mounted("part of it")
    model.add_output("v", "b", "x", quantity="velocity")
    t = np.linspace(0.0, 0.4, 801)
    force = 1e-2 * np.sin(50.0 * t) ** 2
    run = model.simulate(t, {"F": force}, tolerance=1e-10)
    linear = model.linearize().time_response(t, np.array([force, 0 * force]), hold="first")
    for name, row in zip(("x", "f"), linear, strict=False):
        np.testing.assert_allclose(run[name], row, rtol=0.0, atol=2e-4 * np.abs(row).max())
    power = force * run["v"]
    given = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(t) * (power[1:] + power[:-1]))))
    np.testing.assert_allclose(run.energy.total + run.energy.dissipated, given, rtol=0.0, atol=1e-4 * given.max())
    assert (np.diff(run.energy.dissipated) >= 0.0).all()
    assert run.energy.dissipated[-1] > 0.01 * given.max()


@pytest.mark.slow
def test_files_batches_and_compiled_plants(tmp_path):
    model = mounted("all of a part")
    for suffix in ("yaml", "json"):
        again = mv.load(mv.save(model, tmp_path / f"model.{suffix}"))
        assert again.springs == model.springs
        assert hash(again.springs["mount"]) == hash(model.springs["mount"])
    names = ["mount.g1", "mount.tau2", "mount.stiffness.x", "mount.dynamic_stiffness.x", "mount.position.z"]
    nominal = [model.parameters[name] for name in names]
    values = {name: [x, 1.01 * x] for name, x in zip(names, nominal, strict=True)}
    batch = model.linearize(values=values)
    one = model.with_values({name: pair[1] for name, pair in values.items()})
    plant = model.compile(parameters=names)
    for key in ("M", "C", "K", "B", "Cq", "Cv"):
        for row, system in ((0, model.linearize()), (1, one.linearize())):
            np.testing.assert_allclose(getattr(batch[row], key), getattr(system, key), rtol=1e-12, atol=1e-9)
            compiled = plant([values[name][row] for name in plant.names])
            np.testing.assert_allclose(getattr(compiled, key), getattr(system, key), rtol=1e-12, atol=1e-9)


def test_derivatives_are_those_of_the_closed_form():
    """d x / d p = -x^2 dz / dp of a mass on a mount, z of the stiffness over frequency."""
    model = mv.Model("mass")
    model.add_body("b", 2.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "b", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_bushing("mount", "ground", "b", (0, 0, 0), SIX, DAMPING, dynamic=FACTOR)
    model.add_input("F", "b", "x")
    model.add_output("x", "b", "x")
    model.add_force_output("f", "mount", "x")
    system, s, k = model.linearize(), 1j * OMEGA, SIX[0]
    slopes = {"mount.g1": k * 0.02 * s / (1 + 0.02 * s), "mount.tau2": k * 0.3 * s / (1 + 1e-3 * s) ** 2,
              "mount.stiffness.x": FACTOR.factor(OMEGA), "mount.damping.x": s}  # fmt: skip
    z = k * FACTOR.factor(OMEGA) + s * DAMPING[0]
    x = 1.0 / (z - 2.0 * OMEGA**2)
    found = system.frequency_response_sensitivities(OMEGA, list(slopes))
    for row, slope in zip(found, slopes.values(), strict=True):
        for value, expected in zip(row[:, 0], (-(x**2) * slope, x * slope - z * x**2 * slope), strict=True):
            np.testing.assert_allclose(value / np.abs(expected).max(), expected / np.abs(expected).max(), atol=1e-11)


@pytest.mark.parametrize("name", ["mount.position.x", "mount.orientation.ry"])
def test_derivatives_to_the_place_are_differences_of_variants(name):
    model, step = mounted("all of a part"), 1e-5
    found = model.linearize().frequency_response_sensitivities(OMEGA, [name])[0]
    at = [model.with_values({name: model.parameters[name] + side * step}).linearize().frequency_response(OMEGA)
          for side in (-1.0, 1.0)]  # fmt: skip
    expected = (at[1] - at[0]) / (2.0 * step)
    size = np.abs(expected).max(axis=2, keepdims=True)
    np.testing.assert_allclose(found / size, expected / size, rtol=0.0, atol=1e-6)


@pytest.mark.slow
def test_a_fit_finds_the_relaxations():
    def mass(k, weights, times):
        model = mv.Model("mass")
        model.add_body("b", 2.0, (1, 1, 1))
        model.add_joint("rail", "prismatic", "ground", "b", position=(0, 0, 0), axis=(1, 0, 0))
        rubber = mv.Dynamic.prony(weights, times)
        model.add_bushing("mount", "ground", "b", (0, 0, 0), (k, 0, 0, 0, 0, 0), dynamic=rubber)
        model.add_input("F", "b", "x")
        model.add_output("x", "b", "x")
        return model

    z = 6e3 * mv.Dynamic.prony([0.8, 0.3], [0.02, 1e-3]).factor(OMEGA)
    x = (1.0 / (z - 2.0 * OMEGA**2)).reshape(1, 1, -1)
    data = mv.Measurement(OMEGA, x, ("x",), ("F",), variance=(1e-3 * np.abs(x)) ** 2)
    fit = mass(4e3, [0.5, 0.5], [0.01, 3e-3]).fit(data, free=["mount.stiffness.x", "mount.g*", "mount.tau*"])
    found = [fit.values[f"mount.{name}"] for name in ("stiffness.x", "g1", "g2", "tau1", "tau2")]
    np.testing.assert_allclose(found, [6e3, 0.8, 0.3, 0.02, 1e-3], rtol=1e-3)


def test_it_is_its_bushing_at_rest():
    """Under loads: poses of equilibrium, forces and responses without relaxations are those of a plain bushing."""
    plain, dynamic = ({"stiffness": SIX, "damping": DAMPING, "preload": (5, -3, 25, 0.3, 0.2, -0.1), "dynamic": factor,
                       "gravity": (0, 0, -9.81)} for factor in (None, mv.Dynamic.prony([], [])))  # fmt: skip
    there = [hinged(**words).equilibrium() for words in (plain, dynamic)]
    assert isinstance(there[1].springs["mount"], DynamicBushing)
    one, other = (model.linearize().frequency_response(OMEGA) for model in there)
    np.testing.assert_allclose(one, other, rtol=1e-13)
    relaxing = hinged(**dynamic | {"dynamic": mv.Dynamic.prony([0.8], [0.02])}).equilibrium()
    np.testing.assert_allclose(relaxing.bodies["c"].position, there[0].bodies["c"].position, rtol=1e-12)
    static = relaxing.linearize().frequency_response([0.0])
    np.testing.assert_allclose(static, there[0].linearize().frequency_response([0.0]), rtol=1e-9)


def test_in_another_pose_the_relaxations_turn_along_and_are_relaxed():
    """K_d as a damping of the same numbers does."""
    model = mounted("six").moved({"j.rz": 0.3}, relaxed=False)
    mount = model.springs["mount"]
    plain = hinged(stiffness=SIX, damping=DAMPING).moved({"j.rz": 0.3}, relaxed=False).springs["mount"]
    np.testing.assert_allclose(mount.preload, 0.9 * np.array(plain.preload), rtol=1e-12)
    np.testing.assert_allclose(mount.damping, plain.damping, rtol=1e-12, atol=1e-12)
    # the tangent is linear in stiffness, so that of 0.9 K is 0.9 times that of K
    np.testing.assert_allclose(np.array(mount.rest_stiffness), 0.9 * np.array(plain.stiffness), rtol=1e-12, atol=1e-9)
    rates = hinged(stiffness=SIX, damping=SIX).moved({"j.rz": 0.3}, relaxed=False).springs["mount"].damping
    np.testing.assert_allclose(mount.dynamic_stiffness, rates, rtol=1e-12, atol=1e-9)
    relaxed = mounted("six").moved({"j.rz": 0.3}, relaxed=True).springs["mount"]
    assert (relaxed.stiffness, relaxed.dynamic_stiffness, relaxed.preload) == (SIX, None, None)


@pytest.mark.parametrize("kind", ["matrix", "part of it"])
def test_copies_turn_along_and_mirror(kind):
    model, whole = mounted(kind), mv.Model("whole")
    whole.add_model("left", model, position=(1, 2, 3), orientation=(0.3, -0.2, 0.5))
    whole.add_model("right", model, mirror="y")
    found = whole.linearize().frequency_response(OMEGA)
    alone = model.linearize().frequency_response(OMEGA)
    size = np.abs(alone).max(axis=2, keepdims=True)
    for rows in (slice(0, 2), slice(2, 4)):
        np.testing.assert_allclose(found[rows, rows] / size, alone / size, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("ends", [("ground", "b"), ("b", "ground")])
def test_a_floor_that_moves(ends):
    """Transmissibility z / (z - m w^2), and the force in the mount m w^2 x."""
    model = mv.Model("mass")
    model.add_body("b", 2.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "b", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_bushing("mount", *ends, (0, 0, 0), SIX, DAMPING, dynamic=FACTOR)
    model.add_motion_input("floor", "mount", direction="x")
    model.add_output("x", "b", "x")
    model.add_force_output("f", "mount", "x")
    z = SIX[0] * FACTOR.factor(OMEGA) + 1j * OMEGA * DAMPING[0]
    x = z / (z - 2.0 * OMEGA**2)
    f = (1.0 if ends[0] == "ground" else -1.0) * 2.0 * OMEGA**2 * x
    for method in ("dense", "sparse"):
        found = model.linearize(method=method).frequency_response(OMEGA)
        np.testing.assert_allclose(found[0, 0], x, rtol=1e-11)
        np.testing.assert_allclose(found[1, 0] / np.abs(f), f / np.abs(f), rtol=0.0, atol=1e-8)


def test_a_sparse_system_of_forces_alone_keeps_what_carries_them():
    model = mounted("six")
    model.add_body("apart", 1.0, (1, 1, 1), position=(3, 0, 0))
    model.add_bushing("far", "ground", "apart", (3, 0, 0), SIX)
    model.add_input("other", "apart", "x")
    system = model.linearize(method="sparse")
    own = system.reachable("f", ["F", "other"]).frequency_response(OMEGA)
    np.testing.assert_allclose(own[0, 0], system.frequency_response(OMEGA)[1, 0], rtol=1e-9)
    assert not own[0, 1].any()
    assert np.abs(own[0, 0]).min() > 0.0


def test_bearings_of_what_spins():
    """Whichever end is named first: nodes are on the ground, as none is carried by what spins."""
    found = []
    for ends in (("ground", "rotor"), ("rotor", "ground")):
        model = mv.Model("rotor")
        model.add_body("rotor", 2.0, (0.02, 0.02, 0.03))
        model.add_rotor("spin", "rotor", speed=500.0, axis=(0, 0, 1))
        for name, z in (("left", -0.1), ("right", 0.2)):
            model.add_bushing(name, *ends, (0, 0, z), (1e4, 1e4, 1e4, 0, 0, 0), dynamic=FACTOR)
        model.add_input("F", "rotor", "x")
        model.add_output("x", "rotor", "x")
        model.add_output("tilt", "rotor", "rx")
        found.append(model.linearize().frequency_response(OMEGA))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)
    # shifts x, y and turns rx, ry of a gyroscope on K(w)
    z = 1e4 * FACTOR.factor(OMEGA)
    for k, w in enumerate(OMEGA):
        matrix = np.diag([2 * z[k] - 2 * w**2] * 2 + [(0.01 + 0.04) * z[k] - 0.02 * w**2] * 2)
        matrix[0, 3] = matrix[3, 0] = 0.1 * z[k]
        matrix[1, 2] = matrix[2, 1] = -0.1 * z[k]
        matrix[2, 3], matrix[3, 2] = 1j * w * 0.03 * 500.0, -1j * w * 0.03 * 500.0
        x = np.linalg.solve(matrix, [1.0, 0.0, 0.0, 0.0])
        np.testing.assert_allclose(found[0][:, 0, k], x[[0, 2]], rtol=1e-9)


def _mount(**words):
    return hinged(**{"stiffness": SIX, "dynamic": FACTOR} | words)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: _mount(dynamic=mv.Dynamic.hysteretic(0.1)), "'mount': dynamic = .*loss factor 0.1.*no states.*rational"),
    (lambda: _mount(dynamic=0.1), "'mount': dynamic = 0.1; expected an mv.Dynamic"),
    (lambda: _mount(dynamic=None, dynamic_stiffness=SIX), "dynamic_stiffness is given without dynamic"),
    (lambda: _mount(stiffness=(-1e3, 0, 0, 0, 0, 0)), "'mount': stiffness = .*without negative eigenvalues"),
    (lambda: _mount(stiffness=np.diag(SIX) + np.triu(np.ones((6, 6)), 1)), "'mount': stiffness = .*symmetric"),
    (lambda: _mount(dynamic_stiffness=(0,) * 6), "'mount': dynamic_stiffness = .*not zero"),
    (lambda: _mount(dynamic={"weights": [1.0], "times": [1.0], "statc": 1.0}), "'statc' is not a word of it.*static"),
])  # fmt: skip
def test_what_no_mount_is_is_refused(make, words):
    with pytest.raises(ModelError, match=f"(?s){words}"):
        make()


def test_names_of_nodes_are_taken():
    model = mounted("six")
    with pytest.raises(ModelError, match=r"'mount\.2\.node'"):
        model.add_body("mount.2.node", 1.0, (1, 1, 1))
    other = hinged(stiffness=SIX)
    other.add_joint("seat.1", "fixed", "ground", "b", position=(0, 0, 0))
    with pytest.raises(ModelError, match=r"'seat\.1'"):
        other.add_bushing("seat", "ground", "b", (0, 0, 0), SIX, dynamic=FACTOR)
    assert "seat" not in other.springs
