"""Universal files of systems: written here, read by pyuff and here."""

import re

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
    raw = path.read_bytes().replace(b"1.0000000000000000D+00", b"1.0000000000000000D+03", 1)
    path.write_bytes(re.sub(rb"((Response|Reference) +)(N )?m\b", rb"\1\3mm", raw))
    shorter = mx.from_uff(path)
    for node, same in zip(measured.nodes, shorter.nodes, strict=True):
        assert same.position == pytest.approx(np.multiply(1e-3, node.position))
    for mode, same in zip(measured.modes, shorter.modes, strict=True):
        np.testing.assert_allclose(same.shape, mode.shape * np.repeat([1e-3, 1.0], 3), rtol=1e-12, atol=1e-20)


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
    for omega in ([2.0, 1.0], [1.0, 1.0], [-1.0, 1.0], [], [1.0, np.nan], [1j, 2j]):
        with pytest.raises(mv.ExportError, match=r"to_uff: omega .* expected a vector of ascending"):
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
    for number in (b"-48", b"9999"):  # of bytes, which would lead back, or beyond the end
        path.write_bytes(raw[: raw.index(size) + 400].replace(size, number.rjust(12), 1))
        with pytest.raises(mv.ExportError, match=rf"11 lines and {number.decode()} bytes are to follow; \d+ bytes are"):
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
