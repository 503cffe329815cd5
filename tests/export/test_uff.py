"""Universal files: written here and read by pyuff, written by pyuff and read here."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib.measurement.points import Point
from mbsvib.responses.frequency_grid import resonant_grid
from tests.export.plants import INERTIA, same_bits, slider, stewart

pyuff = pytest.importorskip("pyuff", reason="pyuff is not installed: pip install 'mbsvib[test]'")


def sets_of(path, kind):
    """Data sets of a kind, by pyuff."""
    file = pyuff.UFF(str(path))
    return [file.read_sets(k) for k, number in enumerate(file.get_set_types()) if number == kind]


def arm(damping=0.0):
    """A rod on a hinge with ports at its end: along axes, against them, at an angle, about the hinge, relative."""
    model = mv.Model("arm")
    model.add_body("rod", 2.0, INERTIA, (0.5, 0, 0))
    model.add_body("cart", 1.0, INERTIA, (1, 0, 2))
    model.add_joint("hinge", "spherical", "ground", "rod", (0, 0, 0))
    model.add_joint("guide", "prismatic", "ground", "cart", axis=(1, 0, 0))
    model.add_bushing("k", "ground", "rod", (0, 0, 0), (0, 0, 0, 30.0, 20.0, 10.0), (0, 0, 0, 0, damping, 0))
    model.add_spring("s", "rod", "cart", start=(1, 0, 0), end=(1.5, 0.5, 2), stiffness=1e3)
    model.add_bushing("c", "ground", "cart", (1, 0, 2), (50.0, 0, 0, 0, 0, 0), (0,) * 6)
    tip = (1.0, 0.0, 0.0)
    model.add_input("F", "rod", (0, 0, -1), tip)
    model.add_input("M", "rod", "ry")
    model.add_input("slant", "rod", (0, -0.6, 0.8), tip)
    model.add_input("between", "rod", "y", tip, relative_to="cart")
    model.add_output("z", "rod", "z", tip)
    model.add_output("v", "rod", "z", tip, quantity="velocity")
    model.add_output("other", "rod", "z")
    model.add_output("ry", "rod", "ry")
    model.add_output("along", "rod", (0, 0.6, -0.8), tip)
    model.add_output("apart", "rod", "y", tip, relative_to="cart")
    model.add_force_output("force", "s", "z")
    return model.linearize()


@pytest.mark.slow
def test_pyuff_reads_every_response(tmp_path):
    system = stewart()
    omega = np.geomspace(10.0, 1e5, 40)
    path = mx.to_uff(system, tmp_path / "plant.uff", omega)
    exact = system.frequency_response(2 * np.pi * (omega / (2 * np.pi)))
    for k, item in enumerate(sets_of(path, 58)):
        i, j = k % len(system.outputs), k // len(system.outputs)
        assert same_bits(np.asarray(item["data"]), np.ascontiguousarray(exact[i, j]))
    measured = mx.from_uff(path)
    assert measured.omega == pytest.approx(omega, rel=4e-16)
    assert same_bits(measured.responses, exact)
    for key in ("inputs", "input_units", "outputs", "output_units"):
        assert getattr(measured, key) == getattr(system, key)
    assert (measured.is_measured.all(), measured.left_out) == (True, ())
    assert repr(measured) == "Measurement(15 inputs, 24 outputs, 40 frequencies, 14 nodes, 0 modes)"
    assert mx.check_export(path, system).passed


def test_a_set_says_what_it_is(tmp_path):
    system = slider(outputs=("mass.z",))
    path = mx.to_uff(system, tmp_path / "x.uff")
    (one,) = sets_of(path, 58)
    assert (one["func_type"], one["rsp_node"], one["ref_node"]) == (4, 1, 1)
    assert (one["rsp_dir"], one["ref_dir"]) == (3, 3)
    assert (one["ordinate_spec_data_type"], one["orddenom_spec_data_type"]) == (8, 13)  # displacement, force
    assert (one["abscissa_spec_data_type"], one["abscissa_axis_units_lab"].strip()) == (18, "Hz")
    assert one["rsp_ent_name"].strip() == "mass.z"
    assert len(one["x"]) == len(resonant_grid(system.poles()))
    assert int(one["n_bytes"]) == 24 * len(one["x"])
    (units,) = sets_of(path, 164)
    assert (units["units_code"], units["length"], units["force"], units["temp_offset"]) == (1, 1.0, 1.0, 273.15)


def test_frequencies_resolve_every_resonance_of_any_number_of_ports(tmp_path):
    """The peak of a mode of damping ratio z is F / (2 z k); points follow from the modes alone."""
    grids = []
    for ports in (1, 5):
        model = mv.Model("row")
        for i in range(5):
            model.add_body(f"b{i}", 1.0, (1, 1, 1), (i, 0, 0))
            model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", (i, 0, 0), axis=(0, 0, 1))
            model.add_spring(f"k{i}", "ground", f"b{i}", (i, 0, -1), (i, 0, 0), 10.0 ** (2 + i), 0.02)
        for i in range(ports):
            model.add_input(f"f{i}", f"b{i}", "z")
            model.add_output(f"z{i}", f"b{i}", "z")
        measured = mx.from_uff(mx.to_uff(model.linearize(), tmp_path / "row.uff"))
        grids.append(measured.omega)
    np.testing.assert_allclose(*grids, rtol=1e-14)
    peaks = np.abs(measured.responses[range(5), range(5)]).max(axis=1)
    np.testing.assert_allclose(peaks, 1.0 / (0.02 * np.sqrt(10.0 ** np.arange(2, 7))), rtol=1e-3)


def test_points_are_those_of_the_model(tmp_path, capsys):
    system = arm()
    path = mx.to_uff(system, tmp_path / "x.uff", [1.0])
    measured = mx.from_uff(path)
    rod, cart, tip, slant, between, force = range(1, 7)
    assert [(node.number, node.name) for node in measured.nodes] == [
        (rod, "rod"), (cart, "cart"), (tip, "rod"), (slant, "rod")]  # fmt: skip
    assert [node.position for node in measured.nodes] == [(0.5, 0, 0), (1, 0, 2), (1, 0, 0), (1, 0, 0)]
    assert measured.input_points == (Point(tip, -3), Point(rod, 5), Point(slant, -1), Point(between, 0))
    assert measured.output_points == (Point(tip, 3), Point(tip, 3), Point(rod, 3), Point(rod, 5), Point(slant, 1),
                                   Point(between, 0), Point(force, 0))  # fmt: skip
    assert measured.driving_points == (("z", "F"), ("v", "F"), ("ry", "M"), ("along", "slant"), ("apart", "between"))
    assert measured.lines == ((rod, tip), (rod, slant))
    (nodes,), (trace,) = sets_of(path, 2411), sets_of(path, 82)
    assert np.array_equal(np.column_stack([nodes[key] for key in ("node_nums", "x", "y", "z")]),
                          [(1, 0.5, 0, 0), (2, 1, 0, 2), (3, 1, 0, 0), (4, 1, 0, 0)])  # fmt: skip
    assert list(nodes["disp_cs"]) == [0, 0, 0, 4]
    assert list(trace["nodes"]) == [1, 3, 0, 1, 4, 0]
    (axes,) = sets_of(path, 2420)
    assert np.allclose(np.ravel(axes["CS_matrices"])[:3], (0, 0.6, -0.8), atol=1e-15)
    groups = sets_of(path, 2467)
    assert [group["group_name"] for item in groups for group in item["groups"]] == ["rod", "cart"]
    capsys.readouterr()  # pyuff prints what it finds in groups


def test_parts_that_several_bodies_share_have_nodes(tmp_path):
    """Nodes of beams are bodies, at the points of the beam."""
    system = library.cantilever().linearize()
    measured = mx.from_uff(mx.to_uff(system, tmp_path / "x.uff", [1.0]))
    assert {node.name for node in measured.nodes} == set(system.bodies)
    by_name = {node.name: node.position for node in measured.nodes}
    assert np.allclose(np.diff([by_name[f"tube.{k}"] for k in range(1, 19)], axis=0), [0.5, 0, 0])


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_modes(damping, tmp_path):
    """Shapes at all nodes, of a normal mode with rotations, and eigenvectors of the quadratic problem."""
    system = arm(damping)
    path = mx.to_uff(system, tmp_path / "x.uff", [1.0], modes=True)
    measured, modes = mx.from_uff(path), system.modes()
    assert len(measured.modes) == system.dof
    assert [mode.frequency for mode in measured.modes] == pytest.approx(modes.frequencies, rel=1e-5)
    assert [mode.damping_ratio for mode in measured.modes] == pytest.approx(modes.damping_ratios, rel=1e-4, abs=1e-12)
    rod = dict(zip(system.bodies, system.body_motion, strict=True))["rod"]
    for k, mode in enumerate(measured.modes):
        assert np.iscomplexobj(mode.shape) == bool(damping)
        assert mode.nodes == (1, 2, 3, 4)
        phi = modes.shapes[:, k]
        truth = rod @ phi
        tip = truth[:3] + np.cross(truth[3:], (0.5, 0, 0))
        for row, expected in ((0, truth[:3]), (2, tip), (3, tip)):  # also in the axes of node 4
            assert mode.shape[row, :3] == pytest.approx(expected, rel=1e-4, abs=2e-5 * np.abs(truth).max())
        if damping:
            assert np.isnan(mode.shape[:, 3:]).all()
            value = modes.pairs[k, 0]
            rest = (value**2 * system.M + value * system.C + system.K) @ phi
            assert np.abs(rest).max() < 1e-9 * np.abs(system.K).max()
        else:
            assert mode.shape[2, 3:] == pytest.approx(truth[3:], rel=1e-4, abs=2e-5 * np.abs(truth).max())
    theirs = sets_of(path, 55)
    assert [item["analysis_type"] for item in theirs] == [3 if damping else 2] * system.dof
    for item, mode in zip(theirs, measured.modes, strict=True):
        if damping:
            assert abs(item["eig"]) == pytest.approx(2 * np.pi * mode.frequency, rel=1e-5)
        else:
            assert item["freq"] == pytest.approx(mode.frequency)
        assert np.array_equal(item["r2"][:3], mode.shape[:3, 1])
    # the same file in millimetres
    path.write_bytes(path.read_bytes().replace(b"1.0000000000000000D+00", b"1.0000000000000000D+03", 1))
    shorter = mx.from_uff(path)
    for node, same in zip(measured.nodes, shorter.nodes, strict=True):
        assert same.position == pytest.approx(np.multiply(1e-3, node.position))
    for mode, same in zip(measured.modes, shorter.modes, strict=True):
        np.testing.assert_allclose(same.shape, mode.shape * np.repeat([1e-3, 1.0], 3), rtol=1e-12, atol=1e-20)


def analysis_data(analysis, reals, nodes, *, location=1, layout=(3, 8, 2, 6), name="bending"):
    """A data set 2414, as programs of finite elements write modes: twelve real numbers, then values at nodes."""
    lines = [f"{-1:6d}", f"{2414:6d}", f"{1:10d}", name, f"{location:10d}", *["NONE"] * 5,
             "".join(f"{value:10d}" for value in (1, analysis, *layout)), *[f"{0:10d}" * 8] * 2]  # fmt: skip
    numbers = np.zeros(12)
    numbers[list(reals)] = list(reals.values())
    lines += ["".join(f"{value:13.5E}" for value in numbers[k : k + 6]) for k in (0, 6)]
    for node, values in nodes.items():
        lines.append(f"{node:10d}")
        lines += ["".join(f"{value:13.5E}" for value in values[k : k + 6]) for k in range(0, len(values), 6)]
    return "\n".join([*lines, f"{-1:6d}", ""])


def test_modes_of_analysis_data(tmp_path):
    """Data set 2414: frequency and damping of normal modes, eigenvalues of complex ones, as pyuff reads them."""
    path, six = tmp_path / "modes.unv", {3: (1.0, 2.0, 3.0, 0.1, 0.2, 0.3), 7: (0.0, -1.0, 0.5, 0.0, 0.0, 0.0)}
    complex_three = {3: (1.0, 0.5, 2.0, -0.5, 0.0, 0.25)}
    path.write_text(
        analysis_data(2, {1: 12.5, 4: 0.01}, six) + analysis_data(2, {2: (2 * np.pi * 20.0) ** 2}, six, name="torsion")
        + analysis_data(3, {6: -3.0, 7: 40.0}, complex_three, layout=(2, 8, 5, 3), name="damped")
    )  # fmt: skip
    measured = mx.from_uff(path)
    bending, torsion, damped = measured.modes
    assert (bending.name, torsion.name, damped.name) == ("bending", "torsion", "damped")
    assert (bending.frequency, bending.damping_ratio, bending.nodes) == (12.5, 0.01, (3, 7))
    assert torsion.frequency == pytest.approx(20.0, rel=1e-5)
    assert damped.frequency == pytest.approx(abs(-3 + 40j) / (2 * np.pi))
    assert damped.damping_ratio == pytest.approx(3.0 / abs(-3 + 40j))
    np.testing.assert_array_equal(bending.shape, list(six.values()))
    np.testing.assert_array_equal(damped.shape[0, :3], [1 + 0.5j, 2 - 0.5j, 0.25j])
    theirs = sets_of(path, 2414)
    assert theirs[0]["record12_field2"] == 12.5
    np.testing.assert_array_equal(theirs[2]["node_nums"], damped.nodes)
    assert not measured.left_out


def coordinate_systems(**kinds):
    """A data set 2420: systems of some types by number, all with the origin (1, 0, 0)."""
    lines = [f"{-1:6d}", f"{2420:6d}", f"{1:10d}", "part"]
    for name, kind in kinds.items():
        lines += [f"{int(name[1:]):10d}{kind:10d}{8:10d}", name]
        lines += ["".join(f"{value:25.16E}" for value in row) for row in (*np.eye(3), (1.0, 0.0, 0.0))]
    return "\n".join([*lines, f"{-1:6d}", ""])


def nodes_15(*nodes):
    """A data set 15: number, definition and displacement coordinate system, and position of each node."""
    lines = ["".join(f"{value:10d}" for value in (*numbers, 8)) + "".join(f"{value:13.5E}" for value in position)
             for *numbers, position in nodes]  # fmt: skip
    return "\n".join([f"{-1:6d}", f"{15:6d}", *lines, f"{-1:6d}", ""])


def test_coordinate_systems_of_all_types(tmp_path):
    """Nodes in cylindrical (r, phi, z) and spherical (r, theta, phi) systems, displacements along their directions."""
    path, unit = tmp_path / "round.unv", {4: (1.0, 0.0, 0.0), 5: (0.0, 1.0, 0.0), 6: (0.0, 1.0, 0.0)}
    path.write_text(
        nodes_15((4, 1, 1, (2.0, 90.0, 1.0)), (5, 0, 1, (1.0, 2.0, 1.0)), (6, 2, 2, (3.0, 90.0, 0.0)))
        + analysis_data(2, {1: 12.5}, unit, layout=(2, 8, 2, 3)) + coordinate_systems(c1=1, s2=2)
    )  # fmt: skip
    measured = mx.from_uff(path)
    positions = [node.position for node in measured.nodes]
    np.testing.assert_allclose(positions, [(1, 2, 1), (1, 2, 1), (4, 0, 0)], atol=1e-15)
    shape = measured.modes[0].shape[:, :3]
    np.testing.assert_allclose(shape, [(0, 1, 0), (-1, 0, 0), (0, 0, -1)], atol=1e-15)
    assert not measured.left_out
    path.write_text(nodes_15((4, 7, 0, (2.0, 90.0, 1.0))))
    assert mx.from_uff(path).left_out[0].startswith("1 of coordinate system 7, which is not in the file")


def test_modes_that_cannot_be_read_are_named(tmp_path):
    path, six = tmp_path / "modes.unv", {3: (1.0, 2.0, 3.0, 0.1, 0.2, 0.3)}
    path.write_text(analysis_data(2, {1: 12.5}, six) + analysis_data(2, {1: 12.5}, six, layout=(3, 11, 2, 6))
                    + analysis_data(1, {}, six))  # fmt: skip
    message = "modes are left out: 1 of data set 2414: analysis type 2, result type 11"
    with pytest.warns(mv.LeftOutWarning, match=message):
        measured = mx.from_uff(path)
    assert len(measured.modes) == 1
    assert measured.left_out[1].startswith("1 of data set 2414: analysis type 1")


def test_text_holds_the_responses_at_the_frequencies_that_it_holds(tmp_path):
    system = stewart()
    omega = 1e4 * np.sqrt([0.2, 0.3, 0.5])
    path = mx.to_uff(system, tmp_path / "x.uff", omega, binary=False)
    assert path.read_bytes().isascii()
    measured = mx.from_uff(path)
    assert measured.omega == pytest.approx(omega, rel=1e-5)
    exact = system.frequency_response(measured.omega)
    assert np.abs(measured.responses - exact).max(axis=2) == pytest.approx(0.0, abs=1e-9 * np.abs(exact).max())


def test_systems_without_geometry_have_a_node_for_each_port(tmp_path):
    data = mx.from_json(mx.to_json(slider()))
    measured = mx.from_uff(mx.to_uff(data, tmp_path / "x.uff", [1.0]))
    assert (measured.nodes, measured.driving_points) == ((), ())
    assert (measured.input_points, measured.output_points) == ((Point(1, 0),), (Point(2, 0),))
    with pytest.raises(mv.ExportError, match="modes = True; only a System has modes"):
        mx.to_uff(data, tmp_path / "x.uff", [1.0], modes=True)


def function(response, reference, values, frequency, **more):
    """A data set 58 as pyuff takes it: node and direction of both ends."""
    return {"type": 58, "func_type": 4, "rsp_node": response[0], "rsp_dir": response[1], "ref_node": reference[0],
            "ref_dir": reference[1], "data": values, "x": frequency, "id1": "measured", "rsp_ent_name": "NONE",
            "ref_ent_name": "NONE", "abscissa_spacing": 1, "abscissa_spec_data_type": 18,
            "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13, "binary": 0} | more  # fmt: skip


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("spacing", [0, 1])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_what_pyuff_writes_is_read(binary, spacing, precision, tmp_path):
    """A hammer that roves: not every pair is measured."""
    rng = np.random.default_rng(0)
    frequency = np.arange(1.0, 12.0)
    values = [rng.standard_normal(11) + 1j * rng.standard_normal(11) for _ in range(3)]
    ends = [((1, 3), (1, -3)), ((2, -1), (1, -3)), ((1, 3), (7, 5))]
    path = tmp_path / "x.uff"
    file = pyuff.UFF(str(path))
    for k, (ends_of, value) in enumerate(zip(ends, values, strict=True)):
        data = function(*ends_of, value, frequency, abscissa_spacing=spacing, ord_data_type=5 + (precision == "double"),
                        rsp_ent_name="BEAM" if k else "NONE")  # fmt: skip
        file._write_set(data, "overwrite" if k == 0 else "add", force_double=precision == "double")
    file._write_set({"type": 15, "node_nums": [1, 2, 7], "x": [0.0, 1.0, 2.0], "y": [0.0] * 3, "z": [0.5] * 3}, "add")
    if binary:
        path.write_bytes(in_binary(path.read_bytes(), values, frequency, spacing, precision))
    measured = mx.from_uff(path)
    assert measured.outputs == ("1+Z", "BEAM:2-X", "BEAM:1+Z")
    assert measured.inputs == ("1-Z", "7+RY")
    assert (measured.output_units[0], measured.input_units) == ("m/s^2", ("N", "N m"))
    assert measured.omega == pytest.approx(2 * np.pi * frequency, rel=1e-6)
    error = 1e-5 if precision == "single" and not binary else 1e-7 if precision == "single" else 1e-11
    for at, value in zip(((0, 0), (1, 0), (2, 1)), values, strict=True):
        assert measured.responses[at] == pytest.approx(value, rel=error, abs=error)
    assert measured.is_measured.tolist() == [[True, False], [True, False], [False, True]]
    assert measured.nodes[1].position == (1.0, 0.0, 0.5)


def in_binary(raw, values, frequency, spacing, precision):
    """The same sets with big-endian binary numbers behind their heads; pyuff miscounts those that it writes."""
    parts, kind = raw.decode().split("    58" + " " * 74 + "\n"), {"single": ">f4", "double": ">f8"}[precision]
    result = parts[0].encode()
    for part, value in zip(parts[1:], values, strict=True):
        ends = (value.real, value.imag) if np.iscomplexobj(value) else (value,)
        table = np.column_stack((*(() if spacing else (frequency,)), *ends)).astype(kind).tobytes()
        head = f"    58b{2:6}{2:6}{11:12}{len(table):12}{0:6}{0:6}{0:12}{0:12}\n"
        lines = part.splitlines(keepends=True)
        end = next(k for k, line in enumerate(lines) if line.strip() == "-1")
        result += head.encode() + "".join(lines[:11]).encode() + table + "".join(["\n", *lines[end:]]).encode()
    return result


def test_other_units_are_converted(tmp_path):
    """Millimetres and kilonewtons: 164 says how many units of the file are one of SI."""
    path = tmp_path / "x.uff"
    file = pyuff.UFF(str(path))
    units = {"type": 164, "units_code": 9, "length": 1000.0, "force": 0.001, "temp": 1.0, "temp_offset": 273.15}
    file._write_set(units, "overwrite")
    value = np.ones(3, dtype=complex)
    for ends in (((1, 3), (1, 3)), ((1, 6), (1, 3)), ((1, 3), (1, 6)), ((1, 6), (1, 6))):
        file._write_set(function(*ends, value, np.arange(1.0, 4.0), ordinate_spec_data_type=8), "add")
    file._write_set({"type": 2411, "node_nums": [1], "def_cs": [0], "disp_cs": [0], "color": [0], "x": [500.0],
                     "y": [0.0], "z": [0.0]}, "add")  # fmt: skip
    measured = mx.from_uff(path)
    # mm/kN = 1e-6 m/N, rad/kN = 1e-3 rad/N, mm/(kN mm) = 1e-3 m/(N m), rad/(kN mm) = 1 rad/(N m)
    assert measured.responses[:, :, 0].real == pytest.approx(np.array([[1e-6, 1e-3], [1e-3, 1.0]]))
    assert (measured.output_units, measured.input_units) == (("m", "rad"), ("N", "N m"))
    assert measured.nodes[0].position == (0.5, 0.0, 0.0)
    file._write_set(function((1, 2), (1, 3), value, np.arange(1.0, 4.0), ordinate_spec_data_type=0), "add")
    with pytest.raises(mv.ExportError, match=r"x\.uff: .*data of type 0 in a file whose units are not SI"):
        mx.from_uff(path)


def in_millimetres(file):
    file._write_set({"type": 164, "units_code": 10, "units_description": "mm", "temp_mode": 2, "length": 1e3,
                     "force": 1e-3, "temp": 1.0, "temp_offset": 273.15}, "overwrite")  # fmt: skip


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("spacing", [0, 1])
def test_coherence_gives_the_variance_with_the_number_of_averages(tmp_path, binary, spacing):
    path, f = tmp_path / "x.uff", np.arange(1.0, 4.0)
    file = pyuff.UFF(str(path))
    in_millimetres(file)
    values = np.array([1.0, 2.0j, 3.0]), np.array([0.5, 0.8, 1.0])
    for value, kind in zip(values, (4, 6), strict=True):
        file._write_set(function((1, 3), (1, 3), value, f, func_type=kind, abscissa_spacing=spacing,
                                 ord_data_type=6 if kind == 4 else 4), "add", force_double=True)  # fmt: skip
    if binary:
        path.write_bytes(in_binary(path.read_bytes(), values, f, spacing, "double"))
    measured = mx.from_uff(path)
    assert measured.left_out == ()
    assert measured.coherence[0, 0].tolist() == [0.5, 0.8, 1.0]
    variance = replace(measured, averages=8).variance[0, 0]
    np.testing.assert_allclose(variance, np.array([1.0, 4.0 * 0.25, 0.0]) / 8 * 1e-12, rtol=1e-12)
    file._write_set(function((1, 3), (1, 3), np.full(3, 2.0), f, func_type=6), "add")
    with pytest.raises(mv.ExportError, match=r"x\.uff: .*coherence of '1\+Z' to '1\+Z' is 2 at 1 Hz"):
        mx.from_uff(path)


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("spacing", [0, 1])
def test_time_records_and_densities(tmp_path, binary, spacing):
    """From records that pyuff writes to responses; one sample of delay and half the size."""
    path, t = tmp_path / "x.uff", np.arange(512) / 100.0 - 1.0
    u = np.random.default_rng(0).standard_normal(512)
    file = pyuff.UFF(str(path))
    in_millimetres(file)
    more = {"func_type": 1, "abscissa_spec_data_type": 17, "orddenom_spec_data_type": 0, "ord_data_type": 4,
            "abscissa_spacing": spacing}  # fmt: skip
    values = u, 500.0 * np.roll(u, 1)
    for end, value, kind in zip(((1, 1), (2, -3)), values, (13, 8), strict=True):
        file._write_set(function(end, (0, 0), value, t, ordinate_spec_data_type=kind, **more), "add",
                        force_double=True)  # fmt: skip
    if binary:
        path.write_bytes(in_binary(path.read_bytes(), values, t, spacing, "double"))
    records = mx.records_from_uff(path)
    assert [(item["name"], item["unit_str"]) for item in records] == [("1+X", "N"), ("2-Z", "m")]
    np.testing.assert_allclose(records[0]["time"], t, atol=1e-5)
    np.testing.assert_allclose(records[1]["data"], 0.5 * np.roll(u, 1), rtol=1e-6)
    data = mv.Measurement.from_sep005(records, "1+X", segments=4)
    np.testing.assert_allclose(data.responses[0, 0], 5e-4 * np.exp(-0.01j * data.omega), rtol=0.15)
    with pytest.raises(mv.ExportError, match=r"densities_from_uff: .*x.uff holds no spectral densities"):
        mx.densities_from_uff(path)
    file._write_set(function((2, 3), (0, 0), np.array([4.0, 9.0]), np.array([1.0, 2.0]), func_type=9,
                             ordinate_spec_data_type=12, orddenom_spec_data_type=0), "add")  # fmt: skip
    assert mx.densities_from_uff(path)["2+Z"].tolist() == [[1.0, 4e-6], [2.0, 9e-6]]


def test_what_is_no_response_is_told(tmp_path):
    path = tmp_path / "x.uff"
    file = pyuff.UFF(str(path))
    value = np.ones(3, dtype=complex)
    file._write_set(function((1, 3), (1, 3), value, np.arange(1.0, 4.0)), "overwrite")
    file._write_set(function((1, 3), (1, 3), value.real, np.arange(1.0, 4.0), func_type=9), "add")
    file._write_set(function((2, 3), (1, 3), value.real, np.arange(1.0, 4.0), func_type=6), "add")
    measured = mx.from_uff(path)
    assert [text.split(",")[0] for text in measured.left_out] == [
        "1 of data set 58: function type 9", "1 of data set 58: coherence"]  # fmt: skip
    file._write_set(function((1, 2), (1, 3), value, np.arange(1.0, 7.0, 2.0)), "add")
    with pytest.raises(mv.ExportError, match="different frequencies; expected one list"):
        mx.from_uff(path)


def test_what_does_not_fit(tmp_path):
    path = tmp_path / "x.uff"
    for system, message in (
        (slider(inputs=()), "0 inputs and 1 output;"),
        (slider(inputs=("ü",)), "ASCII"),
        (slider(outputs=("a" * 81,)), "at most 80 characters"),
        (slider(outputs=("a / b",)), "without ' / '"),
        (np.eye(2), "to_uff: system = ndarray"),
    ):
        with pytest.raises(mv.ExportError, match=message):
            mx.to_uff(system, path, [1.0])
    for omega in ([2.0, 1.0], [1.0, 1.0], [-1.0, 1.0], []):
        with pytest.raises(mv.ExportError, match="omega does not ascend from 0 on"):
            mx.to_uff(slider(), path, omega)
    assert not path.exists()


def test_damage(tmp_path):
    path = mx.to_uff(stewart(), tmp_path / "x.uff", [1.0, 2.0], modes=True)
    raw = path.read_bytes()
    points, size = b"         2         0  0.0", b"          48"
    for content in (b"", b"text", raw[:400], raw[: len(raw) // 2], raw.replace(size, b"  9999999999", 1),
                    raw.replace(points, b"-9999999          0  0.0", 1)):  # fmt: skip
        path.write_bytes(content)
        with pytest.raises(mv.ExportError, match=r"x\.uff: "):
            mx.from_uff(path)
    with pytest.raises(mv.ExportError, match=r"none\.uff: cannot be read"):
        mx.from_uff(tmp_path / "none.uff")


def test_a_part_of_the_ports_keeps_nodes_and_directions(tmp_path):
    system = library.quarter_car().linearize()
    whole = mx.from_uff(mx.to_uff(system, tmp_path / "x.uff", [1.0]))
    part = mx.from_uff(mx.to_uff(system[["wheel.z", "body.z"], "load"], tmp_path / "y.uff", [1.0]))
    assert part.output_points == (whole.output_points[1], whole.output_points[0])
    assert part.input_points == whole.input_points[2:]


def test_a_response_that_is_there_twice_is_refused(tmp_path):
    path = mx.to_uff(slider(), tmp_path / "twice.uff", [1.0, 2.0], binary=False)
    lines = path.read_text().splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if line.strip() == "58") - 1
    last = next(k for k in range(first + 1, len(lines)) if lines[k].strip() == "-1")
    path.write_text("".join([*lines, *lines[first : last + 1]]))
    with pytest.raises(mv.ExportError, match=r"twice\.uff: .*the response of '.*' to '.*' is there twice"):
        mx.from_uff(path)
