"""Labels in the report: none hides another, and those of the 3-D picture are in a corner clear of the mechanism."""

import numpy as np
import pytest

import mbsvib as mv

pytest.importorskip("plotly", reason="plotly is not installed (extra 'report')")
pytestmark = pytest.mark.slow

BOXES = """(selector) => [...document.querySelectorAll(selector)].filter((e) => e.getClientRects().length).map((e) => {
  const {left, right, top, bottom} = e.getBoundingClientRect(); return [left, right, top, bottom]; })"""


def long_names():
    """Three masses in a row of which every part has a long name."""
    model, before = mv.Model("a_model_with_a_rather_long_name"), "ground"
    for i in range(3):
        name = f"left_front_suspension_upright_{i}"
        model.add_body(name, 1.0, (1, 1, 1), (0, 0, i + 1.0))
        model.add_joint(f"{name}.joint", "prismatic", "ground", name, axis=(0, 0, 1))
        model.add_spring(f"{name}.spring", before, name, (0, 0, i), (0, 0, i + 1.0), 1e3, 5.0)
        model.add_input(f"{name}.vertical_force_of_the_actuator", name, "z")
        model.add_output(f"{name}.vertical_acceleration_at_the_centre", name, "z", quantity="acceleration")
        before = name
    return model


MODELS = {
    "long": long_names,
    "chain": lambda: mv.library.chain(30),
    "ladder": lambda: mv.library.ladder(6),
    "isolator": mv.library.stewart_isolator,
    "quadruped": mv.library.quadruped,
    "rotor": mv.library.rotor_stator,
}


def overlapping(boxes):
    return [(one, other) for k, one in enumerate(boxes) for other in boxes[:k]
            if one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]]  # fmt: skip


@pytest.fixture(scope="module", params=MODELS)
def page(request, look):
    page = look(MODELS[request.param]())
    yield page
    assert page.trouble == []


@pytest.mark.parametrize("width", [390, 1024, 1600])
def test_no_name_hides_another(page, width):
    page.set_viewport_size({"width": width, "height": 900})
    page.reload()
    page.wait_for_function("document.body.dataset.ready === 'yes'")
    names = page.evaluate(BOXES, "#graph .annotation-text-g")
    assert len(names) == len(page.evaluate("data.topology.nodes"))
    legend = page.evaluate(BOXES, "#graph .legendtext")
    assert overlapping(names) == []
    assert not [pair for box in legend for pair in overlapping([box, *names]) if box in pair]
    labels = page.evaluate(BOXES, ".compass text")
    assert overlapping([box for box in labels if box[1] > box[0]]) == []
    view = page.locator("#view").bounding_box()
    for left, right, top, bottom in labels:
        assert view["x"] <= left <= right <= view["x"] + view["width"]
        assert view["y"] <= top <= bottom <= view["y"] + view["height"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    for figure, selector in (("#bode", ".gtitle"), ("#shares", ".ytick text")):
        (around,) = page.evaluate(BOXES, figure)
        for left, right, top, bottom in page.evaluate(BOXES, f"{figure} {selector}"):
            assert around[0] - 1 <= left <= right <= around[1] + 1
            assert around[2] - 1 <= top <= bottom <= around[3] + 1


def test_the_corner_of_the_labels_has_the_fewest_points(page):
    """Points are where the library's own matrices put them."""
    own = np.array(page.evaluate("""(() => {
      const {projection, view: camera, model} = view._fullLayout.scene._scene.glplot.cameraParams, out = [];
      const times = (m, v) => [0, 1, 2, 3].map((i) => v.reduce((sum, value, k) => sum + m[4 * k + i] * value, 0));
      const {xaxis, yaxis, zaxis} = view._fullLayout.scene, ranges = [xaxis, yaxis, zaxis].map(({range}) => range);
      const scale = view._fullLayout.scene._scene.dataScale;
      for (let i = 0; i < scene.points.length; i += 3) {
        const at = [0, 1, 2].map((k) => scene.points[i + k] * scale[k]);
        const [x, y, , w] = times(projection, times(camera, times(model, [...at, 1])));
        out.push([0.5 * (1 + x / w) * view.clientWidth, 0.5 * (1 - y / w) * view.clientHeight]);
      }
      return out; })()"""))
    points = np.array(page.evaluate("projected(cameraNow())"))
    np.testing.assert_allclose(points, own, atol=1.0)


def test_the_corner_shows_directions_and_a_length(page):
    page.click("#views button:nth-child(4)")
    page.wait_for_function("cameraNow().eye.z > 1.5")
    x, y, z, length = page.evaluate("""[...compass.querySelectorAll('text')].map((e) => [e.textContent,
      Number(e.getAttribute('x')), Number(e.getAttribute('y'))])""")
    at = {name: (left, top) for name, left, top in (x, y, z) if name}
    assert set(at) == {"x", "y"}
    assert at["x"][0] > 46 + 20
    assert at["y"][1] < 46 - 20
    value, unit = length[0].split()
    bar = page.evaluate("compass.querySelector('.bar').getBBox().width")
    metre = page.evaluate("pixelsPerMetre(cameraNow())")
    assert bar == pytest.approx(float(value) * {"mm": 1e-3, "m": 1.0}[unit] * metre, abs=0.1)
    assert 25.0 < bar <= 84.1
    page.click("#views button:nth-child(1)")
