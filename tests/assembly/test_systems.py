"""Equations of assembled parts against the same mechanism built as one model."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ModelError
from tests.assembly.scenes import POINT, RIGID, add_base, add_payload, apart, fixed, whole

OMEGA = np.linspace(1.0, 300.0, 60)


def holds_its_factors(system):
    """M, C and K are those of the factors that modes and responses come from."""
    rows = system.elastic_rows
    for found, parts in (
        (system.M, (system.inertia_factor.T @ system.inertia_factor, None)),
        (system.C, (rows.T @ (system.row_damping[:, None] * rows), system.gyroscopic)),
        (system.K, (rows.T @ (system.row_stiffness[:, None] * rows), system.circulatory)),
    ):
        expected = sum(part for part in parts if part is not None)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())


def same(assembly, model, renamed, rtol=2e-12):
    """Compare eigenvalues, and the responses of outputs and inputs {name in the model: name in the assembly}."""
    system = model.linearize()
    assert assembly.dof == system.dof
    holds_its_factors(assembly)
    one, other = (np.sort_complex(each.modes().eigenvalues) for each in (system, assembly))
    np.testing.assert_allclose(other, one, rtol=0.0, atol=rtol * np.abs(one).max())
    rows = [name for name in system.outputs if name in renamed]
    columns = [name for name in system.inputs if name in renamed]
    expected = system[rows, columns].frequency_response(OMEGA)
    found = assembly[[renamed[name] for name in rows], [renamed[name] for name in columns]].frequency_response(OMEGA)
    size = np.abs(expected).max(axis=2, keepdims=True)
    np.testing.assert_allclose(found / size, expected / size, rtol=0.0, atol=20.0 * rtol)


NAMES = {"z": "payload.z", "a": "payload.a", "arm.force": "base.arm.force", "link.force": "base.link.force",
         "F": "base.F"}  # fmt: skip


@pytest.mark.parametrize("orientation", [None, (0.3, -0.8, 0.5)])
def test_rigid_connection_is_a_fixed_joint(orientation):
    base, payload = apart(orientation=orientation)
    assembly = mv.assemble({"base": base, "payload": payload.linearize()}, RIGID, name="both")
    same(assembly, whole(fixed), NAMES)
    assert assembly.name == "both"
    assert "base.tip and payload.root: joined rigidly along x y z rx ry rz, 0 mm apart" in assembly.explain()
    motion = dict(zip(assembly.bodies, assembly.body_motion, strict=True))
    assert np.abs(motion["base.link"][3:] - motion["payload.pay"][3:]).max() < 1e-12
    with pytest.raises(ModelError, match="assembled of parts"):
        assembly.eigenvalue_sensitivities()


def test_stiffness_and_damping_are_a_bushing_at_the_point():
    base, payload = apart()
    k, c = np.array([1e5, 2e5, 3e5, 200, 300, 400.0]), np.array([10.0, 0, 30, 0.2, 0, 0])
    assembly = mv.assemble({"base": base, "payload": payload}, [(*RIGID[0][:2], (k, c))])
    same(assembly, whole(lambda model: model.add_bushing("w", "link", "pay", POINT, k, damping=c)), NAMES)
    matrix = np.diag(k)
    matrix[0, 4] = matrix[4, 0] = 3000.0
    coupled = mv.assemble({"base": base, "payload": payload}, [(*RIGID[0][:2], matrix)])
    same(coupled, whole(lambda model: model.add_bushing("w", "link", "pay", POINT, matrix)), NAMES)
    assert "base.tip to payload.root" in coupled.provenance.springs


def test_some_directions_are_a_joint():
    base, payload = apart()
    assembly = mv.assemble({"base": base, "payload": payload}, [(*RIGID[0], ("x", "y", "z", "rx", "rz"))])

    def hinge(model):
        model.add_joint("hinge", "revolute", "link", "pay", POINT, axis=(0, 1, 0))

    same(assembly, whole(hinge), NAMES)


def test_loops_of_connections_and_redundant_directions():
    """Two welds between the same bodies lock six directions twice; forces beyond them are not determined."""
    base, payload = apart()
    for model, body in ((base, "link"), (payload, "pay")):
        model.add_port("second", body, (0.5, 0.0, 0.25))
    twice = [*RIGID, ("base.second", "payload.second", "rigid")]
    with pytest.raises(ModelError, match=r"output 'base\..*force' depends on forces in rigid connections"):
        mv.assemble({"base": base, "payload": payload}, twice)
    system = base.linearize()
    plain = system[[name for name in system.outputs if "force" not in name], :]
    model = whole(fixed)
    same(mv.assemble({"base": plain, "payload": payload}, twice), model, {"z": "payload.z", "F": "base.F"})


def test_planar_parts_lock_what_they_have():
    """Sliders along x: five directions of a weld have no motion on either side."""
    def slider(name, mass, at):
        model = mv.Model(name)
        model.add_body("car", mass, (1, 1, 1), position=(at, 0, 0))
        model.add_joint("rail", "prismatic", "ground", "car", axis=(1, 0, 0))
        model.add_port("p", "car", (0.5, 0, 0))
        return model

    first, second = slider("first", 3.0, 0.0), slider("second", 1.0, 1.0)
    first.add_spring("k", "ground", "car", (-1, 0, 0), (0, 0, 0), stiffness=900.0)
    assembly = mv.assemble({"a": first, "b": second}, [("a.p", "b.p", "rigid")])
    assert assembly.coordinates == ("a.rail.z",)
    np.testing.assert_allclose(assembly.modes().natural, [15.0], rtol=1e-15)
    fast = mv.assemble({"a": first, "b": second}, [("a.p", "b.p", ([600.0, 0, 0, 0, 0, 0]))])
    # 3 kg on 900 N/m, 1 kg behind 600 N/m: w^4 - 1100 w^2 + 180000 = 0
    expected = np.sqrt(np.roots([1.0, -1100.0, 180000.0])[::-1])
    np.testing.assert_allclose(fast.modes().natural, expected, rtol=1e-14)


def test_free_parts_keep_six_exact_rigid_body_modes():
    models = []
    for name, at, port in (("a", 0.0, 0.7), ("b", 2.0, 0.7)):
        model = mv.Model(name)
        model.add_body("one", 2.0, (0.3, 0.2, 0.1), position=(at, 0.13, 0))
        model.add_body("two", 1.0, (0.1, 0.2, 0.3), position=(at + 0.3, 0.31, 0.57))
        model.add_bushing("k", "one", "two", (at + 0.1, 0.2, 0.3), (1e7, 3e3, 2e6, 40.0, 7e4, 9e5))
        model.add_port("p", "two", (port, 0.1, 0.2))
        models.append(model)
    assembly = mv.assemble(dict(zip("ab", models, strict=True)), [("a.p", "b.p", "rigid")])
    assert (assembly.modes().natural[:6] == 0.0).all()
    assert assembly.modes().natural[6] > 1.0


def test_spin_follower_loads_and_motions_without_mass():
    def join(model):
        model.add_bushing("w", "link", "pay", POINT, [1e5] * 3 + [400.0] * 3)

    def more(model, body, at):
        model.add_rotor("gyro", body, 40.0, (0, 0, 1), inertia=0.3) if body == "pay" else \
            model.add_maxwell("m", "ground", body, (0, 0, -0.4), at, 1e4, 50.0)  # fmt: skip

    base, payload = apart()
    more(base, "base", (0, 0, 0.1))
    more(payload, "pay", (0, 0, 0.1))
    model = whole(join)
    more(model, "base", (0, 0, 0.1))
    more(model, "pay", (0, 0, 0.1))
    soft = mv.assemble({"base": base, "payload": payload}, [(*RIGID[0][:2], [1e5] * 3 + [400.0] * 3)])
    assert soft.massless == 1
    assert soft.gyroscopic is not None
    same(soft, model, NAMES, 1e-11)
    with pytest.raises(ModelError, match="'base' has motions without mass"):
        mv.assemble({"base": base, "payload": payload}, RIGID)


def test_ground_moves_for_all_parts_or_for_none():
    base, payload = apart()
    base.add_base_motion("floor", "z")
    with pytest.raises(ModelError, match=r"add the same base motion to 'payload'"):
        mv.assemble({"base": base, "payload": payload}, RIGID)
    payload.add_base_motion("floor", "z")
    model = whole(fixed)
    model.add_base_motion("floor", "z")
    assembly = mv.assemble({"base": base, "payload": payload}, RIGID)
    assert assembly.inputs.count("floor") == 1
    same(assembly, model, NAMES | {"floor": "floor"})


def test_assemblies_and_matrices_are_parts_too():
    base, payload = apart()
    system = payload.linearize()
    matrices = mv.System.from_matrices(
        system.M, system.C, system.K, system.B, Cq=system.Cq, Cv=system.Cv, Ca=system.Ca, D=system.D,
        inputs=system.inputs, outputs=system.outputs)  # fmt: skip
    inner = mv.assemble({"base": base, "payload": matrices}, RIGID)
    same(inner, whole(fixed), NAMES)
    mass = mv.Model("mass")
    mass.add_body("m", 1.5, (0.01, 0.01, 0.01), position=POINT)
    mass.add_port("p", "m")
    outer = mv.assemble({"both": inner, "mass": mass}, [("both.base.tip", "mass.p", "rigid")])

    def heavier(model):
        fixed(model)
        model.add_body("m", 1.5, (0.01, 0.01, 0.01), position=POINT)
        model.add_joint("glue", "fixed", "link", "m", POINT)

    same(outer, whole(heavier), {key: f"both.{value}" for key, value in NAMES.items()})
    assert [one.first for one in outer.provenance.connections] == ["both.base.tip", "both.base.tip"]


def test_patterns_join_ports_by_position():
    corners = [(0.3, 0.2, 0.5), (-0.3, 0.2, 0.5), (0.0, -0.3, 0.5)]
    lower, upper, one = mv.Model("lower"), mv.Model("upper"), mv.Model("one")
    for models, name, at in (((lower, one), "frame", 0.4), ((upper, one), "plate", 0.7)):
        for model in models:
            model.add_body(name, 20.0, (1.0, 1.2, 1.4), position=(0, 0, at))
    for model in (lower, one):
        model.add_bushing("floor", "ground", "frame", (0, 0, 0), [1e6] * 3 + [1e5] * 3)
    for i, corner in enumerate(corners):
        lower.add_port(f"corner{i}", "frame", corner)
        upper.add_port(f"foot{2 - i}", "plate", corner)
        one.add_bushing(f"k{i}", "frame", "plate", corner, [1e5, 2e5, 3e5, 10, 10, 10])
    assembly = mv.assemble({"lower": lower, "upper": upper},
                           [("lower.corner*", "upper.foot*", [1e5, 2e5, 3e5, 10, 10, 10])])  # fmt: skip
    same(assembly, one, {})
    assert [(c.first, c.second, c.distance) for c in assembly.provenance.connections] == [
        ("lower.corner0", "upper.foot2", 0.0), ("lower.corner1", "upper.foot1", 0.0),
        ("lower.corner2", "upper.foot0", 0.0)]  # fmt: skip


def _moved():
    payload = mv.Model("payload")
    add_payload(payload)
    payload.add_port("root", "pay", (0.6, 0.05, 0.3))
    return payload


def _turned():
    payload = mv.Model("payload")
    add_payload(payload)
    payload.add_port("root", "pay", POINT, (0, 0, 0.3))
    return payload


def _short():
    payload = mv.Model("payload")
    add_payload(payload)
    for direction in "xyz":
        payload.add_input(f"root.{direction}", "pay", direction, POINT)
        payload.add_output(f"root.{direction}", "pay", direction, POINT)
    return payload


def _beside():
    payload = mv.Model("payload")
    add_payload(payload)
    payload.add_input("root.x", "pay", "x", POINT)
    payload.add_output("root.x", "pay", "x", (0.6, 0.05, 0.2005))
    return payload


def _fast():
    payload = mv.Model("payload")
    add_payload(payload)
    payload.add_input("root.x", "pay", "x", POINT)
    payload.add_output("root.x", "pay", "x", POINT, quantity="velocity")
    return payload


def _faster():
    payload = mv.Model("payload")
    add_payload(payload)
    payload.add_input("root.x", "pay", "x", POINT)
    payload.add_output("root.x", "pay", "x", POINT, quantity="acceleration")
    return payload


def _against():
    payload = mv.Model("payload")
    add_payload(payload)
    payload.add_input("root.x", "pay", (-1, 0, 0), POINT)
    payload.add_output("root.x", "pay", "x", POINT)
    return payload


def _massless():
    payload = mv.Model("payload")
    add_payload(payload)
    payload.add_body("node", 0.0, (0, 0, 0), position=POINT)
    payload.add_bushing("held", "node", "pay", POINT, [1e4] * 3 + [1e2] * 3)
    payload.add_port("root", "node", POINT)
    return payload


@pytest.mark.parametrize(("payload", "connect", "words"), [
    (_moved, RIGID, r"0.1 m apart; expected at most distance=0.001 m"),
    (_turned, RIGID, r"x of 'base.tip' and of 'payload.root' are different directions"),
    (_short, RIGID, r"'payload.root' has no rx, ry, rz.*\('x', 'y', 'z'\)"),
    (_short, [(*RIGID[0], "rx")], r"direction 'rx'.*x, y, z, which both have"),
    (_beside, [(*RIGID[0], "x")], "input 'payload.root.x' does not act where and as output"),
    (_fast, [(*RIGID[0], "x")], "output 'payload.root.x' is a velocity"),
    (_faster, [(*RIGID[0], "x")], "output 'payload.root.x' is a velocity, an acceleration"),
    (_against, [(*RIGID[0], "x")], "input 'payload.root.x' does not act where and as output"),
    (_massless, [(*RIGID[0][:2], [1e4] * 6)], "output 'payload.root.x' follows forces at once"),
    (_short, [("base.tip", "payload.rot", "rigid")], r"port 'payload.rot' is unknown.*payload\.root.*add_port"),
    (_short, [("base.tip", "base.tip", "rigid")], "ports of one part"),
    (_short, [("base.tip", "payload.root", "stiff", "x")], "joined 'stiff'; expected 'rigid'"),
    (_short, [(*RIGID[0][:2], [1.0, 2.0], "x")], "stiffness of 'base.tip' and 'payload.root' = .*expected 1 numbers"),
    (_short, [(*RIGID[0][:2], [[0.0, 1.0], [1.0, 0.0]], ("x", "y"))], "not symmetric with eigenvalues of 0 or more"),
    (_short, [("base.tip", "payload.root")], r"expected two ports and how they are joined"),
    (_short, [], "connect is empty"),
])  # fmt: skip
def test_what_does_not_fit_is_refused_by_name(payload, connect, words):
    base, _ = apart()
    with pytest.raises(ModelError, match=f"(?s){words}"):
        mv.assemble({"base": base, "payload": payload()}, connect)


def test_parts_are_models_systems_or_measurements():
    base, payload = apart()
    with pytest.raises(ModelError, match="part 'space' is a state space; expected a Model, a System or a Measurement"):
        mv.assemble({"base": base, "space": payload.linearize().state_space()}, RIGID)
    sparse = payload.linearize(method="sparse")
    with pytest.raises(ModelError, match="part 'space' is a sparse system"):
        mv.assemble({"base": base, "space": sparse}, RIGID)
    with pytest.raises(ModelError, match="expected two or more by name"):
        mv.assemble({"base": base}, RIGID)
    with pytest.raises(ModelError, match="remove has 'load'; expected names of parts"):
        mv.assemble({"base": base, "payload": payload}, RIGID, remove="load")
    with pytest.raises(ModelError, match="no part is measured"):
        mv.assemble({"base": base, "payload": payload}, RIGID, remove="payload")


def test_a_port_has_six_pairs_or_none():
    model = mv.Model("m")
    add_base(model)
    assert model.add_port("p", "base") == ("p.x", "p.y", "p.z", "p.rx", "p.ry", "p.rz")
    with pytest.raises(ModelError, match=r"p\.x"):
        model.add_port("p", "link")
    model.add_output("q.rz", "link", "rz")
    before = list(model.inputs), list(model.outputs)
    with pytest.raises(ModelError, match=r"q\.rz"):
        model.add_port("q", "link")
    assert (list(model.inputs), list(model.outputs)) == before


def test_a_part_in_all_of_its_modes_is_the_part():
    base, payload = apart()
    modal = payload.linearize(method="sparse").reduced(9)
    same(mv.assemble({"base": base, "payload": modal}, RIGID), whole(fixed), NAMES, 1e-9)
