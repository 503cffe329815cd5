"""MATLAB's .mat: read by scipy and by Octave, whose script rebuilds the system and checks it."""

import re
import shutil
import subprocess
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scipy.io import loadmat

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib.common.atomic_file import write_atomic
from tests.export.plants import block_error, resonances, same_bits, slider, stewart
from tests.export.test_json import SYSTEMS, assert_same
from tests.export.test_massless import late
from tests.export.test_massless import plant as massless

CASES = {**SYSTEMS, "massless": massless, "late": late}
OCTAVE = shutil.which("octave-cli")
needs_octave = pytest.mark.skipif(OCTAVE is None, reason="octave-cli is not installed (apt-get install octave)")


@pytest.mark.few(3)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_there_and_back(case, realization, tmp_path):
    system = CASES[case]()
    path = tmp_path / "system.mat"
    assert mx.to_mat(system, path, realization) == path
    data = mx.from_mat(path)
    assert_same(data, system, realization)
    if (through := system.state_space(realization).through) is not None:
        assert same_bits(data.state_space.through, through)
    mx.to_mat(data, tmp_path / "again.mat", loader=False)
    assert_same(mx.from_mat(tmp_path / "again.mat"), system, realization)
    assert sorted(item.name for item in tmp_path.iterdir()) == ["again.mat", "load_system.m", "system.mat"]


def test_the_same_system_gives_the_same_bytes(tmp_path):
    first, second = (mx.to_mat(stewart(), tmp_path / name).read_bytes() for name in ("a.mat", "b.mat"))
    assert first == second


def test_scipy_reads_what_ss_and_mechss_take(tmp_path):
    system = stewart()
    result = loadmat(mx.to_mat(system, tmp_path / "plant.mat"), simplify_cells=True)
    space = system.state_space()
    assert all(same_bits(result[key], getattr(space, key)) for key in "ABCD")
    assert result["InputName"].tolist() == list(system.inputs)
    assert result["OutputUnit"].tolist() == list(system.output_units)
    assert result["StateName"].tolist() == list(space.states)
    assert result["Ts"] == 0
    assert result["E"].size == 0
    mech = result["mech"]
    omega = resonances(system)
    truth = system.frequency_response(omega)
    q = [np.linalg.solve(mech["K"] + 1j * w * mech["C"] - w * w * mech["M"], mech["B"]) for w in omega]
    response = np.stack([(mech["F"] + 1j * w * mech["G"]) @ item + mech["D"]
                         for w, item in zip(omega, q, strict=True)], axis=2)  # fmt: skip
    assert any(unit.endswith("s^2") for unit in system.output_units)  # F, G, D hold accelerations as well
    assert block_error(response, truth, system) < 1e-10
    assert block_error(result["check"]["response"], system.frequency_response(result["check"]["omega"]), system) == 0.0


@pytest.mark.parametrize("case", ["system", "loop"])
def test_the_check_in_the_file_is_the_response_and_its_size(case, tmp_path):
    """Its size: the largest entry between ports of these units at a frequency; 1 where all is zero."""
    system = library.quarter_car(suspension_damping=900.0).linearize()
    loop = system.feedback(mv.StateSpace.from_arrays([[-0.5]], [[1.0]], [[-3e3]], 0, ["body.az"], ["actuator"]))
    source = system if case == "system" else loop
    file = loadmat(mx.to_mat(source, tmp_path / "x.mat"), simplify_cells=True)
    check, space = file["check"], source.state_space()
    size = np.sort(np.abs(source.poles()))
    assert check["omega"][[0, -1]] == pytest.approx([0.1 * size[0], 3.0 * size[-1]], rel=1e-9)
    truth = np.stack([space.C @ np.linalg.solve(1j * w * np.eye(len(space.A)) - space.A, space.B) + space.D
                      for w in check["omega"]], axis=2)  # fmt: skip
    largest = np.empty(truth.shape)
    for i, j in np.ndindex(truth.shape[:2]):
        block = np.ix_(*([unit == units[k] for unit in units] for units, k in
                         ((space.output_units, i), (space.input_units, j))))  # fmt: skip
        largest[i, j] = np.abs(truth[block]).max(axis=(0, 1))
    assert (np.abs(check["response"] - truth) <= 1e-10 * check["scale"]).all()
    np.testing.assert_allclose(check["scale"][..., 1:], largest[..., 1:], rtol=1e-9)  # terms cancel at the lowest
    assert (check["scale"][..., 0] >= (1.0 - 1e-9) * largest[..., 0]).all()
    assert (file["mech"]["M"].size > 0) == (case == "system")
    still = mv.StateSpace.from_arrays([[-1.0]], [[0.0]], [[1.0]], 0)
    assert loadmat(mx.to_mat(still, tmp_path / "y.mat"), simplify_cells=True)["check"]["scale"].ravel().min() == 1.0


def octave(folder, code):
    return subprocess.run([OCTAVE, "--norc", "--eval", code], cwd=folder, capture_output=True, text=True, check=False)


@needs_octave
@pytest.mark.parametrize("case", ["stewart", "names", "massless", "no outputs", "locked"])
def test_octave_rebuilds_and_checks(case, tmp_path):
    system = CASES[case]()
    mx.to_mat(system, tmp_path / "system.mat")
    code = "[p, m, w] = load_system(); n = p.InputName; printf('%.3g\\n', w); printf('%s\\n', n{:});"
    result = octave(tmp_path, code + "printf('%d\\n', size(m.M, 1)); fflush(stdout);")
    lines = result.stdout.splitlines()
    assert lines, result.stderr
    assert float(lines[0]) < 1e-10
    assert tuple(lines[1:-1]) == system.inputs
    assert int(lines[-1]) == system.dof


@needs_octave
def test_names_that_octave_cannot_read_are_mapped_and_the_map_is_there(tmp_path):
    face = "\N{GRINNING FACE}"
    system = slider(inputs=(face, "~1F600"), outputs=(f"z{face}",), name=f"slider {face}")
    path = mx.to_mat(system, tmp_path / "system.mat")
    result = loadmat(path, simplify_cells=True)
    assert result["InputName"].tolist() == ["~1F600_", "~1F600"]
    assert result["Name"] == "slider ~1F600"
    assert_same(mx.from_mat(path), system)
    assert result["mbsvib"]["mapped"].tolist() == ["slider ~1F600", "~1F600_", "z~1F600"]
    assert bytes(result["mbsvib"]["original"][0]).decode() == system.name
    code = "p = load_system(); i = p.InputName; o = p.OutputName; printf('%s\\n', p.Name, i{:}, o{:});"
    assert octave(tmp_path, code).stdout.splitlines() == [system.name, *system.inputs, *system.outputs]


@needs_octave
def test_octave_refuses_a_file_whose_response_has_changed(tmp_path):
    path = mx.to_mat(stewart(), tmp_path / "system.mat")
    raw = bytearray(path.read_bytes())
    at = raw.find(stewart().state_space().A[6:, :6].T.tobytes()[:8])
    raw[at : at + 8] = np.float64(1.0).tobytes()
    path.write_bytes(raw)
    result = octave(tmp_path, "load_system();")
    assert "the file is damaged" in result.stderr
    assert result.returncode != 0


@pytest.mark.parametrize("light", [1.0, 1e-12])
def test_accelerations_of_masses_far_apart(tmp_path, light):
    """F = -Ca M^-1 K, G = -Ca M^-1 C, D = Ca M^-1 B of a heavy and a light mass that are coupled."""
    mass = np.array([[2.0, 0.5 * np.sqrt(light)], [0.5 * np.sqrt(light), light]])
    stiffness, damping = np.array([[3e3, -1e3], [-1e3, 1e3]]), np.array([[0.4, -0.1], [-0.1, 0.1]])
    system = mv.System.from_matrices(mass, damping, stiffness, np.eye(2), Ca=[[1.0, 0.0], [2.0, -1.0]])
    mech = loadmat(mx.to_mat(system, tmp_path / "x.mat"), simplify_cells=True)["mech"]
    with mp.workdps(40):
        rows = mp.matrix([[1, 0], [2, -1]]) * mp.inverse(mp.matrix(mass.tolist()))
        for found, matrix in ((-mech["F"], stiffness), (-mech["G"], damping), (mech["D"], np.eye(2))):
            exact = np.array((rows * mp.matrix(matrix.tolist())).tolist(), dtype=float)
            np.testing.assert_allclose(found, exact, rtol=1e-12)


def test_an_acceleration_of_what_has_no_mass_leaves_mechss_empty(tmp_path):
    """F, G, D come from Ca M^-1, which a singular M may not have: state space and M, C, K are there all the same."""
    system = massless()
    result = loadmat(mx.to_mat(system, tmp_path / "x.mat"), simplify_cells=True)
    assert result["mech"]["F"].shape == (2, 2)  # velocities only: nothing to invert
    from dataclasses import replace

    data = replace(mx.from_mat(tmp_path / "x.mat"), Ca=np.eye(2))
    assert loadmat(mx.to_mat(data, tmp_path / "y.mat"), simplify_cells=True)["mech"]["F"].size == 0


@pytest.mark.parametrize("content", [b"", b"text", b"MATLAB 5.0 MAT-file" + bytes(200)])
def test_files_of_another_kind(content, tmp_path):
    path = tmp_path / "wrong.mat"
    path.write_bytes(content)
    with pytest.raises(mv.ExportError, match=r"wrong\.mat: "):
        mx.from_mat(path)
    with pytest.raises(mv.ExportError, match=r"none\.mat: cannot be read"):
        mx.from_mat(tmp_path / "none.mat")


def test_a_script_that_cannot_be_written_leaves_no_file_without_it(tmp_path):
    (tmp_path / "load_x.m").mkdir()
    with pytest.raises(mv.ExportError, match=r"load_x\.m: this file is there already"):
        mx.to_mat(slider(), tmp_path / "x.mat")
    assert [item.name for item in tmp_path.iterdir()] == ["load_x.m"]
    mx.to_mat(slider(), tmp_path / "x.mat", loader=False)
    assert (tmp_path / "x.mat").exists()


@pytest.mark.parametrize("present", [False, True])
def test_a_full_disk_takes_no_file_that_was_there(present, tmp_path, monkeypatch):
    """The script cannot be written: a new .mat file goes with it, one that was there stays."""
    path = tmp_path / "x.mat"
    if present:
        mx.to_mat(slider(), path, loader=False)

    def write(goal, content):
        if Path(goal).suffix == ".m":
            raise mv.ExportError("no space left")
        return write_atomic(goal, content)

    monkeypatch.setattr("mbsvib_export.mat_.write_atomic", write)
    with pytest.raises(mv.ExportError, match="no space left"):
        mx.to_mat(slider(), path)
    assert path.exists() == present


def test_scripts_of_others_are_not_replaced(tmp_path):
    """A user's own load_x.m, and the one script that two .mat files would share."""
    own = tmp_path / "load_x.m"
    own.write_text("function data = load_x()  % mine\n")
    with pytest.raises(mv.ExportError, match=r"is not the script of 'x\.mat'.*loader=False"):
        mx.to_mat(slider(), tmp_path / "x.mat")
    assert own.read_text().endswith("mine\n")
    assert not (tmp_path / "x.mat").exists()
    mx.to_mat(slider(), tmp_path / "a-b.mat")
    first = (tmp_path / "load_a_b.m").read_bytes()
    with pytest.raises(mv.ExportError, match=r"is not the script of 'a_b\.mat'"):
        mx.to_mat(slider(), tmp_path / "a_b.mat")
    mx.to_mat(slider(name="other"), tmp_path / "a-b.mat")  # the same export may be repeated
    assert b"'other'" in (tmp_path / "load_a_b.m").read_bytes() != first


def test_places_that_cannot_be_written(tmp_path):
    with pytest.raises(mv.ExportError, match="cannot be written"):
        mx.to_mat(slider(), tmp_path / "no" / "x.mat")
    assert not list(tmp_path.iterdir())
    with pytest.raises(mv.ExportError, match="to_mat: system = Model"):
        mx.to_mat(library.stewart(), tmp_path / "x.mat")


def test_names_that_matlab_does_not_take_for_a_mat_file_are_refused(tmp_path):
    with pytest.raises(mv.ExportError, match=r"expected a name that ends in \.mat"):
        mx.to_mat(slider(), tmp_path / "x")
    assert not list(tmp_path.iterdir())


def test_scripts_find_files_with_names_that_are_not_ascii(tmp_path):
    path = mx.to_mat(slider(), tmp_path / "größe.mat")
    text = (tmp_path / "load_gr__e.m").read_text("ascii")
    code = re.search(r"native2unicode\(uint8\(\[([\d ]+)\]\), 'UTF-8'\)\);", text)[1]
    assert bytes(int(number) for number in code.split()).decode() == path.name
    mx.to_mat(slider(), path)      # the script is known as its own
    if OCTAVE is not None:
        assert octave(tmp_path, "p = load_gr__e(); disp(p.Name)").stdout.strip() == "slider"
