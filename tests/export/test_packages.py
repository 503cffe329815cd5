"""The package itself: names on demand, and packages that are not installed asked for by name."""

import subprocess
import sys

import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib_export.packages import INSTALL, need
from tests.export.plants import slider


def test_every_public_name_is_there_and_explained():
    assert sorted(mx.__all__) == mx.__all__
    assert set(mx.__all__) <= set(dir(mx))
    for name in mx.__all__:
        assert getattr(mx, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'to_nothing'"):
        _ = mx.to_nothing


@pytest.mark.slow
def test_a_target_is_imported_when_it_is_used():
    code = (
        "import sys, mbsvib_export as mx; loaded = {'control', 'scipy.signal', 'matplotlib'};"
        "assert not loaded & set(sys.modules); mx.to_control; mx.to_frd; mx.to_scipy; mx.to_json; mx.from_npz;"
        "assert not loaded & set(sys.modules), loaded & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


ASKED = [
    ("control", "to_control", ()), ("control", "to_frd", ([1.0],)), ("control", "to_transfer_function", ()),
    ("control", "named", (None,)), ("control", "with_names", ()), ("control", "augw", ()),
    ("h5py", "to_hdf5", ("x.h5",)), ("h5py", "from_hdf5", ()), ("casadi", "to_casadi", ()),
    ("casadi", "to_casadi_eigenvalues", ("k.stiffness",)), ("casadi", "to_casadi_response", ([1.0], "k.stiffness")),
    ("exudyn", "to_exudyn", ()), pytest.param("fmpy", "check_cosimulation", (None, 1e-3), marks=pytest.mark.slow),
]  # fmt: skip


@pytest.mark.parametrize(("package", "target", "words"), ASKED)
def test_a_package_that_is_missing_is_asked_for(package, target, words, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    function = getattr(mx, target)
    with pytest.raises(mv.ExportError, match=rf'{target}: .*{package} is not installed; .*pip install "'):
        function(slider(), *words)


def test_an_extra_is_named(monkeypatch):
    monkeypatch.setitem(INSTALL, "no_such_package", "mbsvib[any]")
    with pytest.raises(mv.ExportError, match=r'to_any: .*no_such_package.*pip install "mbsvib\[any\]"'):
        need("no_such_package", "to_any")


def test_a_broken_package_speaks_for_itself(tmp_path, monkeypatch):
    (tmp_path / "broken_package.py").write_text("import no_such_package")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="no_such_package"):
        need("broken_package", "to_any")
