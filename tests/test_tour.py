"""The tour in the docs: its file is the model of the README, and its results are those that it names."""

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import mbsvib as mv
from tests.test_docs import DOCS, RUNNER

PAGE = DOCS / "pages" / "tutorial" / "tour.md"
TOUR = PAGE.read_text(encoding="utf-8")


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = re.search(r"^```yaml\n(.*?)^```$", TOUR, re.DOTALL | re.MULTILINE)[1]
    Path("table.yaml").write_text(words, encoding="utf-8")
    return Path("table.yaml")


def test_the_yaml_is_the_model_of_the_readme(file):
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    first = re.search(r"^```python\n(.*?)^```$", readme, re.DOTALL | re.MULTILINE)[1]
    assert f"```python\n{first}```" in TOUR
    space = {}
    exec(first, space)
    model, system = mv.load(file), space["system"]
    other = model.linearize()
    assert repr(model) == repr(space["model"])
    for matrix in ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D"):
        np.testing.assert_array_equal(getattr(other, matrix), getattr(system, matrix))
    assert (other.inputs, other.outputs, other.coordinates) == (system.inputs, system.outputs, system.coordinates)


def test_the_mistake_shown_is_answered_as_shown(file):
    file.write_text(file.read_text(encoding="utf-8").replace("second: mirror,", "second: miror,"), encoding="utf-8")
    with pytest.raises(mv.ModelError) as error:
        mv.load("table.yaml")
    shown = re.sub(r"line \d+", "line 7", str(error.value))
    assert shown in " ".join(TOUR.split())


@pytest.mark.slow
def test_the_results_are_as_the_page_says(tmp_path):
    mpl.use("agg")
    names, _ = RUNNER.run(PAGE, tmp_path)
    with pytest.raises(mv.EquilibriumError, match=r"on body 'arm', .* missing"):
        names["raised"].linearize()
    assert names["design"].optimum.success
    assert names["best"].success
    assert names["loop"].stable
    assert np.allclose(names["off"].std, names["off"].first, rtol=0.05)
    shown = re.search(r"frequencies\.round\(4\)\) +# \[(.*?)\]", TOUR)
    assert list(map(float, shown[1].split())) == names["mast"].linearize().modes(3).frequencies.round(4).tolist()
