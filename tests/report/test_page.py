"""What is in the page, without looking at it."""

import base64
import json
import re

import numpy as np
import pytest

import mbsvib as mv

pytest.importorskip("plotly", reason="plotly is not installed (extra 'report')")

from mbsvib import report
from mbsvib.report.data import collect
from mbsvib.report.page import embedded
from tests.plots.test_modes import rounded_plate
from tests.support.slow_cases import some

EVIL = "</script><img src=x onerror=alert(1)>"


def stored(page):
    """The data that a page holds, as a browser would read them."""
    text = re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.DOTALL)[1]
    return json.loads(text)


def floats(code):
    return np.frombuffer(base64.b64decode(code), dtype="<f4")


@pytest.fixture(scope="module")
def stewart():
    model = mv.library.stewart(ports=("platform", "base"))
    return model, model.linearize()


@pytest.mark.slow
def test_a_page_is_small_and_whole(stewart, tmp_path):
    path = report.write(stewart[0], tmp_path / "report.html")
    assert path.stat().st_size < 3e6
    assert [item.name for item in tmp_path.iterdir()] == ["report.html"]
    assert stored(path.read_text(encoding="utf-8"))["name"] == "stewart"


@pytest.mark.slow
def test_nothing_is_fetched(stewart):
    page = report.html(stewart[1])
    own = page.replace(re.search(r'<script id="plotly".*?</script>', page, re.DOTALL)[0], "")
    assert not re.search(r"(src|href)=(?![\"']?#)", own)
    assert "http" not in own.replace("http-equiv", "")
    assert "default-src 'none'" in own


@pytest.mark.slow
def test_the_data_are_those_of_the_system(stewart):
    system = stewart[1]
    data, modes = collect(system), system.modes()
    rows = data["modes"]["rows"]
    assert [row["natural"] for row in rows] == modes.frequencies.tolist()
    assert [row["error"] for row in rows] == modes.errors.reshape(-1, 2).max(axis=1).tolist()
    motion = floats(data["modes"]["motion"]).reshape(6, 13, 6, 2)
    expected = np.array([modes.body_shapes[name] for name in system.bodies])
    np.testing.assert_allclose(motion[..., 0], np.moveaxis(expected, 2, 0), rtol=1e-6, atol=1e-12)
    responses = data["responses"]
    assert {name for name, _ in responses["inputs"]} == set(system.inputs)
    assert {name for name, _ in responses["outputs"]} == set(system.outputs)
    assert responses["form"]["error"] < 1e-12
    assert responses["inputs"][0] == ["ax", "m/s²"]  # transmissibility first
    assert responses["units"][0] == "1"
    assert data["cut"] == list(system.cut_joints)
    shares = dict(data["shares"]["strain"])
    np.testing.assert_allclose(np.sum([*shares.values()], axis=0), 100.0, atol=1e-2)
    assert data["explained"] == system.explain()


@pytest.mark.slow
def test_names_cannot_leave_their_place():
    model = mv.Model(EVIL)
    model.add_body(EVIL, 1.0, (1, 1, 1))
    model.add_joint(EVIL + "j", "prismatic", "ground", EVIL, axis=(1, 0, 0))
    model.add_spring(EVIL + "k", "ground", EVIL, (-1, 0, 0), (0, 0, 0), stiffness=1.0)
    model.add_input(EVIL, EVIL, "x")
    model.add_output(EVIL, EVIL, "x")
    page = report.html(model)
    assert EVIL not in page
    assert "<img" not in page[: page.index('<script id="plotly"')]
    assert stored(page)["name"] == EVIL
    assert "&lt;/script&gt;" in page[:3000]


@pytest.mark.parametrize("text", ["</script>", "<!--<script>", "]]>", "&amp;", "\u2028\u2029", '"\\', "é"])
def test_embedded_data_come_back(text):
    code = embedded({"name": text})
    assert json.loads(code) == {"name": text}
    assert not set("<>&\u2028\u2029é") & set(code)


@pytest.mark.slow
def test_what_has_nothing_to_show_is_a_page_nevertheless():
    model = mv.Model("locked")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("weld", "fixed", "ground", "b")
    data = stored(report.html(model))
    assert data["responses"] is None
    assert data["modes"]["rows"] == []


@pytest.mark.slow
def test_no_pair_is_left_out():
    model = mv.Model("many")
    for i in range(14):
        model.add_body(f"b{i}", 1.0, (1, 1, 1), (i, 0, 0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        model.add_bushing(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", (i - 0.5, 0, 0), (1e3,) * 6, (1.0,) * 6)
        model.add_input(f"F{i}", f"b{i}", "x")
        model.add_output(f"x{i}", f"b{i}", "x")
    page = report.html(model)
    data = stored(page)["responses"]
    assert len(page) < 3e6
    assert (len(data["inputs"]), len(data["outputs"])) == (14, 14)
    selected = stored(report.html(model, ["x0", "x13"], "F13"))["responses"]
    assert (len(selected["inputs"]), len(selected["outputs"])) == (1, 2)
    with pytest.raises(mv.ResponseError, match="x14"):
        report.html(model, outputs="x14")


@pytest.mark.slow
@pytest.mark.parametrize("name", some(mv.library.models(), "stewart", "rotor_stator", "ladder"))
def test_every_page_of_the_library_is_small_and_its_form_accurate(name):
    page = report.html(mv.library.build(name))
    assert len(page) < 3e6
    responses = stored(page)["responses"]
    assert responses is None or responses["form"]["error"] < 1e-10


def test_a_defective_system_gets_a_triangular_form():
    space = mv.StateSpace.from_arrays([[-2, 1, 0], [0, -2, 1], [0, 0, -2]], [[0], [0], [1]], [[1, 0, 0]], 0)
    responses = collect(space)["responses"]
    assert responses["form"]["blocks"] == []
    assert responses["form"]["error"] < 1e-12


def test_the_parts_of_a_motion_are_told_as_such():
    """The curve of the displacement alone leaves out the damper: without a word it reads as the whole response."""
    model = mv.Model("floor")
    model.add_body("b", 4.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    model.add_spring("k", "ground", "b", (0, 0, -1), (0, 0, 0), stiffness=200.0, damping=30.0)
    model.add_motion_input("floor", "k")
    model.add_output("z", "b", "z")
    driven = model.linearize()
    told = collect(driven.ends)["motions"]
    assert set(told) == {"floor.displacement", "floor.velocity"}
    assert "is that to floor.displacement, plus iω times that to floor.velocity." in told["floor.displacement"]
    parts, whole = driven.ends.frequency_response([7.0])[0, :, 0], driven.frequency_response([7.0])[0, 0, 0]
    assert parts[0] + 7j * parts[1] == pytest.approx(whole, rel=1e-12)
    assert collect(mv.library.quarter_car().linearize())["motions"] == {}


def test_modes_are_paired_by_shape_when_their_order_changes():
    def model(stiff):
        result = mv.Model("two")
        for name, k, y in (("a", 1e4, 0), ("b", stiff, 1)):
            result.add_body(name, 1.0, (1, 1, 1), (0, y, 0))
            result.add_joint(f"j{name}", "prismatic", "ground", name, position=(0, y, 0), axis=(1, 0, 0))
            result.add_spring(f"k{name}", "ground", name, (-1, y, 0), (0, y, 0), stiffness=k)
        return result

    data = collect(model(2e4).linearize(), other=model(5e3).linearize(), labels=("stiff", "soft"))["compared"]
    assert data["pairs"] == {"by": "shape", "rows": [[0, 1, 1.0], [1, 0, 1.0]]}
    assert data["labels"] == ["stiff", "soft"]


@pytest.mark.slow
def test_an_unstable_loop_is_a_page_that_says_so():
    plant = mv.library.quarter_car().linearize()
    law = mv.StateSpace.from_arrays([[-5.0]], [[1.0]], [[-20.0]], 0)
    data = stored(report.html(plant.feedback(law, sensors=["body.z"], actuators=["actuator"])))
    assert "Unstable" in " ".join(data["modes"]["remarks"])
    assert data["responses"]["form"]["error"] < 1e-6  # above 1e-9 the page says how large it is
    assert (data["scene"], data["topology"]) == (None, None)


@pytest.mark.slow
def test_an_error_budget_is_a_section_of_its_own():
    model = mv.Model("one")
    model.add_body(EVIL, 2.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", EVIL, axis=(0, 0, 1))
    model.add_spring("s", "ground", EVIL, (0, 0, -1), (0, 0, 0), stiffness=800.0, damping=3.0)
    model.add_input(EVIL, EVIL, "z")
    model.add_output("x", EVIL, "z")
    budget = model.linearize().budget({EVIL: 1.0})
    page = report.html(model, budget=budget)
    section = re.search(r'<section id="budget">(.*?)</section>', page, re.DOTALL)[1]
    assert '<a href="#budget">' in page
    assert EVIL not in section
    assert f"<td class=\"\">{budget.rms['x']:.4g}</td>" in section
    picture = base64.b64decode(re.search(r'src="data:image/png;base64,([^"]*)"', section)[1])
    assert picture.startswith(b"\x89PNG")
    assert "#budget" not in report.html(model)
    with pytest.raises(mv.ModelError, match="report: budget = 3; expected an error budget"):
        report.html(model, budget=3)


def test_names_of_a_comparison_are_two():
    model = mv.library.quarter_car()
    with pytest.raises(mv.ModelError, match="two names"):
        report.html(model, compare=model, names="before")


@pytest.mark.slow
def test_refusals_say_what_to_do(monkeypatch, tmp_path):
    model = mv.library.quarter_car()
    with pytest.raises(mv.ExportError, match="cannot be written"):
        report.write(model, tmp_path / "no" / "report.html")
    with pytest.raises(mv.ModelError, match=r"method='dense'"):
        report.html(mv.library.chain(700))
    monkeypatch.setitem(__import__("sys").modules, "plotly.offline", None)
    with pytest.raises(mv.ExportError, match=r"mbsvib\[report\]"):
        report.html(model)


def test_damping_that_is_rounding_is_zero():
    model = rounded_plate()
    system = model.linearize()
    ratios = system.modes().damping_ratios
    rounded = np.abs(ratios) < 1e-13 * ratios.max()
    rows = collect(system)["modes"]["rows"]
    assert ratios[rounded].any()
    assert [row["ratio"] == 0.0 and row["values"][0][0] == 0.0 for row in rows] == rounded.tolist()
