"""Commands that write files."""

import json

import numpy as np
import pytest
from matplotlib.figure import Figure

import mbsvib as mv
import mbsvib_export as mx

PNG = b"\x89PNG"


@pytest.mark.slow
def test_bode_writes_a_figure_of_the_model_s_name(run, tmp_path):
    result = run("bode slider.yaml")
    assert result.exit_code == 0
    assert result.stdout == "Written: slider-bode.png\n"
    assert (tmp_path / "slider-bode.png").read_bytes().startswith(PNG)
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(("option", "label"), [("", "|x / F| [m/N]"), ("--decibels", "magnitude [dB re 1 m/N]")])
def test_bode_in_decibels(run, monkeypatch, option, label):
    drawn = []
    monkeypatch.setattr("mbsvib.cli._drawing.write_figure", lambda figure, file: drawn.append(figure) or file)
    assert run(f"bode slider.yaml --output x {option}").exit_code == 0
    assert drawn[0].axes[0].get_ylabel() == label


@pytest.mark.parametrize("suffix", ["yaml", "json"])
def test_an_export_does_not_replace_its_model(run, tmp_path, suffix):
    """A model in JSON became its own linear system, and one in YAML lost its comments."""
    path = mv.save(mv.library.quarter_car(), tmp_path / f"car.{suffix}")
    before = path.read_bytes()
    result = run(f"export car.{suffix} -o ./car.{suffix}")
    assert result.exit_code == 2
    assert "is the model itself" in result.stderr
    assert path.read_bytes() == before


@pytest.mark.parametrize(("suffix", "start"), [("png", PNG), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_formats_go_by_the_suffix(run, tmp_path, suffix, start, monkeypatch):
    monkeypatch.setattr("mbsvib.plots.step", lambda *_, **__: Figure())
    assert run(f"step slider.yaml --input F --output x --duration 1 -o figure.{suffix}").exit_code == 0
    assert (tmp_path / f"figure.{suffix}").read_bytes().startswith(start)


def test_the_first_of_many_is_drawn_and_said(run, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("mbsvib.plots.bode", lambda system, *names, **_: drawn.append(names) or Figure())
    result = run("bode stewart")
    assert "Drawn: Fx to x" in result.stdout
    assert "Fy, Fz" in result.stdout
    assert drawn == [(["x"], ["Fx"])]
    assert (tmp_path / "stewart-bode.png").exists()
    assert "Drawn" not in run("bode stewart -i Fx --output x --output ry --from 100 --to 2000 -o two.png").stdout


def test_figures_replace_what_was_there(run, tmp_path, monkeypatch):
    monkeypatch.setattr("mbsvib.plots.bode", lambda *_, **__: Figure())
    (tmp_path / "slider-bode.png").write_bytes(b"old" * 100_000)
    run("bode slider.yaml")
    data = (tmp_path / "slider-bode.png").read_bytes()
    assert data.startswith(PNG)
    assert b"oldold" not in data


def test_export_by_suffix(run, tmp_path):
    system = mv.load("slider.yaml").linearize()
    assert run("export slider.yaml -o slider.npz").exit_code == 0
    np.testing.assert_array_equal(mx.from_npz("slider.npz").K, system.K)
    assert run("export slider.yaml -o slider.json --realization modal").exit_code == 0
    assert mx.from_json(tmp_path / "slider.json").state_space.realization == "modal"
    result = run("export stewart -o platform.YAML")
    assert result.exit_code == 0
    assert "the model itself" in result.stdout
    np.testing.assert_array_equal(mv.load("platform.YAML").linearize().M, mv.library.stewart().linearize().M)


def test_paths_elsewhere_are_named_in_full(run, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "slider.npz"
    assert f"Written: {elsewhere} " in run(f"export slider.yaml -o {elsewhere}").stdout


@pytest.mark.few(2)
@pytest.mark.parametrize(("suffix", "package"), [("mat", "scipy"), ("h5", "h5py"), ("uff", "numpy"),
                                                 ("op4", "numpy"), ("npz", "numpy"), ("fmu", "fmpy")])  # fmt: skip
def test_exports_are_checked_against_their_model(run, suffix, package):
    pytest.importorskip(package)
    assert run(f"export slider.yaml -o slider.{suffix}").exit_code == 0
    result = run(f"check-export slider.{suffix} slider.yaml")
    assert result.exit_code == 0
    assert "yes" in result.stdout
    assert run(f"check-export slider.{suffix} stewart").exit_code == 1


@pytest.mark.slow
def test_binaries_run_where_the_user_says_so(run):
    pytest.importorskip("fmpy")
    assert run("export slider.yaml -o slider.fmu").exit_code == 0
    data = run("check-export slider.fmu slider.yaml")
    assert "response of A B C D" in data.stdout
    assert "Not run: its binaries for" in data.stdout
    binary = run("check-export slider.fmu slider.yaml --run")
    assert binary.exit_code == 0
    assert "response of its derivatives" in binary.stdout
    assert "Not run" not in binary.stdout


def test_check_export_has_a_status_for_ci(run, tmp_path):
    run("export slider.yaml -o slider.mat")
    run("export slider.yaml -o slider.pch")
    assert (tmp_path / "load_slider.m").exists()
    assert run("check-export slider.mat").exit_code == 0
    assert run("check-export slider.mat slider.yaml --limit 1e-30").exit_code == 1
    assert run("check-export slider.pch slider.yaml").exit_code == 0
    assert run("check-export slider.pch").exit_code == 1


@pytest.mark.slow
def test_report_is_one_page_with_the_names_asked_for(run, tmp_path):
    pytest.importorskip("plotly", reason="plotly is not installed (extra 'report')")
    result = run("report slider.yaml --input F --output x")
    assert result.exit_code == 0
    assert result.stdout.startswith("Written: slider-report.html (")
    assert (tmp_path / "slider-report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    both = run("report slider.yaml --compare quarter_car -o both.html")
    assert both.exit_code == 0, both.stderr
    text = (tmp_path / "both.html").read_text(encoding="utf-8")
    assert '"slider"' in text
    assert '"quarter_car"' in text
    run("export slider.yaml -o slider.uff")
    rig = run("report slider.yaml --compare slider.uff -o rig.html")
    assert rig.exit_code == 0, rig.stderr
    assert '"measured":{"frequencies"' in (tmp_path / "rig.html").read_text(encoding="utf-8")
    refused = run("report slider.yaml -o page.pdf")
    assert refused.exit_code == 2
    assert "reports end in .html" in refused.stderr


@pytest.mark.slow
def test_the_mechanism_and_its_modes_are_drawn(run, tmp_path):
    assert run("draw slider.yaml --view y").stdout == "Written: slider-mechanism.png\n"
    assert (tmp_path / "slider-mechanism.png").read_bytes().startswith(PNG)
    result = run("animate slider.yaml")
    assert result.stdout.splitlines()[0].startswith("Mode 1: 7.9577 Hz, damping")
    assert (tmp_path / "slider-mode1.gif").read_bytes().startswith(b"GIF89a")
    refused = run("animate slider.yaml -m 2")
    assert "from 1 to 1" in refused.stderr
    assert run("animate slider.yaml -o mode.avi").exit_code == 2


def test_c_and_modelica(run, tmp_path):
    assert run("export quarter_car -o car.c --step 0.002").exit_code == 0
    assert "CAR_STEP 0.002" in (tmp_path / "car.h").read_text()
    assert "(modal)" in (tmp_path / "car.c").read_text()
    assert (tmp_path / "car_test.c").exists()
    result = run("export quarter_car -o car.c --realization physical")
    assert result.exit_code == 0
    assert "a step every 0.0001 s" in result.stdout
    assert "CAR_STEP 0.0001" in (tmp_path / "car.h").read_text()
    assert "(physical)" in (tmp_path / "car.c").read_text()
    assert run("export quarter_car -o car.mo").exit_code == 0
    assert "der(hub_z)" in (tmp_path / "car.mo").read_text()
    result = run("export quarter_car -o car.mat --step 0.1")
    assert result.exit_code == 2
    assert "give --step with a file that ends in .c" in result.stderr


def test_ports_of_an_export_are_chosen_by_name(run):
    assert run("export stewart -o part.npz --input Fx --input F[yz] --output r*").exit_code == 0
    data = mx.from_npz("part.npz")
    assert data.inputs == ("Fx", "Fy", "Fz")
    assert data.outputs == ("rx", "ry", "rz")
    result = run("export stewart -o part.npz --input Fw")
    assert result.exit_code == 2
    assert "Fw" in result.stderr


def test_fmi_version_platform_and_tunable_parameters(run):
    pytest.importorskip("fmpy")
    from fmpy import read_model_description

    line = "export slider.yaml -o slider.fmu --fmi 2.0 --platforms x86_64-linux --tunable k.stiffness --json"
    result = json.loads(run(line).stdout)
    assert result["content"] == "an FMU (FMI 2.0) that runs on x86_64-linux; others by --platforms all"
    description = read_model_description(result["file"])
    assert description.fmiVersion == "2.0"
    assert [one.name for one in description.modelVariables if one.variability == "tunable"] == ["k.stiffness"]


def test_a_controller_is_exported_as_plants_are(run, tmp_path):
    """u = 1e5 / (s + 500) y - 250 y; by Tustin's rule at a step of 1 ms, s = 2000 (z - 1) / (z + 1)."""
    law = {"A": [[-500.0]], "B": [[1.0]], "C": [[1e5]], "D": [[-250.0]], "inputs": ["x"], "outputs": ["F"]}
    (tmp_path / "law.json").write_text(json.dumps(law))
    assert run("export law.json -o law.npz").exit_code == 0
    back = mx.from_npz(tmp_path / "law.npz")
    assert (back.name, back.inputs, back.outputs) == ("law", ("x",), ("F",))
    np.testing.assert_array_equal(back.C @ back.B, [[1e5]])
    assert run("export law.json -o law.c --step 1e-3").exit_code == 0
    source = (tmp_path / "law.c").read_text()
    assert "tustin" in source.lower()
    result = run("export law.json -o law.yaml")
    assert result.exit_code == 2
    assert "holds a controller" in result.stderr
    (tmp_path / "sampled.json").write_text(json.dumps(law | {"dt": 1e-3}))
    result = run("export sampled.json -o law.npz")
    assert result.exit_code == 2
    assert "discrete time, at 1000 Hz" in result.stderr


@pytest.mark.slow
def test_plant_and_controller_of_files_are_co_simulated(run, tmp_path):
    law = {"A": [[-500.0]], "B": [[1.0]], "C": [[1e5]], "D": [[-250.0]], "inputs": ["x"], "outputs": ["F"]}
    (tmp_path / "law.json").write_text(json.dumps(law))
    assert run("export slider.yaml -o plant.fmu").exit_code == 0
    assert run("export law.json -o law.fmu").exit_code == 0
    assert run("cosim plant.fmu law.fmu --step 1e-3 --master iteration").exit_code == 0


def test_no_format_is_suggested_for_a_suffix_that_is_far_from_all(run):
    result = run("export slider.yaml -o response.csv")
    assert result.exit_code == 2
    assert "Did you mean" not in result.stderr
    assert "Did you mean '.yaml'" in run("export slider.yaml -o model.yml").stderr
