"""Universal files of other programs: written by pyuff or line by line, read here."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from tests.export.test_uff import sets_of

pyuff = pytest.importorskip("pyuff", reason="pyuff is not installed: pip install 'mbsvib[test]'")


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
    np.testing.assert_allclose(variance, np.array([1.0, 4.0 * 0.25, 0.0]) / 7 * 1e-12, rtol=1e-12)
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


@pytest.mark.parametrize(("millimetres", "kind", "unit", "refused"), [
    (True, 4, "g", True), (True, 4, "m/s\u00b2", True), (True, 4, "mm/s^2", False), (True, 4, "EU", False),
    (False, 4, "g", False), (False, 9, "g^2/Hz", True), (False, 9, "(mm/s\u00b2)\u00b2/Hz", True),
    (True, 9, "(m/s^2)^2/Hz", True), (True, 9, "(mm/s^2)^2/Hz", False), (False, 9, "(m/s^2)^2/Hz", False),
])  # fmt: skip
def test_units_beside_numbers_that_stand_against_those_of_the_file(millimetres, kind, unit, refused, tmp_path):
    """Geometry in mm and accelerations in g: of one of both the numbers would be off by a factor without a word."""
    path = tmp_path / "x.uff"
    file = pyuff.UFF(str(path))
    if millimetres:
        in_millimetres(file)
    value = np.ones(3) if kind == 9 else np.ones(3, dtype=complex)
    ends = ((1, 3), (0, 0) if kind == 9 else (1, 3))
    file._write_set(function(*ends, value, np.arange(1.0, 4.0), func_type=kind, ordinate_axis_units_lab=unit,
                             **({"orddenom_spec_data_type": 0} if kind == 9 else {})), "add")  # fmt: skip
    read = mx.densities_from_uff if kind == 9 else mx.from_uff
    with pytest.raises(mv.ExportError, match="has the unit '") if refused else nullcontext():
        read(path)
