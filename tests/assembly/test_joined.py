"""What assemblies keep of their parts: spin, bearings, energies, several parts in a row, ports by position."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ModelError, SingularPoseError
from tests.assembly.scenes import POINT, RIGID, add_payload, apart, fixed, whole
from tests.assembly.test_systems import NAMES, OMEGA, same


def _cross_coupled(model, body, at):
    """A bearing whose stiffness and damping are not symmetric, as seals have them."""
    stiffness, damping = np.diag([2e4, 3e4, 1e4, 50.0, 60.0, 70.0]), np.diag([5.0, 6.0, 7.0, 0.1, 0.2, 0.3])
    stiffness[0, 1], stiffness[1, 0], damping[0, 1], damping[1, 0] = 9e3, -7e3, 2.0, -3.0
    model.add_bushing("seal", "ground", body, at, stiffness, damping=damping)


def _rotor(model, body, at):
    model.add_rotor("gyro", body, 60.0, (0.6, 0, 0.8), inertia=0.3)


def _connector(how):
    """How a connection of parts is built in one model."""
    if how == "rigid":
        return fixed
    return lambda model: model.add_bushing("w", "link", "pay", POINT, how[0], damping=how[1])


SOFT = ([1e5, 2e5, 3e5, 200, 300, 400.0], [10.0, 0, 30, 0.2, 0, 0])


@pytest.mark.few(3)
@pytest.mark.parametrize("how", ["rigid", SOFT])
@pytest.mark.parametrize("adds", [[_cross_coupled], [_rotor], [_cross_coupled, _rotor]])
@pytest.mark.parametrize("where", ["base", "payload"])
def test_gyroscopic_and_circulatory_parts_of_one_side(how, adds, where):
    """What one part has beyond symmetric matrices remains, whether the other has it or not."""
    base, payload = apart()
    model = whole(_connector(how))
    for add in adds:
        add(*((base, "base") if where == "base" else (payload, "pay")), (0.1, 0, 0.1))
        add(model, "base" if where == "base" else "pay", (0.1, 0, 0.1))
    assembly = mv.assemble({"base": base, "payload": payload}, [(*RIGID[0][:2], how)])
    same(assembly, model, NAMES, 1e-11)
    system = model.linearize()
    for field in ("gyroscopic", "circulatory"):
        assert (getattr(assembly, field) is None) == (getattr(system, field) is None), field


@pytest.mark.parametrize("how", ["rigid", SOFT])
def test_energies_belong_to_bodies_and_springs(how):
    """Shares of bodies in the kinetic energy and of springs in the strain energy of each mode."""
    base, payload = apart()
    assembly = mv.assemble({"base": base, "payload": payload}, [(*RIGID[0][:2], how)])
    system = whole(_connector(how)).linearize()
    part = {"base": "base", "link": "base", "pay": "payload", "tip": "payload"}
    here, there = (one.modes() for one in (assembly, system))
    kinetic = []
    for each, modes in ((system, there), (assembly, here)):
        rows = (np.abs(each.inertia_factor @ modes.shapes) ** 2).reshape(-1, 6, len(modes)).sum(axis=1)
        kinetic.append(dict(zip(each.bodies, rows / rows.sum(axis=0), strict=True)))
    for body, energy in kinetic[0].items():
        np.testing.assert_allclose(kinetic[1][f"{part[body]}.{body}"], energy, atol=1e-7)
    assert here.strongest() == tuple((f"{part[body]}.{body}", direction) for body, direction in there.strongest())
    springs = dict.fromkeys(["mount0", "mount1", "mount2", "mount3", "motor"], "base") | {"wrist": "payload"}
    names = {"w": "base.tip to payload.root"} | {spring: f"{owner}.{spring}" for spring, owner in springs.items()}
    for spring in system.provenance.springs:
        one, other = (each.row_stiffness[rows] @ np.abs(each.elastic_rows[rows] @ modes.shapes) ** 2
                      / (each.row_stiffness @ np.abs(each.elastic_rows @ modes.shapes) ** 2)
                      for each, modes, name in ((system, there, spring), (assembly, here, names[spring]))
                      for rows in [each.row_owner == each.provenance.springs.index(name)])  # fmt: skip
        np.testing.assert_allclose(other, one, rtol=1e-7, atol=1e-7 * np.abs(one).max(), err_msg=spring)


def _chain_of_three():
    """A base, a payload and a third body on the payload, with a port of its own, apart and as one model."""
    base, payload = apart()
    payload.add_port("top", "tip", (0.9, 0.2, 0.45))
    third = mv.Model("third")
    _third(third)
    third.add_port("foot", "weight", (0.9, 0.2, 0.45))
    return {"base": base, "payload": payload, "third": third}


def _third(model):
    model.add_body("weight", 0.7, (0.02, 0.03, 0.01), position=(0.95, 0.25, 0.5))
    model.add_bushing("tether", "ground", "weight", (1.0, 0.3, 0.6), (2e3, 3e3, 4e3, 5, 6, 7),
                      damping=(1, 2, 3, 0, 0, 0))  # fmt: skip
    model.add_output("y", "weight", "y")
    model.add_input("G", "weight", (0, 0.6, 0.8), (1.0, 0.2, 0.5))


@pytest.mark.few(2)
@pytest.mark.parametrize("measured", [(), ("third",), ("base", "third"), ("payload",)])
@pytest.mark.parametrize("how", ["rigid", SOFT])
def test_three_parts_in_a_row(measured, how):
    """Channels of the third part follow those of both others, which have more inputs than outputs, or fewer."""
    def join(model):
        fixed(model)
        _third(model)
        at = (0.9, 0.2, 0.45)
        if how == "rigid":
            model.add_joint("glue", "fixed", "tip", "weight", at)
        else:
            model.add_bushing("w", "tip", "weight", at, how[0], damping=how[1])

    names = {"z": "payload.z", "a": "payload.a", "y": "third.y", "F": "base.F", "G": "third.G"}
    parts = {name: model.linearize() for name, model in _chain_of_three().items()}
    for name in measured:
        system = parts[name]
        parts[name] = mv.Measurement(OMEGA, system.frequency_response(OMEGA), system.outputs, system.inputs,
                                     output_units=system.output_units, input_units=system.input_units)  # fmt: skip
    connect = [("third.foot", "payload.top", how), *RIGID]
    result = mv.assemble(parts, connect)
    model = whole(join)
    if not measured:
        same(result, model, names, 1e-11)
        assert dict(zip(result.outputs, result.output_units, strict=True))["third.y"] == "m"
        assert dict(zip(result.inputs, result.input_units, strict=True))["payload.top.rx"] == "N m"
        units = {f"{name}.{one}": unit for name, part in parts.items()
                 for one, unit in zip(part.coordinates, part.coordinate_units, strict=True)}  # fmt: skip
        assert set(units.values()) == {"m", "rad"}
        assert result.coordinate_units == tuple(units[name] for name in result.coordinates)
        return
    expected = model.linearize()[["z", "a", "y"], ["F", "G"]].frequency_response(OMEGA)
    found = result[["payload.z", "payload.a", "third.y"], ["base.F", "third.G"]].responses
    size = np.abs(expected).max(axis=2, keepdims=True)
    np.testing.assert_allclose(found / size, expected / size, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("swap", [False, True])
def test_a_pattern_joins_the_nearest_of_more_ports(swap):
    """Two feet on a plate with four ports: those at the same places, whichever pattern is named first."""
    plate, table = mv.Model("plate"), mv.Model("table")
    plate.add_body("plate", 2.0, (0.1, 0.1, 0.2))
    table.add_body("table", 5.0, (0.3, 0.2, 0.4))
    for i, at in enumerate([(0.3, 0.2, 0.0), (-0.3, 0.2, 0.0), (-0.3, -0.2, 0.0), (0.3, -0.2, 0.0)]):
        plate.add_port(f"corner{i}", "plate", at)
        if i in (1, 3):
            table.add_port(f"foot{i}", "table", at)
    table.add_port("other", "table", (1.0, -0.2, 0.0))
    names = ("table.foot*", "plate.corner*") if swap else ("plate.corner*", "table.foot*")
    result = mv.assemble({"plate": plate, "table": table}, [(*names, [1e4] * 6)])
    joined = [(one.first, one.second) for one in result.provenance.connections]
    expected = [("plate.corner1", "table.foot1"), ("plate.corner3", "table.foot3")]
    assert joined == [pair[::-1] if swap else pair for pair in expected]
    with pytest.raises(ModelError, match=r"'plate\.corner3' is the nearest of two ports, .* fewer of 'table\.\*' and"):
        mv.assemble({"plate": plate, "table": table}, [("table.*", "plate.corner*", [1e4] * 6)])
    system = table.linearize()
    matrices = mv.System.from_matrices(system.M, system.C, system.K, system.B, Cq=system.Cq, inputs=system.inputs,
                                       outputs=system.outputs)  # fmt: skip
    with pytest.raises(ModelError, match=r"matched by position, but that of 'table\.foot1' is not known"):
        mv.assemble({"plate": plate, "table": matrices}, [("plate.corner*", "table.foot*", [1e4] * 6)])
    by_name = mv.assemble({"plate": plate, "table": matrices}, [("plate.corner1", "table.foot1", [1e4] * 6)])
    assert by_name.provenance.connections[0].distance is None


def test_ports_may_be_as_far_apart_as_is_said():
    base, payload = apart()[0], mv.Model("payload")
    add_payload(payload)
    payload.add_port("root", "pay", (POINT[0], POINT[1] + 0.004, POINT[2] - 0.003))
    result = mv.assemble({"base": base, "payload": payload}, RIGID, distance=0.006)
    assert result.provenance.connections[0].distance == pytest.approx(0.005)
    with pytest.raises(ModelError, match=r"0\.005 m apart; expected at most distance=0\.004 m"):
        mv.assemble({"base": base, "payload": payload}, RIGID, distance=0.004)


@pytest.mark.parametrize(("matrix", "right"), [
    ([[2e3, 1e3], [1e3, 1e3]], True), ([[2e3, 1e3], [1e3, 0.4e3]], False), ([[2e3, 1e3], [-1e3, 1e3]], False),
    ([[2e3, 0.0], [0.0, -1e-3]], False), ([[2e9, 1e-3], [-1e-3, 1e-6]], False), ([[1.0, np.nan], [0.0, 1.0]], False),
    ([1.0, np.inf], False), ([[1.0, 2.0]], False), ("two", False), ([1.0, 2.0], True), ([0.0, 0.0], True),
])  # fmt: skip
@pytest.mark.parametrize("field", ["stiffness", "damping"])
def test_stiffness_and_damping_are_those_of_a_passive_spring(matrix, right, field):
    """Symmetric and positive semidefinite, whatever the units of the directions, or a number for each direction."""
    parts = dict(zip(("base", "payload"), apart(), strict=True))
    how = matrix if field == "stiffness" else ([1.0, 1.0], matrix)
    connect = [(*RIGID[0][:2], how, ("x", "ry"))]
    if right:
        soft = mv.assemble(parts, connect)
        name = ["base.tip to payload.root"]
        rows = soft.row_owner == soft.provenance.springs.index(*name)
        full = np.array(matrix) if np.ndim(matrix) == 2 else np.diag(matrix)
        weights = soft.row_stiffness if field == "stiffness" else soft.row_damping
        apart_by = (soft.Cq[[soft.outputs.index(f"payload.root.{d}") for d in ("x", "ry")]]
                    - soft.Cq[[soft.outputs.index(f"base.tip.{d}") for d in ("x", "ry")]])  # fmt: skip
        gram = soft.elastic_rows[rows].T @ (weights[rows][:, None] * soft.elastic_rows[rows])
        np.testing.assert_allclose(gram, apart_by.T @ full @ apart_by, atol=1e-9)
        return
    with pytest.raises(ModelError, match=f"{field} of 'base.tip' and 'payload.root'|joined 'two'"):
        mv.assemble(parts, connect)


@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("order", [("ry", "x", "rz"), ("rz", "ry", "x"), ("x", "ry", "rz")])
def test_stiffness_is_in_the_order_of_the_directions(measured, order):
    """Whatever this order is; those of a mount at the same point in one model."""
    base, payload = (model.linearize() for model in apart())
    part = base if not measured else mv.Measurement(OMEGA, base.frequency_response(OMEGA), base.outputs, base.inputs,
                                                    output_units=base.output_units)  # fmt: skip
    known, damping = {"x": 1e5, "ry": 40.0, "rz": 700.0}, {"x": 20.0, "ry": 0.3, "rz": 0.0}
    matrix = np.diag([known[d] for d in order])
    at = order.index("x"), order.index("ry")
    matrix[at] = matrix[at[::-1]] = 900.0
    how = matrix, [damping[d] for d in order]
    result = mv.assemble({"base": part, "payload": payload}, [("base.tip", "payload.root", how, order)])
    full, rates = np.zeros((6, 6)), np.zeros(6)
    for one, d in enumerate(("x", "y", "z", "rx", "ry", "rz")):
        full[one, one], rates[one] = known.get(d, 0.0), damping.get(d, 0.0)
    full[0, 4] = full[4, 0] = 900.0
    model = whole(lambda model: model.add_bushing("w", "link", "pay", POINT, full, damping=rates))
    expected = model.linearize()[["z", "a"], "F"].frequency_response(OMEGA)
    part = result[["payload.z", "payload.a"], "base.F"]
    found = part.responses if measured else part.frequency_response(OMEGA)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert (result.connections if measured else result.provenance.connections)[0].directions == order


@pytest.mark.parametrize("given", ["", 3, None])
def test_parts_have_names(given):
    base, payload = apart()
    with pytest.raises(ModelError, match="a part has the name"):
        mv.assemble({"base": base, given: payload}, RIGID)


def test_ports_have_inputs_and_outputs_of_the_same_names():
    """In the order of the directions, whatever that of the channels; a name that reads as a pattern is itself."""
    model = mv.Model("m")
    model.add_body("m", 2.0, (0.1, 0.2, 0.3))
    for name in ("p[1].rz", "p[1].x", "p[1].y", "q.z", "x"):
        model.add_output(name, "m", name.rpartition(".")[2])
    for name in ("p[1].x", "p[1].rz", "q.y", "x"):
        model.add_input(name, "m", name.rpartition(".")[2])
    other = mv.Model("o")
    other.add_body("m", 1.0, (0.1, 0.2, 0.3))
    for name in ("p[1].x", "p[1].rz", "p1.x"):
        other.add_input(name, "m", name.rpartition(".")[2])
        other.add_output(name, "m", name.rpartition(".")[2])
    result = mv.assemble({"m": model, "o": other}, [("m.p[1]", "o.p[1]", "rigid")])
    (one,) = result.provenance.connections
    assert (one.first, one.second, one.directions) == ("m.p[1]", "o.p[1]", ("x", "rz"))
    for unknown in ("m.q", "m.x", "m."):
        with pytest.raises(ModelError, match=r"is unknown; expected one of m\.p\[1\], o\.p\[1\], o\.p1"):
            mv.assemble({"m": model, "o": other}, [(unknown, "o.p[1]", "rigid")])


def test_ports_that_are_unknown_are_told_with_those_that_there_are():
    bare, base = mv.Model("bare"), apart()[0]
    bare.add_body("m", 1.0, (1, 1, 1))
    with pytest.raises(ModelError, match=r"port 'a\.p' is unknown; no part has one\. Inputs and outputs of a"):
        mv.assemble({"a": bare, "b": bare}, [("a.p", "b.p", "rigid")])
    with pytest.raises(ModelError, match=r"port 'other\.p' is unknown; expected one of base\.tip\.(?!.*Inputs)"):
        mv.assemble({"base": base, "b": bare}, [("other.p", "base.tip", "rigid")])


@pytest.mark.parametrize("which", ["first", "second", "both"])
def test_ground_moves_alike_for_all_parts(which):
    """Motions that one part lacks, or that differ, are refused; those of no input do not count."""
    base, payload = apart()
    base.add_base_motion("floor", "z" if which != "second" else "x")
    if which != "first":
        payload.add_base_motion("floor", "z" if which == "second" else "x")
    for parts in ({"base": base, "payload": payload}, {"payload": payload, "base": base}):
        with pytest.raises(ModelError, match="moves by 'floor'"):
            mv.assemble(parts, RIGID)
    if which == "first":
        still = base.linearize()[:, ["F", "tip.*"]]
        assert "floor" not in mv.assemble({"base": still, "payload": payload}, RIGID).inputs


@pytest.mark.parametrize("how", ["rigid", SOFT])
def test_motions_of_the_ground_have_one_input(how):
    """Two of them, in another order in each part, with the responses of one model."""
    base, payload = apart()
    model = whole(_connector(how))
    for one, order in ((base, "zx"), (payload, "xz"), (model, "xz")):
        for axis in order:
            one.add_base_motion(f"floor.{axis}", axis)
    payload.add_spring("wall", "ground", "pay", (0.7, 1.0, 0.3), (0.7, 0.1, 0.3), stiffness=3e3, damping=4.0)
    model.add_spring("wall", "ground", "pay", (0.7, 1.0, 0.3), (0.7, 0.1, 0.3), stiffness=3e3, damping=4.0)
    assembly = mv.assemble({"base": base, "payload": payload}, [(*RIGID[0][:2], how)])
    floors = {f"floor.{axis}": f"floor.{axis}" for axis in "xz"}
    same(assembly, model, {name: NAMES[name] for name in ("z", "F")} | floors, 1e-11)
    units = dict(zip(assembly.inputs, assembly.input_units, strict=True))
    assert [units[name] for name in ("floor.x", "base.tip.rx", "payload.root.y")] == ["m/s^2", "N m", "N"]


@pytest.mark.parametrize("length", [1e-4, 1.0, 1e5])
@pytest.mark.parametrize("mass", [1e-15, 1.0, 1e20])
def test_units_do_not_change_what_is_joined(length, mass):
    """Lengths in km or mm, masses in t or mg: the same frequencies of two bodies that are joined rigidly."""
    frequencies = []
    for unit, size in ((1.0, 1.0), (length, mass)):
        parts = {}
        for name, at in (("a", -0.4), ("b", 0.7)):
            model = mv.Model(name)
            inertia = tuple(size * unit**2 * one for one in (0.3, 0.4, 0.5))
            model.add_body("m", 2.0 * size, inertia, position=(at * unit, 0.1 * unit, 0.2 * unit))
            k = [size * one for one in (1e3, 2e3, 3e3)] + [size * unit**2 * one for one in (300.0, 400.0, 500.0)]
            model.add_bushing("k", "ground", "m", (at * unit, 0, 0), k)
            model.add_port("p", "m", (0.1 * unit, 0.0, 0.3 * unit))
            parts[name] = model
        joined = mv.assemble(parts, [("a.p", "b.p", "rigid")])
        assert joined.dof == 6
        frequencies.append(joined.modes().natural)
    np.testing.assert_allclose(frequencies[1], frequencies[0], rtol=1e-9)


@pytest.mark.parametrize("length", [1e-8, 1.0, 1e8])
def test_units_do_not_change_what_is_collocated(length):
    """An output a thousandth of the part beside its input is refused, and one of 1e-12 of it is not."""
    parts = {}
    for name, beside in (("a", 0.0), ("b", 1e-12), ("c", 1e-3)):
        model = mv.Model(name)
        model.add_body("m", 2.0, tuple(length**2 * one for one in (0.3, 0.4, 0.5)), position=(0.4 * length, 0, 0))
        model.add_input("p.x", "m", "x", (0, 0.1 * length, 0))
        model.add_output("p.x", "m", "x", (0, (0.1 + beside) * length, 0))
        parts[name] = model
    distance = 0.01 * length
    assert mv.assemble({name: parts[name] for name in "ab"}, [("a.p", "b.p", "rigid")], distance=distance).dof == 11
    with pytest.raises(ModelError, match=r"input 'c\.p\.x' does not act where and as output"):
        mv.assemble({name: parts[name] for name in "ac"}, [("a.p", "c.p", "rigid")], distance=distance)


def test_connections_that_nearly_coincide_are_in_doubt():
    """Points 1e-10 m and 1e-12 m apart lock rotations or repeat what others lock: rounding of places decides."""
    parts = {}
    for name, at in (("a", -0.4), ("b", 0.7)):
        model = mv.Model(name)
        model.add_body("m", 2.0, (0.3, 0.4, 0.5), position=(at, 0.1, 0.2))
        for port, place in (("p", (0, 0, 0)), ("near", (1e-10, 0, 0)), ("other", (0, 1e-12, 0)), ("far", (1e-3, 0, 0))):
            for axis in "xyz":
                model.add_input(f"{port}.{axis}", "m", axis, place)
                model.add_output(f"{port}.{axis}", "m", axis, place)
        parts[name] = model

    def joined(*ports):
        return mv.assemble(parts, [(f"a.{port}", f"b.{port}", "rigid") for port in ports])

    with pytest.raises(SingularPoseError, match="in doubt whether a rigid connection locks a motion or repeats"):
        joined("p", "near", "other")
    assert joined("p", "far").dof == 12 - 5
    assert joined("p").dof == 12 - 3


def test_ports_of_small_parts_are_not_joined_across_them():
    """Corners of chips of 0.4 mm are 0.4 mm apart, less than parts of a machine are made to."""
    parts = {}
    for name, x in (("die", 0.0), ("lid", 2e-6)):
        model = mv.Model(name)
        model.add_body(name, 1e-9, (2e-17, 2e-17, 2e-17))
        for port, at in (("left", -2e-4), ("right", 2e-4)):
            model.add_port(port, name, position=(at + x, 0, 0))
        parts[name] = model.linearize()
    assert mv.assemble(parts, [("die.left", "lid.left", "rigid")]).dof == 6
    with pytest.raises(ModelError, match=r"0\.000402 m apart; expected at most distance=2e-05 m"):
        mv.assemble(parts, [("die.left", "lid.right", "rigid")])
    assert mv.assemble(parts, [("die.left", "lid.right", "rigid")], distance=1e-3).dof == 6
