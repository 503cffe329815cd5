"""The page without a mouse: Tab reaches all there is to press, keys turn and zoom, and the focus is seen."""

import numpy as np
import pytest

import mbsvib as mv

pytest.importorskip("plotly", reason="plotly is not installed (extra 'report')")
pytestmark = pytest.mark.slow

PRESSED = "a[href], button, select, input, summary, tr[data-mode], .modebar-btn, .legendtoggle, [data-keys]"
NAME = """(e) => [e.id, e.dataset.title, e.dataset.mode, e.getAttribute('class'),
  e.parentNode.textContent.trim().slice(0, 30), e.textContent.trim().slice(0, 30),
  (e.closest('[id]') || {}).id].join('|')"""
CAMERA = "Object.values(cameraNow().eye)"


@pytest.fixture(scope="module")
def page(look):
    page = look(mv.library.stewart_isolator(), compare=mv.library.stewart())
    yield page
    assert page.trouble == []


def press(page, *keys):
    for key in keys:
        page.keyboard.press(key)


def eye(page):
    return np.array(page.evaluate(CAMERA))


def test_tab_reaches_all_controls_and_the_focus_is_seen(page):
    wanted = page.evaluate(f"""[...document.querySelectorAll({PRESSED!r})].filter((e) => !e.disabled &&
      e.getClientRects().length && !e.matches('.still')).map({NAME})""")
    page.evaluate("document.activeElement.blur(); window.scrollTo(0, 0)")
    page.locator("nav a").first.focus()
    met, hidden = [], []
    for _ in range(2 * len(wanted)):
        name, outline = page.evaluate(f"""(() => {{ const e = document.activeElement, style = getComputedStyle(e);
          return [({NAME})(e), style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) > 0]; }})()""")
        if name in met:
            break
        met.append(name)
        hidden += [] if outline else [name]
        press(page, "Tab")
        if page.evaluate("document.activeElement === document.body"):
            break
    assert set(wanted) <= set(met)
    assert hidden == []


def test_arrows_turn_the_mechanism_and_signs_zoom_it(page):
    page.locator("#view").focus()
    press(page, "Home")
    start = eye(page)
    press(page, "ArrowRight", "ArrowRight")
    x, y, z = eye(page)
    turned = np.degrees(np.arctan2(y, x) - np.arctan2(start[1], start[0]))
    assert turned == pytest.approx(20.0, abs=1e-6)
    assert z == pytest.approx(start[2], abs=1e-9)
    press(page, "ArrowLeft", "ArrowLeft", "ArrowUp")
    raised = eye(page)
    assert np.degrees(np.arcsin(raised[2] / np.linalg.norm(raised)) - np.arcsin(start[2] / np.linalg.norm(start))) == (
        pytest.approx(10.0, abs=1e-6))  # fmt: skip
    for _ in range(12):
        press(page, "ArrowUp")
    assert eye(page)[2] / np.linalg.norm(eye(page)) < 1.0
    press(page, "+")
    assert np.linalg.norm(eye(page)) == pytest.approx(0.85 * np.linalg.norm(start), rel=1e-6)
    press(page, "Home")
    np.testing.assert_allclose(eye(page), start, atol=1e-9)


def test_from_the_top_the_keys_go_on_where_the_view_was(page):
    """Looking down along z with y upward, a turn by 10 degrees keeps y nearly upward."""
    page.click("#views button:nth-child(4)")
    page.wait_for_function("cameraNow().eye.z > 1.5")
    page.locator("#view").focus()
    press(page, "ArrowRight")
    right, up, _ = page.evaluate("cameraAxes(cameraNow())")
    assert np.degrees(np.arctan2(right[1], right[0])) == pytest.approx(10.0, abs=0.1)
    assert up[1] == pytest.approx(np.cos(np.radians(10.0)), abs=0.01)
    page.locator("#view").focus()
    press(page, "Home")


def test_curves_are_zoomed_and_moved(page):
    page.locator("#bode").focus()
    press(page, "+")
    low, high = page.evaluate("frequencies")
    first, last = page.evaluate("whole")
    assert np.log(high / low) == pytest.approx(0.85**4 * np.log(last / first), rel=1e-9)
    assert low * high == pytest.approx(first * last, rel=1e-9)
    assert page.evaluate("by('bode').data[0].x.length") >= 400
    press(page, "ArrowRight")
    moved = page.evaluate("frequencies")
    assert moved[1] == pytest.approx(min(last, high * (high / low) ** 0.25), rel=1e-9)
    press(page, "Home")
    assert page.evaluate("frequencies === whole")
    press(page, "-")
    assert page.evaluate("frequencies === whole")
    page.locator("#step").focus()
    end = page.evaluate("times[1]")
    press(page, "+")
    begin, stop = page.evaluate("times")
    assert stop - begin == pytest.approx(0.85**4 * end, rel=1e-9)
    press(page, "Home")
    assert page.evaluate("times") == [0, end]


def test_tools_and_legends_are_pressed(page):
    before = page.evaluate("frequencies")
    page.locator("#bode .modebar-btn[data-title='Zoom in']").focus()
    press(page, "Enter")
    page.wait_for_function("frequencies !== whole")
    after = page.evaluate("frequencies")
    assert before[0] < after[0] < after[1] < before[1]
    page.click("#reset")
    page.locator("#graph .legendtoggle").nth(1).focus()
    press(page, "Space")
    page.wait_for_function("by('graph').data.some((trace) => trace.visible === 'legendonly')")
    press(page, "Space")
    page.wait_for_function("by('graph').data.every((trace) => trace.visible !== 'legendonly')")


def test_arrows_change_tabs(page):
    page.locator("#strain").focus()
    press(page, "ArrowRight")
    assert page.evaluate("document.activeElement.id") == "kinetic"
    assert page.get_attribute("#kinetic", "aria-selected") == "true"
    press(page, "ArrowRight")
    assert page.get_attribute("#strain", "aria-selected") == "true"


def test_no_tool_sends_data_away(page):
    titles = page.evaluate("[...document.querySelectorAll('.modebar-btn')].map((e) => e.dataset.title)")
    assert any("PNG" in title for title in titles)
    assert not [title for title in titles if "hare" in title or "loud" in title]
