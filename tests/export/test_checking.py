"""Exports read again and compared with their models."""

import zipfile
from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.checking import pole_error
from mbsvib_export.fmu_ import reading
from mbsvib_export.responses import CANCELLED, response_scale
from tests.export.plants import slider, stewart, stiff_model
from tests.export.test_json import SYSTEMS
from tests.export.test_massless import plant as massless

CASES = {**SYSTEMS, "massless": massless, "stiff": lambda: stiff_model().linearize(),
         "free": lambda: slider(stiffness=0.0)}  # fmt: skip


@pytest.mark.few(3)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_every_system_passes(case, realization, tmp_path):
    system = CASES[case]()
    path = mx.to_npz(system, tmp_path / "x.npz", realization)
    found = [item.quantity for item in mx.check_export(path, system).comparisons]
    assert found == ["response of A B C D", "response of M C K", "poles", "displacements of the bodies"]
    for result in (mx.check_export(path, system), mx.check_export(path)):
        assert result.passed, str(result)
        assert all(item.error < 1e-8 for item in result.comparisons), str(result)


@pytest.mark.parametrize("quantity", ["Cq", "Cv", "Ca"])
def test_an_output_in_which_all_cancels_is_measured_by_its_terms(quantity):
    """The difference of two oscillators alike that one force pushes: each term is |w^k / (k + i w c - w^2 m)|."""
    w, order = np.array([0.5, 3.0, 40.0]), ("Cq", "Cv", "Ca").index(quantity)
    m, c, k = 2.0, 0.3, 20.0
    system = mv.System.from_matrices(m * np.eye(2), c * np.eye(2), k * np.eye(2), [[1.0], [1.0]],
                                     **{quantity: [[1.0, -1.0]]})  # fmt: skip
    each = 1.0 / np.abs(k + 1j * w * c - w**2 * m)
    assert response_scale(0j * w[None, None], system, w)[0, 0] == pytest.approx(2.0 * CANCELLED * w**order * each)
    parts = (1.0, w, (k + w * c) / m)[order]  # an acceleration is (f - k q - c v) / m in a state space
    expected = 2.0 * CANCELLED * parts * each
    assert response_scale(0j * w[None, None], system.state_space(), w)[0, 0] == pytest.approx(expected)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_units_are_asked_for_their_derivatives(version, tmp_path):
    pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbsvib[fmu]'")
    system = stewart()
    path = mx.to_fmu(system, tmp_path / "x.fmu", version).path
    result = mx.check_export(path, system, run=True)
    assert [item.quantity for item in result.comparisons] == ["response of its derivatives", "poles"]
    assert all(item.error < 1e-9 for item in result.comparisons), str(result)
    changed = library.stewart(ports="all").with_values({"leg1.k.stiffness": 1.01e7}).linearize()
    for run in (False, True):
        assert not mx.check_export(path, changed, run=run).passed
    path.write_bytes(path.read_bytes()[:3000])
    for run in (False, True):
        with pytest.raises(mv.ExportError, match=r"x\.fmu: "):
            mx.check_export(path, system, run=run)


def test_units_of_other_platforms_and_ports_of_one_name(tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbsvib[fmu]'")
    system = slider(inputs=("z",), outputs=("z",))
    path = mx.to_fmu(system, tmp_path / "x.fmu").path
    assert mx.check_export(path, system, run=True).passed
    with zipfile.ZipFile(path) as one, zipfile.ZipFile(tmp_path / "y.fmu", "w") as two:
        for name in one.namelist():
            two.writestr(name.replace(f"/{fmpy.platform_tuple}/", "/sparc-solaris/"), one.read(name))
    with pytest.raises(mv.ExportError, match=r"y\.fmu: holds no binary for"):
        mx.check_export(tmp_path / "y.fmu", system, run=True)
    result = mx.check_export(tmp_path / "y.fmu", system)
    assert result.passed
    assert "Not run: its binaries for sparc-solaris" in str(result)


@pytest.mark.parametrize("name", ["../../evil", "/tmp/evil", "a b", "lib.evil", ""])
def test_fmus_that_name_a_library_elsewhere_are_refused(name, tmp_path):
    """The name of the binary is made of modelIdentifier: a path would run what lies outside of the archive."""
    pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbsvib[fmu]'")
    path = mx.to_fmu(slider(), tmp_path / "x.fmu").path
    with zipfile.ZipFile(path) as one, zipfile.ZipFile(tmp_path / "y.fmu", "w") as two:
        for item in one.namelist():
            content = one.read(item)
            two.writestr(item, content.replace(b'modelIdentifier="slider"', f'modelIdentifier="{name}"'.encode()))
    for run in (False, True):
        with pytest.raises(mv.ExportError, match="modelIdentifier"):
            mx.check_export(tmp_path / "y.fmu", slider(), run=run)


def test_archives_that_would_fill_the_disk_are_refused(tmp_path, monkeypatch):
    pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbsvib[fmu]'")
    path = mx.to_fmu(slider(), tmp_path / "x.fmu").path
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive, archive.open("resources/junk", "w") as stream:
        stream.write(bytes(11_000_000))
    monkeypatch.setattr(reading, "LARGEST_UNPACKED", 10_000_000)
    for run in (False, True):
        with pytest.raises(mv.ExportError, match=r"x\.fmu: holds .* GB together; expected at most"):
            mx.check_export(path, slider(), run=run)


def test_a_spring_that_was_changed_since_is_found(tmp_path):
    system = stewart()
    path = mx.to_npz(system, tmp_path / "x.npz")
    changed = library.stewart(ports="all").with_values({"leg1.k.stiffness": 1.01e7}).linearize()
    result = mx.check_export(path, changed)
    assert not result.passed
    assert [item.passed for item in result.comparisons] == [False] * 4
    assert "NO" in str(result)


def test_a_state_space_that_is_not_of_its_matrices_is_found(tmp_path):
    data = mx.from_json(mx.to_json(stewart()))
    a = data.state_space.A.copy()
    a[7, 1] *= 1.0000001
    wrong = replace(data, state_space=replace(data.state_space, A=a))
    path = mx.to_npz(wrong, tmp_path / "x.npz")
    assert not mx.check_export(path).passed
    assert mx.check_export(path, limit=1.0).passed
    back = replace(data, state_space=replace(data.state_space, transform=2 * data.state_space.transform))
    result = mx.check_export(mx.to_npz(back, tmp_path / "y.npz"), stewart())
    assert [item.passed for item in result.comparisons] == [True, True, True, False]


def test_what_cannot_be_checked(tmp_path):
    path = mx.to_npz(slider(), tmp_path / "x.npz")
    with pytest.raises(mv.ExportError, match=r"inputs of the file are not those of 'stewart'"):
        mx.check_export(path, stewart())
    with pytest.raises(mv.ExportError, match=r"no exporter writes '\.txt'"):
        mx.check_export(tmp_path / "x.txt", slider())
    with pytest.raises(mv.ExportError, match="give the system as well"):
        mx.check_export(tmp_path / "x.uff")
    with pytest.raises(mv.ExportError, match="system = Model; expected a System"):
        mx.check_export(path, library.stewart())


def test_poles_are_matched_one_to_one():
    assert pole_error(np.array([1j, -1j]), np.array([-1j, 1j])) == 0.0
    assert pole_error(np.array([1j, 1j]), np.array([-1j, 1j])) == 2.0
    assert pole_error(np.array([1j]), np.array([-1j, 1j])) == np.inf
    assert pole_error(np.array([1e-9, 100.0]), np.array([0.0, 100.0])) == pytest.approx(1e-11)
