"""Every example runs, keeps its promises in numbers, and draws pictures that can be read."""

import ast
import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))
SLOW = {"absorber_by_ipopt", "active_damping_by_units", "bicycle_balance", "blade_on_hub",
        "codesign_of_mount_and_gain", "cut_another_loop", "decentral_control_three_poses", "drop_test",
        "fe_payload_on_hexapod_as_fmu", "flexible_arm", "force_feedback_worst_case", "gain_scheduled_hexapod",
        "gantry_with_ball_screws", "half_car_on_roads", "hexapod_isolation", "hexapod_legs_from_measured_responses",
        "hoeken_balancing", "linkage_under_gravity", "measured_payload_on_hexapod", "measured_steering_mirror",
        "mpc_of_stewart",
        "nano_stage_error_budget", "nano_stage_on_flexures", "robot_arm_over_its_workspace", "rotor_stator_campbell",
        "rubber_mounts_from_a_table", "scraper_cycle", "snap_through", "stewart_active_isolation", "stewart_geometry",
        "stewart_passive_design", "stewart_tolerances", "tracked_root_locus", "validity_of_a_linear_model",
        "which_leg_parameter_moves_which_mode"}  # fmt: skip
# packages that "all" does not have; CI runs these in an environment of their own
NEEDS = {"hexapod_by_hinf": "ctrlsys"}
RUN = [pytest.param(path, marks=pytest.mark.slow if path.stem in SLOW else ()) for path in EXAMPLES]


@pytest.fixture
def figures(monkeypatch):
    """Figures that an example leaves open, without a screen."""
    mpl.use("agg")
    from matplotlib import pyplot as plt

    shown = []
    monkeypatch.setattr(plt, "show", lambda: shown.extend(map(plt.figure, plt.get_fignums())))
    return shown


@pytest.mark.parametrize("path", RUN, ids=lambda path: path.stem)
def test_example_runs_and_draws(path, figures):
    if package := NEEDS.get(path.stem):
        pytest.importorskip(package, reason=f"{package} is not installed: pip install 'mbsvib[{package}]'")
    runpy.run_path(str(path), run_name="__main__")
    assert figures
    for figure in figures:
        figure.canvas.draw()
        labels = [label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
        assert len(labels) >= 2
        counts = [label == "mode" or label.startswith("number of ") for label in labels]
        assert all(label.endswith("]") or count for label, count in zip(labels, counts, strict=True)), "no unit"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_short_and_holds_itself_to_numbers(path):
    source = path.read_text()
    tree = ast.parse(source)
    assert ast.get_docstring(tree)
    assert len(source.splitlines()) < 90
    assert any(isinstance(node, ast.Assert) for node in ast.walk(tree))
    # importing an example computes; drawing waits until it is run
    imports = [ast.unparse(node) for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert not any("matplotlib" in line for line in imports)


def test_there_are_examples():
    assert len(EXAMPLES) >= 5
