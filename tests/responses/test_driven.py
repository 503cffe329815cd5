"""Motions as inputs against the quarter car by hand, a heavy ground, and exponentials in extended precision."""

import copy
import pickle

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import quad

import mbsvib as mv
from mbsvib.errors import ModelError, ResponseError
from mbsvib.files import load, save

WHEEL, BODY, STRUT, ABSORBER, TYRE = 40.0, 400.0, 2e4, 1500.0, 2e5
QUANTITIES = ("displacement", "velocity", "acceleration")
OMEGA, INERTIA = np.array([1.0, 8.0, 60.0, 500.0]), (1.0, 1.0, 1.0)


def quarter(quantity="displacement", damping=200.0, kind="spring", turned=False, heavy=None):
    model = mv.Model("quarter car")
    model.add_body("wheel", WHEEL, INERTIA, (0, 0, 0.3))
    model.add_body("body", BODY, INERTIA, (0, 0, 0.8))
    model.add_joint("axle", "prismatic", "ground", "wheel", (0, 0, 0.3), axis=(0, 0, 1))
    model.add_joint("guide", "prismatic", "wheel", "body", (0, 0, 0.8), axis=(0, 0, 1))
    model.add_spring("strut", "wheel", "body", (0, 0, 0.3), (0, 0, 0.8), stiffness=STRUT, damping=ABSORBER)
    ground = "ground"
    if heavy is not None:
        ground = "road"
        model.add_body("road", heavy, INERTIA, (0, 0, 0))
        model.add_joint("bed", "prismatic", "ground", "road", (0, 0, 0), axis=(0, 0, 1))
        model.add_input("push", "road", "z")
    ends = (ground, "wheel", (0, 0, 0), (0, 0, 0.3))
    if turned:
        ends = ("wheel", ground, (0, 0, 0.3), (0, 0, 0))
    if kind == "spring":
        model.add_spring("tyre", *ends, stiffness=TYRE, damping=damping)
    elif kind == "maxwell":
        model.add_maxwell("tyre", *ends, stiffness=1e5, damping=damping, static_stiffness=TYRE)
    else:
        model.add_bushing("tyre", *ends[:2], (0, 0, 0), stiffness=(1e4, 1e4, TYRE, 0, 0, 0),
                          damping=(0, 0, damping, 0, 0, 0))
    if heavy is None:
        model.add_motion_input("road", "tyre", quantity)
    for quantity in QUANTITIES:
        model.add_output(quantity, "body", "z", quantity=quantity)
    model.add_force_output("tyre force", "tyre")
    return model


def by_hand(omega, order, damping=200.0, kind="spring"):
    """Displacement, velocity, acceleration of the body, force in the tyre by the road."""
    result = []
    for s in 1j * np.asarray(omega):
        tyre = TYRE + (damping * s if kind != "maxwell" else 1e5 * damping * s / (1e5 + damping * s))
        strut = STRUT + ABSORBER * s
        matrix = [[WHEEL * s * s + strut + tyre, -strut], [-strut, BODY * s * s + strut]]
        wheel, body = np.linalg.solve(matrix, [tyre, 0.0])
        result.append(np.array([body, s * body, s * s * body, (wheel - 1.0) * tyre]) / s**order)
    return np.array(result).T


@pytest.mark.few(9)
@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("kind", ["spring", "bushing", "maxwell"])
@pytest.mark.parametrize("order", range(3))
def test_frequency_responses_are_those_by_hand(order, kind, turned, method):
    system = quarter(QUANTITIES[order], kind=kind, turned=turned).linearize(method=method)
    expected = by_hand(OMEGA, order, kind=kind)
    if kind == "bushing" and turned:  # its force is counted from the wheel to the ground
        expected[3] *= -1.0
    np.testing.assert_allclose(system.frequency_response(OMEGA)[:, 0], expected, rtol=1e-11)
    assert system.inputs == ("road",)
    assert system.input_units == (("m", "m/s", "m/s^2")[order],)


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
@pytest.mark.parametrize("order", range(3))
def test_state_spaces_have_the_same_responses_and_name_their_states(order, realization):
    system = quarter(QUANTITIES[order]).linearize()
    names = ["displacement", "velocity"] if order == 0 else list(system.outputs)
    space = system[names, :].state_space(realization)
    expected = by_hand(OMEGA, order)[: len(names)]
    np.testing.assert_allclose(space.frequency_response(OMEGA)[:, 0], expected, rtol=1e-10)
    assert space.states[4:] == ("road.displacement", "road.velocity")[:order]
    assert space.state_units[4:] == ("m", "m/s")[:order]
    if realization == "physical":  # the coordinates and rates come back, q' with its jump
        q = np.linalg.solve(1j * OMEGA[1] * np.eye(len(space.A)) - space.A, space.B)
        back = space.transform @ q + (0.0 if space.through is None else space.through)
        np.testing.assert_allclose(back[0] * 1j * OMEGA[1], back[2], rtol=1e-10)


def test_matrices_and_modes_are_those_of_the_ground_at_rest():
    still, moved = quarter(heavy=None).with_parts(inputs={}).linearize(), quarter().linearize()
    for key in "MCK":
        np.testing.assert_array_equal(getattr(moved, key), getattr(still, key))
    np.testing.assert_array_equal(moved.modes().eigenvalues, still.modes().eigenvalues)
    np.testing.assert_allclose(moved.B0.T, [[TYRE, 0.0]])
    np.testing.assert_allclose(moved.B1.T, [[200.0, 0.0]])


def with_accelerometer(**kwargs):
    model = quarter(**kwargs)
    model.add_output("on wheel", "wheel", "z", quantity="acceleration")
    return model


def test_the_body_feels_no_derivative_of_the_road():
    """The kick of the road's step is one of the wheel; the body only feels its velocity, so D is c_s c_t / (M m)."""
    np.testing.assert_allclose(quarter().linearize()["acceleration", :].state_space().D, [[1500.0 * 200.0 / 16000.0]])


@pytest.mark.parametrize("name", ["on wheel", "tyre force"])
def test_outputs_that_need_the_derivative_are_refused_by_name(name):
    system = with_accelerometer().linearize()
    message = f"output '{name}' needs the derivative of input 'road'.*quantity='velocity'"
    with pytest.raises(ResponseError, match=message):
        system[name, :].state_space()
    with pytest.raises(ResponseError, match=message):
        system.time_response([0.0, 1.0], [0.0, 0.0], outputs=name)
    undamped = with_accelerometer(damping=0.0).linearize()
    assert np.isfinite(undamped[name, :].state_space().D).all()


@pytest.mark.few(2)
@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("order", range(3))
def test_step_responses_are_those_of_the_exponential(order, hold):
    """The force c u' of a step is an impulse c / m, by which the wheel's velocity jumps."""
    mp.mp.dps = 40
    t = np.array([0.0, 0.07, 0.4])
    y = quarter(QUANTITIES[order]).linearize().time_response(t, np.ones(3), hold, outputs=["displacement", "velocity"])
    k, c = mp.matrix([[TYRE + STRUT, -STRUT], [-STRUT, STRUT]]), mp.matrix([[1700.0, -1500.0], [-1500.0, 1500.0]])
    a = mp.zeros(7)  # q, q', then u and its integrals r, r' of the acceleration
    for i, mass in enumerate((mp.mpf(WHEEL), mp.mpf(BODY))):
        a[i, 2 + i] = 1
        for j in range(2):
            a[2 + i, j], a[2 + i, 2 + j] = -k[i, j] / mass, -c[i, j] / mass
    start = mp.zeros(7, 1)
    a[2, 4] = TYRE / mp.mpf(WHEEL)
    a[2, 5] = 200.0 / mp.mpf(WHEEL)
    a[4, 5], a[5, 6] = 1, 1  # displacement, velocity, acceleration
    start[4 + order] = 1
    if order == 0:
        start[2] = 200.0 / mp.mpf(WHEEL)
    for at, column in zip(t, y.T, strict=True):
        state = mp.expm(a * mp.mpf(float(at))) * start
        np.testing.assert_allclose(column, [float(state[1]), float(state[3])], rtol=1e-9, atol=1e-13)


def test_a_heavy_ground_moves_the_end_in_the_same_way():
    """Pushed by m s^2 u the ground moves by u but for what the tyre does to it, 1e-9 of that."""
    heavy, s = 1e16, 1j * OMEGA
    pushed = quarter(heavy=heavy).linearize().frequency_response(OMEGA, inputs="push")[:, 0] * heavy * s**2
    ours = quarter().linearize().frequency_response(OMEGA)[:, 0]
    np.testing.assert_allclose(ours, pushed, rtol=1e-7)


def test_variants_and_compiled_plants_have_moving_coefficients():
    model = quarter()
    values = {"tyre.stiffness": np.array([1e5, 2e5, 3e5]), "tyre.damping": np.array([0.0, 200.0, 900.0])}
    batch = model.linearize(values=values)
    responses = batch.frequency_response(OMEGA)
    plant = model.compile(list(values))
    for i in range(3):
        variant = model.with_values({name: float(array[i]) for name, array in values.items()}).linearize()
        np.testing.assert_allclose(responses[i], variant.frequency_response(OMEGA), rtol=1e-11)
        np.testing.assert_allclose(batch[i].frequency_response(OMEGA), variant.frequency_response(OMEGA), rtol=1e-11)
        matrices = plant([values["tyre.stiffness"][i], values["tyre.damping"][i]])
        np.testing.assert_allclose(matrices.B, np.hstack((variant.B0, variant.B1)), rtol=1e-13)
        np.testing.assert_allclose(matrices.D, variant.ends.D, rtol=1e-13)
    names = ["displacement", "velocity"]
    t, u = np.linspace(0.0, 1.0, 11), np.sin(np.arange(11.0))
    part = model.with_parts(outputs={name: model.outputs[name] for name in names})
    np.testing.assert_allclose(part.linearize(values=values).time_response(t, u)[1],
                               model.linearize().time_response(t, u, outputs=names), rtol=1e-9, atol=1e-12)
    slope = plant.tangent(plant.nominal, [1.0, 0.0])
    np.testing.assert_allclose(slope.B[0], [1.0, 0.0])
    np.testing.assert_allclose(slope.D[3], [-1.0, 0.0])


@pytest.mark.parametrize("name", ["tyre.stiffness", "tyre.damping", "strut.damping", "wheel.mass"])
def test_sensitivities_take_the_moving_coefficients_along(name):
    model, h = quarter("velocity"), 1e-4
    value = model.parameters[name]
    slopes = model.linearize().frequency_response_sensitivities(OMEGA, [name])[0]
    above, below = (model.with_values({name: value * (1.0 + sign * h)}).linearize().frequency_response(OMEGA)
                    for sign in (1.0, -1.0))
    size = np.abs(slopes).max(axis=-1, keepdims=True)
    np.testing.assert_allclose(slopes / size, (above - below) / (2.0 * h * value) / size, atol=2e-6)


def test_random_vibration_and_loops_take_motions():
    system = quarter("velocity").linearize()
    noise = {"road": mv.isolation.road_spectrum("C", 20.0, "velocity")}
    f = np.geomspace(0.3, 50.0, 7)
    density = system.psd("acceleration", noise, f)[0]
    expected = np.abs(by_hand(2.0 * np.pi * f, 1)[2]) ** 2 * noise["road"].at(f)
    np.testing.assert_allclose(density, expected, rtol=1e-9)
    rms = system.rms("acceleration", noise)["acceleration"]
    low, high = noise["road"].frequencies[[0, -1]]
    square = quad(lambda x: float(np.abs(by_hand([2.0 * np.pi * np.exp(x)], 1)[2, 0]) ** 2 * np.exp(x)
                                  * noise["road"].at(np.array([np.exp(x)]))[0]),
                  np.log(low), np.log(high), limit=400, epsrel=1e-10)[0]
    np.testing.assert_allclose(rms, np.sqrt(square), rtol=1e-8)
    displaced = quarter().linearize().psd("acceleration", {"road": mv.isolation.road_spectrum("C", 20.0)}, f)[0]
    np.testing.assert_allclose(displaced, density, rtol=1e-9)
    loop = system.feedback([[-300.0]], "velocity", "road")
    space = system.state_space()
    np.testing.assert_allclose(np.sort_complex(loop.poles()), np.sort_complex(np.linalg.eigvals(
        space.A - 300.0 * space.B @ space.C[1:2])), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("order", [0, 1])
def test_loops_take_the_noise_of_sensors_and_actuators_beside_motions(order):
    model = quarter(QUANTITIES[order])
    model.add_input("force", "body", "z", relative_to="wheel")
    system = model.linearize()[list(QUANTITIES), :]
    loop = system.feedback([[-300.0]], "velocity", "force", noise=True)
    assert loop.inputs == ("road", "force", "velocity.noise", "force.noise")
    road, force = np.moveaxis(system.frequency_response(OMEGA), 1, 0)
    returned = force / (1.0 + 300.0 * force[1])
    expected = np.stack([road - 300.0 * returned * road[1], returned, -300.0 * returned, returned], axis=1)
    np.testing.assert_allclose(loop.frequency_response(OMEGA), expected, rtol=1e-9, atol=1e-15)


def test_forces_in_joints_and_on_the_ground_follow_moved_ends():
    """A lever: the moved end of a spring on its tip loads the bearing; by statics, k u at once."""
    model = mv.Model("lever")
    model.add_body("lever", 2.0, INERTIA, (1.0, 0, 0))
    model.add_joint("bearing", "revolute", "ground", "lever", (0, 0, 0), axis=(0, 1, 0))
    model.add_spring("rod", "ground", "lever", (2.0, 0, -1.0), (2.0, 0, 0), stiffness=300.0, damping=2.0)
    model.add_motion_input("end", "rod")
    model.add_force_output("bearing force", "bearing", "x")
    model.add_force_output("bearing shear", "bearing", "y")
    model.add_force_output("rod force", "rod")
    model.add_force_output("ground force", "ground", "z")
    names = model.joints["bearing"].axes
    for method in ("dense", "sparse"):
        response = model.linearize(method=method).frequency_response(OMEGA)[:, 0]
        s = 1j * OMEGA
        rod = 300.0 + 2.0 * s
        inertia = 1.0 + 2.0
        turn = 2.0 * rod / (inertia * s**2 + 4.0 * rod)  # upwards
        force = rod * (2.0 * turn - 1.0)
        np.testing.assert_allclose(response[2], force, rtol=1e-10)
        bearing = 2.0 * s**2 * turn + force  # from the bearing on the lever, upwards
        ground = -2.0 * s**2 * turn
        np.testing.assert_allclose(np.abs(response[3]), np.abs(ground), rtol=1e-10)
        seen = np.abs(np.array(names).T[:2, 2, None] * bearing)
        np.testing.assert_allclose(np.abs(response[:2]), seen, rtol=1e-9, atol=1e-9)


def test_dampers_on_massless_plates_have_no_derivative_of_the_input_in_displacements():
    """A massless plate on the moved damper and a spring: c (p' - u') + k p = 0."""
    model = mv.Model("plate")
    model.add_body("plate", 0.0, (0, 0, 0), (0, 0, 0.1))
    model.add_joint("guide", "prismatic", "ground", "plate", (0, 0, 0.1), axis=(0, 0, 1))
    model.add_body("mass", 3.0, INERTIA, (0, 0, 0.2))
    model.add_joint("post", "prismatic", "plate", "mass", (0, 0, 0.2), axis=(0, 0, 1))
    model.add_spring("damper", "ground", "plate", (0, 0, 0), (0, 0, 0.1), damping=5.0)
    model.add_spring("spring", "plate", "mass", (0, 0, 0.1), (0, 0, 0.2), stiffness=70.0)
    model.add_motion_input("road", "damper")
    model.add_output("plate z", "plate", "z")
    model.add_output("mass z", "mass", "z")
    model.add_output("plate v", "plate", "z", quantity="velocity")
    system, s = model.linearize(), 1j * OMEGA
    mass = 70.0 / (70.0 + 3.0 * s**2)  # by the plate
    plate = 5.0 * s / (5.0 * s + 70.0 * (1.0 - mass))
    np.testing.assert_allclose(system.frequency_response(OMEGA)[:2, 0], expected := [plate, mass * plate], rtol=1e-11)
    space = system[["plate z", "mass z"], :].state_space()
    np.testing.assert_allclose(space.frequency_response(OMEGA)[:, 0], expected, rtol=1e-11)
    assert not len(space.transform)  # the plate's velocity needs that of the road
    y = system.time_response([0.0, 1e-9], [1.0, 1.0], "zero", outputs="plate z")
    np.testing.assert_allclose(y, 1.0, rtol=1e-6)  # the damper takes the plate along
    with pytest.raises(ResponseError, match="'plate v' needs the derivative of input 'road'"):
        system["plate v", :].state_space()


@pytest.mark.slow
def test_zeros_grids_and_reductions_are_those_of_the_motion():
    system = with_accelerometer().linearize()
    zeros = system.transmission_zeros("on wheel", "road")  # s^2 (k + c s) (M s^2 + c_s s + k_s)
    expected = [0.0, 0.0, *np.roots([BODY, ABSORBER, STRUT]), -TYRE / 200.0]
    np.testing.assert_allclose(np.sort_complex(zeros), np.sort_complex(expected), rtol=1e-6, atol=1e-6)
    assert np.abs(system.frequency_grid("on wheel") - np.abs(expected[2])).min() < 1e-3
    small = system.reduced(2, method="modal")
    np.testing.assert_allclose(small.frequency_response(OMEGA), system.frequency_response(OMEGA), rtol=1e-9)
    balanced = quarter("velocity").linearize().reduced(4, keep="acceleration")
    np.testing.assert_allclose(balanced.frequency_response(OMEGA)[0, 0], by_hand(OMEGA, 1)[2], rtol=1e-8)
    assert [len(quarter("velocity").linearize().reduced(keep="acceleration", **words).A) for words in (
        {"order": 2}, {"error": 1e6})] == [2, 0]  # fmt: skip
    sparse = quarter().linearize(method="sparse").reduced(2)
    np.testing.assert_allclose(sparse.frequency_response(OMEGA)[:, 0], by_hand(OMEGA, 0), rtol=1e-8)


def test_exports_keep_the_response_of_the_motion(tmp_path):
    export = pytest.importorskip("mbsvib_export")
    pytest.importorskip("control")
    for order in (0, 1):
        system = quarter(QUANTITIES[order]).linearize()["displacement", :]
        np.testing.assert_allclose(export.to_control(system)(1j * OMEGA).reshape(-1), by_hand(OMEGA, order)[0],
                                   rtol=1e-9)
        path = tmp_path / f"{order}.json"
        path.write_text(export.to_json(system), encoding="utf-8")
        np.testing.assert_allclose(export.from_json(path).frequency_response(OMEGA)[0, 0], by_hand(OMEGA, order)[0],
                                   rtol=1e-9)
    with pytest.raises(mv.MbsvibError, match="'tyre force' needs the derivative of input 'road'"):
        export.to_control(quarter().linearize())


@pytest.mark.parametrize("plant", [
    lambda: quarter("velocity").linearize(), lambda: quarter("velocity").linearize().state_space(),
    lambda: mv.library.bicycle(speed=5.0).linearize(),
], ids=["motion", "physical states", "rolling"])  # fmt: skip
def test_loops_whose_plants_are_no_system_are_exported_and_checked(plant, tmp_path):
    export = pytest.importorskip("mbsvib_export")
    system = plant()
    loop = system.feedback([[-0.1]], system.outputs[0], system.inputs[0])
    truth = loop.response(OMEGA)
    for realization in ("physical", "modal", "balanced"):
        space = export.to_scipy(loop, realization)
        at = [space.C @ np.linalg.solve(1j * w * np.eye(len(space.A)) - space.A, space.B) + space.D for w in OMEGA]
        np.testing.assert_allclose(at, np.moveaxis(truth, -1, 0), rtol=1e-8, atol=1e-13)
    assert export.check_export(export.to_npz(loop, tmp_path / "loop.npz"), loop).passed
    assert export.to_c(loop, tmp_path / "c").source.exists()


def test_exports_of_variants_and_parameters_lead_to_the_equations_of_moved_ends(tmp_path):
    export = pytest.importorskip("mbsvib_export")
    model = quarter("velocity")
    batch, system = model.linearize(values={"strut.damping": [500.0, 900.0]}), model.linearize()
    for space, variant in zip(export.to_control(batch), batch, strict=True):
        assert np.array_equal(space.A, variant.state_space().A)
    with pytest.raises(mv.ExportError, match=r"is a batch of 2 variants.*to_npz_batch\(batch\.ends\)"):
        export.to_json(batch)
    with pytest.raises(mv.ExportError, match=r"expected a Batch \(.*\), or its \.ends"):
        export.to_npz_batch(batch, tmp_path / "batch.npz")
    assert len(export.from_npz_batch(export.to_npz_batch(batch.ends, tmp_path / "batch.npz"))) == 2
    for call in (lambda plant: export.to_fmu(plant, tmp_path / "unit.fmu", tunable=["strut.damping"]),
                 lambda plant: export.to_casadi(plant, parameters=["strut.damping"])):  # fmt: skip
        with pytest.raises(mv.ExportError, match=r"system = DrivenSystem; expected a System .*, or its \.ends"):
            call(system)


def test_what_cannot_be_moved_is_refused_by_name():
    model = quarter()
    with pytest.raises(ModelError, match="'strut' are on bodies"):
        model.add_motion_input("a", "strut")
    with pytest.raises(ModelError, match="'wheel' is no element"):
        model.add_motion_input("a", "wheel")
    with pytest.raises(ModelError, match=r"quantity = 'velocty'.*velocity"):
        model.add_motion_input("a", "tyre", "velocty")
    with pytest.raises(ModelError, match=r"direction = 'x'.*the line of a spring"):
        model.add_motion_input("a", "tyre", direction="x")
    model.add_inerter("b", "ground", "wheel", (0, 0, 0), (0, 0, 0.3), inertance=1.0)
    with pytest.raises(ModelError, match=r"'b' is a inerter"):
        model.add_motion_input("a", "b")
    with pytest.raises(ResponseError, match=r"omega\[0\] = 0 rad/s; input 'road' is integrated"):
        quarter("velocity").linearize().frequency_response([0.0, 1.0])
    with pytest.raises(AttributeError, match=r"motion input 'road' ask .state_space"):
        _ = quarter().linearize().reachable
    for change in ({"first": "body"}, {"second": "body", "first": "wheel"}):
        with pytest.raises(ModelError, match=r"both ends of 'tyre' are on bodies"):
            quarter().replace("tyre", **change).linearize()
    with pytest.raises(AttributeError, match=r"has no attribute 'nonsense'\.$"):
        _ = quarter().linearize().nonsense


def test_systems_with_motions_can_be_pickled_and_copied():
    system = quarter().linearize()
    for same in (pickle.loads(pickle.dumps(system)), copy.copy(system)):
        np.testing.assert_array_equal(same.frequency_response(OMEGA), system.frequency_response(OMEGA))


def test_copies_of_a_model_have_roads_of_their_own():
    corner, car = quarter("velocity"), mv.Model("two")
    for name, x in (("left", -1.0), ("right", 1.0)):
        car.add_model(name, corner, position=(x, 0, 0))
    system = car.linearize()
    assert system.inputs == ("left.road", "right.road")
    np.testing.assert_allclose(system.frequency_response(OMEGA, "right.displacement", "right.road")[0, 0],
                               by_hand(OMEGA, 1)[0], rtol=1e-11)


def test_files_keep_motion_inputs(tmp_path):
    model = quarter("velocity", kind="bushing")
    save(model, tmp_path / "model.yaml")
    same = load(tmp_path / "model.yaml")
    assert same.inputs == model.inputs
    np.testing.assert_array_equal(same.linearize().frequency_response(OMEGA),
                                  model.linearize().frequency_response(OMEGA))


@pytest.mark.few(1)
@pytest.mark.parametrize("order", range(3))
@pytest.mark.parametrize("kind", ["spring", "bushing"])
def test_runs_of_straight_guides_are_the_linear_responses(kind, order):
    model = quarter(QUANTITIES[order], kind=kind)
    t = np.linspace(0.0, 1.0, 101)
    u = 0.01 * np.sin(9.0 * t)
    run = model.simulate(t, inputs={"road": u})
    names = ["displacement", "velocity"] if order == 0 else ["displacement", "velocity", "tyre force"]
    expected = model.linearize().time_response(t, u, outputs=names)
    for name, row in zip(names, expected, strict=True):
        np.testing.assert_allclose(run[name], row, atol=3e-6 * np.abs(row).max())


def test_runs_refuse_moved_ends_of_maxwell_elements():
    model = quarter(kind="maxwell")
    with pytest.raises(ModelError, match="motion input 'road' moves the end of an element with a state"):
        model.simulate([0.0, 0.1], inputs={"road": [0.0, 0.1]})


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_moved_ends_act_through_massless_nodes(method):
    """Two springs in series with a node that has no mass, whose motion and force follow from statics."""
    model = mv.Model("series")
    model.add_body("node", 0.0, (0, 0, 0), (0, 0, 0.1))
    model.add_joint("guide", "prismatic", "ground", "node", (0, 0, 0.1), axis=(0, 0, 1))
    model.add_body("mass", 3.0, INERTIA, (0, 0, 0.2))
    model.add_joint("post", "prismatic", "ground", "mass", (0, 0, 0.2), axis=(0, 0, 1))
    model.add_spring("lower", "ground", "node", (0, 0, 0), (0, 0, 0.1), stiffness=300.0)
    model.add_spring("upper", "node", "mass", (0, 0, 0.1), (0, 0, 0.2), stiffness=600.0)
    model.add_motion_input("road", "lower")
    model.add_output("node z", "node", "z")
    model.add_output("mass z", "mass", "z")
    model.add_force_output("lower force", "lower")
    both = 200.0 / (200.0 - 3.0 * OMEGA**2)
    node = (300.0 + 600.0 * both) / 900.0
    expected = [node, both, 300.0 * (node - 1.0)]
    response = model.linearize(method=method).frequency_response(OMEGA)[:, 0]
    np.testing.assert_allclose(response, expected, rtol=1e-10)


def test_several_motions_have_states_of_their_own():
    car = mv.Model("three")
    for name, quantity, x in (("a", "velocity", -1.0), ("b", "acceleration", 0.0), ("c", "velocity", 1.0)):
        car.add_model(name, quarter(quantity), position=(x, 0, 0))
    car.add_input("push", "a.body", "z")
    system = car.linearize()
    space = system.state_space()
    assert space.states[12:] == ("a.road.displacement", "b.road.displacement", "b.road.velocity", "c.road.displacement")
    expected = system.frequency_response(OMEGA)
    np.testing.assert_allclose(space.frequency_response(OMEGA), expected, rtol=1e-9, atol=1e-12)
    for name, order in (("a", 1), ("b", 2), ("c", 1)):
        k, row = system.inputs.index(f"{name}.road"), system.outputs.index(f"{name}.displacement")
        np.testing.assert_allclose(expected[row, k], by_hand(OMEGA, order)[0], rtol=1e-10)
    moved = (system.B0[:, system.inputs.index("push")], system.B1[:, system.inputs.index("push")])
    assert [np.abs(column).max() for column in moved] == [1.0, 0.0]
