"""Responses of assembled parts of which some are measured: exact ones, noise, decoupling, virtual points."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import AccuracyWarning, ModelError, ResponseError
from mbsvib.measurement.points import place_of
from tests.assembly.scenes import POINT, RIGID, add_base, apart, fixed, whole

OMEGA = np.linspace(2.0, 300.0, 40)
SENSORS = ((0.55, 0.1, 0.2), (0.5, 0.0, 0.25), (0.6, -0.1, 0.15))


def measured(system, omega=OMEGA, noise=0.0, seed=0, **entries):
    """Responses of a system as if measured, with noise that is a share of the median of each pair."""
    responses = system.frequency_response(omega)
    sd = noise * np.median(np.abs(responses), axis=2, keepdims=True) * np.ones(len(omega))
    normal = np.random.default_rng(seed).standard_normal((2, *responses.shape)) / np.sqrt(2.0)
    data = {"output_units": system.output_units, "input_units": system.input_units} | entries
    return mv.Measurement(omega, responses + sd * (normal[0] + 1j * normal[1]), system.outputs, system.inputs,
                          variance=sd**2 if noise else None, **data)  # fmt: skip


@pytest.mark.parametrize("which", ["base", "payload", "both"])
@pytest.mark.parametrize("how", ["rigid", ([1e5, 2e5, 3e5, 200, 300, 400.0], [10.0, 0, 30, 0.2, 0, 0])])
def test_exact_responses_give_those_of_one_model(which, how):
    parts = {name: model.linearize() for name, model in zip(("base", "payload"), apart(), strict=True)}
    for name in parts if which == "both" else [which]:
        parts[name] = measured(parts[name])
    result = mv.assemble(parts, [(*RIGID[0][:2], how)])

    def join(model):
        fixed(model) if how == "rigid" else model.add_bushing("w", "link", "pay", POINT, how[0], damping=how[1])

    expected = whole(join).linearize()[["z", "a"], "F"].frequency_response(OMEGA)
    np.testing.assert_allclose(result[["payload.z", "payload.a"], "base.F"].responses, expected, rtol=2e-12)
    assert (result.kept == 6).all()
    assert result.variance is None
    assert result.output_units[result.outputs.index("payload.z")] == "m"


def test_condition_is_that_of_the_interface():
    base, payload = (model.linearize() for model in apart())
    result = mv.assemble({"base": measured(base), "payload": payload}, RIGID)
    ports = [f"{name}.{d}" for name in ("tip", "root") for d in ("x", "y", "z", "rx", "ry", "rz")]
    interface = sum(system[names, names].frequency_response(OMEGA) for system, names in (
        (base, ports[:6]), (payload, ports[6:]))).transpose(2, 0, 1)  # fmt: skip
    size = np.sqrt(np.abs(np.einsum("nii->ni", interface)))
    scaled = interface / size[:, None] / size[:, :, None]
    np.testing.assert_allclose(result.condition, np.linalg.cond(scaled), rtol=1e-9)
    text = str(result)
    assert "base.tip" in text
    assert f"{result.condition.max():.3g} at most" in text
    assert result.directions[3] == "base.tip.rx"
    few = result.within(5.0, 20.0)
    assert len(few.kept) == len(few.condition) == len(few.omega) < len(OMEGA)


@pytest.mark.parametrize(("quantity", "order"), [("velocity", 1), ("acceleration", 2)])
def test_a_mount_acts_along_directions_with_stiffness_alone(quantity, order):
    """Two masses on rails behind a spring, closed form, of which one is measured by its velocity or acceleration."""
    parts = {}
    for name, mass in (("a", 3.0), ("b", 2.0)):
        model = mv.Model(name)
        model.add_body("m", mass, (1, 1, 1))
        model.add_joint("rail", "prismatic", "ground", "m", axis=(1, 0, 0))
        model.add_port("p", "m")
        parts[name] = model.linearize()
    w = OMEGA
    k, c = 5e3, 7.0
    ports = [f"p.{d}" for d in ("x", "y", "z", "rx", "ry", "rz")]
    rate = (1j * w) ** order
    measured = mv.Measurement(w, parts["a"].frequency_response(w) * rate, ports, ports, quantity=quantity)
    mount = [k, 0, 0, 0, 0, 0], [c, 0, 0, 0, 0, 0]
    result = mv.assemble({"a": measured, "b": parts["b"]}, [("a.p", "b.p", mount)])
    z = k + 1j * w * c
    stiffness = np.array([[z - 3.0 * w**2, -z], [-z, z - 2.0 * w**2]]).transpose(2, 0, 1)
    expected = np.linalg.inv(stiffness)
    np.testing.assert_allclose(result["b.p.x", "b.p.x"].responses[0, 0], expected[:, 1, 1], rtol=1e-12)
    np.testing.assert_allclose(result["a.p.x", "b.p.x"].responses[0, 0], rate * expected[:, 0, 1], rtol=1e-12)
    assert result.quantity[0] == quantity


def rail(name, mass, damping=0.0, stiffness=0.0):
    """A mass that moves along x, with a port."""
    model = mv.Model(name)
    model.add_body("m", mass, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "m", axis=(1, 0, 0))
    if stiffness:
        model.add_spring("k", "ground", "m", (-1, 0, 0), (0, 0, 0), stiffness=stiffness, damping=damping)
    model.add_port("p", "m")
    model.add_input("F", "m", "x")
    model.add_output("x", "m", "x")
    return model.linearize()[["x", "p.x"], ["F", "p.x"]]


@pytest.mark.few(3)
@pytest.mark.parametrize("how", ["rigid", ([4e3], [9.0])])
@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("removed", [(), ("b",)])
def test_variance_is_the_sum_of_squares_of_all_slopes(how, quantity, removed):
    """Of each entry that was measured in turn: differences of complex responses, two measured parts and a model."""
    w = np.array([20.0, 45.0])
    order = ("displacement", "velocity", "acceleration").index(quantity)
    systems = {"a": rail("a", 3.0, 5.0, 2e3), "b": rail("b", 2.0, 3.0, 4e2), "c": rail("c", 1.0)}
    exact = {name: systems[name].frequency_response(w) * (1j * w) ** order for name in "ab"}
    rng = np.random.default_rng(4)
    variance = {name: 1e-8 * rng.uniform(0.5, 2.0, one.shape) * np.abs(one) ** 2 for name, one in exact.items()}
    connect = [("a.p", "b.p", how), ("b.p", "c.p", ([6e3], [2.0]))][: 1 if removed else 2]

    def assembled(shift=None):
        parts = {name: systems[name] for name in ("a", "b", "c")[: len(connect) + 1]}
        for name, one in exact.items():
            value = one if shift is None or shift[0] != name else one + shift[1]
            parts[name] = mv.Measurement(w, value, systems[name].outputs, systems[name].inputs, quantity=quantity,
                                         variance=variance[name])  # fmt: skip
        return mv.assemble(parts, connect, remove=removed)

    stated = assembled()
    expected = np.zeros(stated.responses.shape)
    for name, one in exact.items():
        for at in np.ndindex(2, 2):
            step = np.zeros_like(one)
            step[at] = 1e-6 * np.abs(one[at])
            slope = (assembled((name, step)).responses - assembled((name, -step)).responses) / (2.0 * step[at])
            expected += np.abs(slope) ** 2 * variance[name][at]
    np.testing.assert_allclose(stated.variance, expected, rtol=1e-6)
    assert stated.quantity == tuple("displacement" if name[0] == "c" else quantity for name in stated.outputs)


@pytest.mark.parametrize("noise", [0.4, 0.6, 3.0])
def test_a_direction_below_its_noise_stays_apart(noise):
    """Two masses on rails, z = g_a + g_b with variance s^2: joined if |z| > 2 s.

    Otherwise G_ba = 0 with the variance |g_b g_a / z|^2 / max(1, s / |z|)^2 of what the connection would have done.
    """
    w = np.array([30.0, 50.0, 70.0])
    a, b = rail("a", 3.0, 5.0, 2e3), rail("b", 2.0)
    ga, gb = (one["p.x", "p.x"].frequency_response(w)[0, 0] for one in (a, b))
    z = ga + gb
    responses = a.frequency_response(w)
    variance = np.full(responses.shape, 1e-30)
    variance[1, 1] = (noise * np.abs(z)) ** 2
    responses[0, 0, 1] = responses[1, 1, 2] = np.nan
    data = mv.Measurement(w, responses, a.outputs, a.inputs, quantity="displacement", variance=variance)
    result = mv.assemble({"a": data, "b": b}, [("a.p", "b.p", "rigid")])
    joined = noise < 0.5
    assert result.kept.tolist() == [joined, joined, 0]
    np.testing.assert_array_equal(np.isnan(result.condition), [False, False, True])
    found = result["b.x", "a.p.x"]
    transfer = gb * ga / z
    np.testing.assert_allclose(found.responses[0, 0, :2], transfer[:2] if joined else 0.0, rtol=1e-9)
    assert np.isnan(result.responses[..., 2]).all()
    assert np.isnan(result.variance[..., 2]).all()
    np.testing.assert_array_equal(np.isnan(result.responses[..., 1]), [[True, False, *[False] * 2], *[[False] * 4] * 3])
    size = np.abs(gb / z) ** 4 * variance[1, 1] if joined else np.abs(transfer) ** 2 / max(1.0, noise) ** 2
    np.testing.assert_allclose(found.variance[0, 0, :2], size[:2], rtol=1e-6)


def test_channels_keep_places_units_and_quantities():
    base, payload = (model.linearize() for model in apart())
    part = measured(base, output_points=[(at, d) if d else None for at, d in _places(base.outputs)],
                    input_points=[(at, d) if d else None for at, d in _places(base.inputs)])  # fmt: skip
    result = mv.assemble({"base": part, "payload": payload}, RIGID)
    nodes = {node.number: node for node in result.nodes}
    for kind in ("output", "input"):
        for name, unit, point in zip(*(getattr(result, f"{kind}{end}") for end in ("s", "_units", "_points")),
                                     strict=True):  # fmt: skip
            owner, _, own = name.partition(".")
            system = base if owner == "base" else payload
            assert unit == getattr(system, f"{kind}_units")[getattr(system, f"{kind}s").index(own)]
            if own.startswith(("tip.", "root.")):
                np.testing.assert_allclose(nodes[point.node].position, POINT)
                along = np.zeros(6)
                along[("x", "y", "z", "rx", "ry", "rz").index(own.rpartition(".")[2])] = 1.0
                np.testing.assert_allclose(place_of(point, nodes).direction, along, atol=1e-15)
    assert result.quantity[result.outputs.index("payload.a")] == "acceleration"
    assert result.quantity[result.outputs.index("base.arm.force")] == ""
    assert result.connections[0].distance == 0.0
    assert result.table()["rows"] == [("base.tip", "payload.root", "x y z rx ry rz", "rigid", "0")]
    soft = mv.assemble({"base": measured(base), "payload": payload}, [(*RIGID[0][:2], [1e4] * 2, ("x", "ry"))])
    assert soft.table()["rows"] == [("base.tip", "payload.root", "x ry", "spring-damper", "")]
    assert len(soft.table()["notes"]) == 1


def _places(names):
    return [(POINT, name.removeprefix("tip.")) if name.startswith("tip.") else (POINT, None) for name in names]


def test_few_lines_and_few_at_a_time(monkeypatch):
    """One line of more channels than lines; blocks of lines are those of all at once."""
    base, payload = (model.linearize() for model in apart())
    parts = {"base": measured(base, noise=1e-3), "payload": payload}
    every = mv.assemble(parts, RIGID)
    one = mv.assemble(parts | {"base": parts["base"].within(OMEGA[4] / 6.284, OMEGA[4] / 6.283)}, RIGID)
    assert one.responses.shape[2] == 1
    monkeypatch.setattr("mbsvib.assembly.responses.BLOCK", 7 * len(every.inputs) ** 2)
    blocks = mv.assemble(parts, RIGID)
    for field in ("responses", "variance", "condition", "kept"):
        np.testing.assert_allclose(getattr(one, field)[..., 0], getattr(every, field)[..., 4], rtol=1e-9)
        np.testing.assert_allclose(getattr(blocks, field), getattr(every, field), rtol=1e-9)


@pytest.mark.slow
def test_stated_variance_is_the_scatter():
    base, payload = (model.linearize() for model in apart())
    base, payload = base[["tip.*"], ["F", "tip.*"]], payload[["z", "root.*"], "root.*"]
    runs, stated = [], None
    for seed in range(40):
        result = mv.assemble({"base": measured(base, noise=1e-3, seed=seed), "payload": payload}, RIGID)
        result = result[["payload.z", "base.tip.rx"], ["base.F", "payload.root.z"]]
        runs.append(result.responses)
        stated = result.variance if stated is None else stated + result.variance
    scatter = np.var(np.array(runs), axis=0, ddof=1) / (stated / len(runs))
    np.testing.assert_allclose(scatter.mean(axis=2), 1.0, atol=0.12)  # 40 runs of 40 lines: 2.5 % of deviation


def test_directions_below_the_noise_are_not_joined():
    base, payload = (model.linearize() for model in apart())
    noisy = measured(base, noise=0.3, seed=3)
    result = mv.assemble({"base": noisy, "payload": payload}, RIGID)
    assert result.kept.min() < 6
    found = result["payload.z", "base.F"]
    exact = whole(fixed).linearize()["z", "F"].frequency_response(OMEGA)
    apart_by = np.abs(found.responses - exact) / np.sqrt(found.variance)
    assert np.sqrt(np.mean(apart_by[..., result.kept < 6] ** 2)) < 2.0
    assert "fewer than the 6 directions are joined" in str(result)


def test_a_part_is_taken_away():
    base, payload = (model.linearize() for model in apart())
    both = measured(mv.assemble({"base": base, "payload": payload}, RIGID))
    both = mv.Measurement(OMEGA, both.responses, [name.partition(".")[2] for name in both.outputs],
                          [name.partition(".")[2] for name in both.inputs], output_units=both.output_units)  # fmt: skip
    result = mv.assemble({"whole": both, "payload": payload}, [("whole.root", "payload.root", "rigid")],
                         remove="payload")  # fmt: skip
    assert not any(name.startswith("payload.") for name in (*result.outputs, *result.inputs))
    rows, columns = ["tip.z", "tip.rx", "link.force"], ["F", "tip.y"]
    found = result[[f"whole.{name}" for name in rows], [f"whole.{name}" for name in columns]].responses
    expected = base[rows, columns].frequency_response(OMEGA)
    size = np.abs(expected).max(axis=2, keepdims=True)
    np.testing.assert_allclose(found / size, expected / size, rtol=0.0, atol=1e-9)


def around(noise=0.0, quantity="acceleration"):
    """Three triaxial sensors and nine impacts on the link around the port."""
    model = mv.Model("base")
    add_base(model)
    outputs, inputs, rng = [], [None], np.random.default_rng(1)
    for i, at in enumerate(SENSORS):
        for direction in "xyz":
            model.add_output(f"s{i}{direction}", "link", direction, at, quantity=quantity)
            outputs.append((at, direction))
    for i in range(9):
        at, along = rng.uniform(-0.1, 0.1, 3) + POINT, rng.standard_normal(3)
        along /= np.linalg.norm(along)
        model.add_input(f"h{i}", "link", along, at)
        inputs.append((at, along))
    system = model.linearize()
    return measured(system["s*", :], noise=noise, output_points=outputs, input_points=inputs)


def test_sensors_around_a_point_are_a_port():
    base, payload = apart()
    virtual = around().virtual_point("tip", POINT, "s*", "h*")
    ports = [f"tip.{d}" for d in ("x", "y", "z", "rx", "ry", "rz")]
    assert virtual.outputs == tuple(ports)
    assert virtual.inputs == ("F", *ports)
    assert virtual.output_units == ("m/s^2",) * 3 + ("rad/s^2",) * 3
    assert virtual.input_units == ("N",) * 4 + ("N m",) * 3
    expected = -(OMEGA**2) * base.linearize()[ports, ["F", *ports]].frequency_response(OMEGA)
    np.testing.assert_allclose(virtual.responses, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    assert min(virtual.consistency.values()) > 1.0 - 1e-12
    result = mv.assemble({"base": virtual, "payload": payload}, RIGID)
    expected = whole(fixed).linearize()["z", "F"].frequency_response(OMEGA)
    np.testing.assert_allclose(result["payload.z", "base.F"].responses, expected, rtol=1e-9)


def test_consistency_finds_the_sensor_that_was_swapped():
    data = around()
    rows = list(range(9))
    rows[3], rows[4] = 4, 3  # s1x and s1y exchanged
    swapped = mv.Measurement(OMEGA, data.responses[rows], data.outputs, data.inputs, output_units=data.output_units,
                             output_points=[(at, d) for at in SENSORS for d in "xyz"])  # fmt: skip
    consistency = swapped.virtual_point("tip", POINT, "s*").consistency
    assert sorted(consistency, key=consistency.get)[0] in ("s1x", "s1y")
    assert min(consistency.values()) < 0.9


def test_variance_of_a_virtual_point_is_that_of_independent_errors():
    plain, scale = around(), 1e-3
    runs = []
    for seed in range(30):
        noise = np.random.default_rng(seed).standard_normal((2, *plain.responses.shape)) * scale / np.sqrt(2.0)
        data = mv.Measurement(OMEGA, plain.responses + noise[0] + 1j * noise[1], plain.outputs, plain.inputs,
                              variance=np.full(plain.responses.shape, scale**2), output_units=plain.output_units,
                              output_points=[(at, d) for at in SENSORS for d in "xyz"])  # fmt: skip
        point = data.virtual_point("tip", POINT, "s*")
        runs.append(point.responses)
    scatter = np.var(np.array(runs), axis=0, ddof=1).mean(axis=2)
    np.testing.assert_allclose(scatter, point.variance.mean(axis=2), rtol=0.1)


def test_one_triaxial_sensor_tells_three_directions():
    data = around()
    three = data.virtual_point("tip", SENSORS[0], ["s0x", "s0y", "s0z"])
    assert [name for name in three.outputs if name.startswith("tip")] == ["tip.x", "tip.y", "tip.z"]
    assert three.outputs[:6] == ("s1x", "s1y", "s1z", "s2x", "s2y", "s2z")
    assert three.quantity == ("acceleration",) * 9
    with pytest.raises(ResponseError, match="3 outputs tell no displacement of 'tip' alone"):
        data.virtual_point("tip", (0.0, 0.4, 0.9), ["s0x", "s1y", "s2z"])
    with pytest.raises(ResponseError, match="place of input 'F' is not known"):
        data.virtual_point("tip", POINT, "s*", "F")


def test_lines_quantities_and_pairs_must_be_known():
    base, payload = (model.linearize() for model in apart())
    other = measured(payload, OMEGA + 1.0)
    with pytest.raises(ResponseError, match="expected the same frequencies"):
        mv.assemble({"base": measured(base), "payload": other}, RIGID)
    bare = mv.Measurement(OMEGA, base.frequency_response(OMEGA), base.outputs, base.inputs)
    with pytest.raises(ModelError, match=r"'base.tip.x' has neither quantity nor unit"):
        mv.assemble({"base": bare, "payload": payload}, RIGID)
    holes = base.frequency_response(OMEGA).copy()
    holes[base.outputs.index("tip.y"), base.inputs.index("tip.rz")] = np.nan
    gaps = mv.Measurement(OMEGA, holes, base.outputs, base.inputs, output_units=base.output_units)
    with pytest.raises(ModelError, match=r"'base.tip.y' to 'base.tip.rz' was not measured"):
        mv.assemble({"base": gaps, "payload": payload}, RIGID)
    joined = mv.assemble({"base": gaps, "payload": payload}, [(*RIGID[0], ("x", "z"))])
    assert np.isfinite(joined["payload.z", "base.F"].responses).all()
    with pytest.raises(ModelError, match="singular and not diagonal"):
        mv.assemble({"base": measured(base), "payload": payload},
                    [(*RIGID[0][:2], [[1e3, -1e3], [-1e3, 1e3]], ("x", "y"))])  # fmt: skip


def test_a_connection_without_stiffness_joins_nothing():
    base, payload = (measured(model.linearize()) for model in apart())
    result = mv.assemble({"base": base, "payload": payload}, [(*RIGID[0][:2], [0.0] * 6)])
    names = [[f"base.{name}" for name in names] for names in (base.outputs, base.inputs)]
    np.testing.assert_array_equal(result[names[0], names[1]].responses, base.responses)


@pytest.mark.parametrize(("kind", "unit"), [("output", "mm"), ("input", "V"), ("input", "kN")])
def test_ports_in_other_units_are_refused(kind, unit):
    base, payload = (model.linearize() for model in apart())
    units = [unit if known in {"m", "N"} else known for known in getattr(base, f"{kind}_units")]
    data = measured(base, quantity=measured(base).quantity, **{f"{kind}_units": units})
    with pytest.raises(ModelError, match=rf"{kind} 'base\.tip\.x' of a port is in {unit}; expected data in SI units"):
        mv.assemble({"base": data, "payload": payload}, RIGID)


@pytest.mark.parametrize("remove", [(), "payload"])
def test_conjugates_are_warned_of(remove):
    """Also those of a part that is taken away; noise alone gives no energy."""
    base, payload = (model.linearize() for model in apart())
    held, free = (measured(one, noise=0.05, seed=1) for one in (base, payload))
    mv.assemble({"base": held, "payload": free}, RIGID, remove=remove)
    turned = mv.Measurement(OMEGA, free.responses.conj(), free.outputs, free.inputs, output_units=free.output_units,
                            input_units=free.input_units)  # fmt: skip
    with pytest.warns(AccuracyWarning, match="the measured part 'payload' gives energy at 'payload.root.x'"):
        mv.assemble({"base": held, "payload": turned}, RIGID, remove=remove)
