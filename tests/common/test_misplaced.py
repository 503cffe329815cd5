"""Names that are not in a module: the error tells which module or object has them."""

import subprocess
import sys

import pytest

import mbsvib as mv
import mbsvib_export as mx


@pytest.mark.parametrize(
    ("module", "name", "place"),
    [
        (mv, "trade_off", "it is mbsvib.studies.trade_off"),
        (mv, "to_fmu", "it is mbsvib_export.to_fmu"),
        (mv, "frequency_response", "it is system.frequency_response, after system = model.linearize()"),
        (mv, "add_body", "it is model.add_body, after model = mbsvib.Model()"),
        (mv, "margins", "it is loop.margins, after loop = system.feedback(controller)"),
        (mv, "lineraize", "Did you mean 'linearize'?"),
        (mv.studies, "tune", "it is mbsvib.tune"),
        (mv.isolation, "rms", "it is mbsvib.studies.rms"),
        (mv.plots, "boode", "Did you mean 'bode'?"),
        (mv.library, "white", "it is mbsvib.isolation.white"),
        (mx, "Model", "it is mbsvib.Model"),
    ],
)
def test_the_error_tells_where_a_name_is(module, name, place):
    with pytest.raises(AttributeError) as error:
        getattr(module, name)
    assert str(error.value).startswith(f"module '{module.__name__}' has no attribute '{name}'")
    assert place in str(error.value)


def test_private_names_and_modules_are_looked_for_nowhere_else():
    for name in ("__wrapped__", "_places"):
        with pytest.raises(AttributeError, match=f"has no attribute '{name}'$"):
            getattr(mv.plots, name)
    script = "import sys; from mbsvib import linalg; assert 'mbsvib_export' not in sys.modules"
    subprocess.run([sys.executable, "-c", script], check=True)
