"""``import mbsvib`` is quick: what a model and a linearization do not need is not loaded."""

import subprocess
import sys

import pytest

HEAVY = ("matplotlib", "control", "typer", "rich", "ruamel", "casadi", "jsonschema", "mbsvib_export")
LINEARIZE = (
    "m = mbsvib.Model(); m.add_body('b', 1.0, (1, 1, 1)); "
    "m.add_bushing('k', 'ground', 'b', (0, 0, 0), (1,) * 6); m.linearize().modes().frequencies"
)


def loaded(code):
    script = f"import sys, mbsvib; {code}; print(*sorted(sys.modules))"
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def test_nothing_is_loaded_before_it_is_asked_for():
    modules = loaded("pass")
    assert {name for name in modules if name.startswith("mbsvib.")} == {"mbsvib.errors", "mbsvib.version"}
    assert not [name for name in ("numpy", "scipy", *HEAVY) if name in modules]


def test_nothing_heavy_is_loaded():
    modules = loaded(LINEARIZE)
    assert "mbsvib.api.model" in modules
    assert not [name for name in HEAVY if name in modules]


def test_of_scipy_only_linear_algebra_is_loaded():
    modules = loaded(LINEARIZE) - loaded("__import__('scipy.linalg')")
    assert not {name for name in modules if name.startswith("scipy.") and name.count(".") == 1}
    assert not {name for name in modules if name.startswith("mbsvib.sparse.")}


def test_public_names_resolve():
    import mbsvib

    for name in mbsvib.__all__:
        assert getattr(mbsvib, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        mbsvib.no_such_name  # noqa: B018


def test_a_system_of_sparse_matrices_is_sparse_whatever_was_imported_before():
    matrices = "scipy.sparse.eye(2), None, scipy.sparse.eye(2)"
    modules = loaded(f"import scipy.sparse; from mbsvib.api.system import System; assert type(System.from_matrices("
                     f"{matrices})).__name__ == 'SparseSystem'")  # fmt: skip
    assert "mbsvib.api.sparse_system" in modules
