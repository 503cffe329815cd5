"""The page in a real browser: it is turned, played, clicked through and downloaded from."""

import csv

import numpy as np
import pytest

import mbsvib as mv

pytest.importorskip("plotly", reason="plotly is not installed (extra 'report')")
pytestmark = pytest.mark.slow

EVIL = "</script><img src=x onerror=alert(1)>"
LINES = "view.data.find((trace) => trace.mode === 'lines' && trace.line.width === 7)"
CAMERA = "view._fullLayout.scene._scene.getCamera().eye"


@pytest.fixture(scope="module")
def stewart():
    model = mv.library.stewart(ports=("platform", "base"))
    return model, model.linearize()


@pytest.fixture(scope="module")
def page(look, stewart):
    return look(stewart[0])


@pytest.fixture(autouse=True)
def untroubled(request):
    yield
    if "page" in request.fixturenames:
        page = request.getfixturevalue("page")
        assert page.trouble == []


def x_of_lines(page):
    return np.array(page.evaluate(f"{LINES}.x.map((value) => value === null ? 0 : value)"))


def frames(page, count=12):
    """Wait until the page has had the chance to draw so many times."""
    page.evaluate(f"""new Promise((done) => {{
        let left = {count};
        const next = () => (left-- > 0 ? requestAnimationFrame(next) : done());
        next();
    }})""")


def choose_pair(page, source, result):
    for select, name in (("#input", source), ("#output", result)):
        texts = page.locator(f"{select} option").all_inner_texts()
        page.select_option(select, index=[text.split(" [")[0] for text in texts].index(name))


def test_a_zoom_computes_the_curve_anew(page, stewart):
    """In a window of one thousandth of the resonance's frequency no line is longer than a bend that can be seen."""
    choose_pair(page, "Fz", "z")
    system, peak = stewart[1], stewart[1].modes().damped_frequencies[2]
    low, high = np.log10(peak * 0.9995), np.log10(peak * 1.0005)
    page.evaluate(f"Plotly.relayout('bode', {{'xaxis.range[0]': {low}, 'xaxis.range[1]': {high}}})")
    page.wait_for_function("frequencies !== whole")
    x, y = (np.array(page.evaluate(f"by('bode').data[0].{way}")) for way in "xy")
    assert len(x) >= 400
    assert x.min() >= 10**low * (1 - 1e-9)
    assert x.max() <= 10**high * (1 + 1e-9)
    middle = np.sqrt(x[1:] * x[:-1])
    G = system.frequency_response(2.0 * np.pi * middle, "z", "Fz")[0, 0]
    bend = np.abs(np.log(np.abs(G)) - 0.5 * np.log(y[1:] * y[:-1]))
    assert bend.max() < 0.005 * np.ptp(np.log(y))
    page.click("#reset")
    assert page.evaluate("frequencies === whole")


def test_the_library_draws_every_point(page):
    assert page.evaluate("[...by('bode').data, ...by('step').data].every((trace) => trace.line.simplify === false)")


def test_two_designs_are_compared(look, stewart, browser):
    soft = mv.library.stewart_isolator().linearize()
    heavy = mv.library.stewart_isolator().linearize()
    page = look(soft, compare=heavy, names=("before", EVIL))
    assert page.locator("#pairs tbody tr").count() == soft.dof
    assert page.locator("#pairs tbody tr td").nth(4).inner_text() == "0"
    assert EVIL in page.inner_text("#pairs thead")
    assert page.evaluate("by('bode').data.length") == 4
    assert page.evaluate("by('step').data.length") == 2
    assert page.trouble == []


def test_measured_responses_are_points_over_the_curves_of_the_model(look):
    system = mv.library.quarter_car().linearize()
    omega = np.linspace(1.0, 100.0, 20)
    data = mv.Measurement(omega, system.frequency_response(omega), system.outputs, system.inputs,
                          output_units=system.output_units, input_units=system.input_units)["body.z", :]  # fmt: skip
    page = look(system, compare=data)
    assert page.locator("#pairs").is_hidden()
    assert page.locator("#measured-pair option").count() == len(system.inputs)
    model, phase, rig, _ = (page.evaluate(f"by('measured-plot').data[{k}].y") for k in range(4))
    assert model == rig
    assert len(phase) == len(omega)
    assert "body.z / road: FRAC 1.0000" in page.inner_text("#differences")
    assert page.trouble == []


@pytest.mark.parametrize("width", [390, 1024, 1920])
def test_no_width_scrolls_sideways(page, width):
    page.set_viewport_size({"width": width, "height": 900})
    frames(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.set_viewport_size({"width": 1280, "height": 800})


def saved(page, button):
    with page.expect_download() as download:
        page.click(button)
    with open(download.value.path(), encoding="utf-8", newline="") as stream:
        return download.value.suggested_filename, list(csv.reader(stream))


def test_one_file_is_all_that_is_asked_for(page):
    assert [url for url in page.asked if not url.startswith(("blob:", "data:"))] == [page.url]


def test_the_table_lists_all_modes(page, stewart):
    rows = page.locator("#modes tbody tr")
    assert rows.count() == 6
    assert rows.nth(2).locator("td").nth(1).inner_text() == f"{stewart[1].modes().frequencies[2]:.6g}"
    assert "platform z" in rows.nth(2).inner_text()


def test_a_click_on_a_mode_plays_it_and_another_rests(page):
    page.click("#modes tbody tr:nth-child(3)")
    assert page.locator("#modes tbody tr.chosen td").first.inner_text() == "3"
    assert page.inner_text("#play") == "Pause"
    page.wait_for_function("state.drawn > 5")
    moving = x_of_lines(page)
    page.wait_for_function(f"state.drawn > {page.evaluate('state.drawn') + 3}")
    assert np.abs(x_of_lines(page) - moving).max() > 0.0
    page.click("#play")
    assert page.inner_text("#play") == "Play"
    frames(page)
    drawn = page.evaluate("state.drawn")
    frames(page)
    assert page.evaluate("state.drawn") == drawn


def test_a_chosen_mode_is_told(page, stewart):
    page.evaluate("choose(2)")
    shares = stewart[1].stiffness_shares(stewart[1].modes()).shares
    message = page.inner_text("#detail")
    assert "Mode 3, 903.888 Hz" in message
    assert f"{100.0 * shares[:, 2].max():.1f} %" in message
    assert "platform" in message


def test_the_picture_is_the_shape_of_the_mode(page, stewart):
    """At phase 0 points are where the bodies' displacements take them, the farthest one by the amplitude."""
    from mbsvib.plots._scene import of_system

    system = stewart[1]
    modes = system.modes()
    scene = of_system(system.name, system.provenance)
    for mode in (0, 5):
        page.evaluate(f"choose({mode})")
        moves = scene.displacements(np.array([modes.body_shapes[name][:, mode] for name in system.bodies]))
        expected = scene.points + 0.1 * scene.size * moves / np.linalg.norm(moves, axis=1).max()
        drawn = np.array(page.evaluate("Array.from(moved())")).reshape(-1, 3)
        np.testing.assert_allclose(drawn, expected, atol=1e-6)


@pytest.mark.parametrize("direct", [True, False])
def test_points_go_to_what_draws_them_either_way(page, direct):
    """Straight, and the library's own way, which is there for other versions of it."""
    page.evaluate(f"play(false); choose(2); direct = {str(direct).lower()}; state.phase = 1.0; draw()")
    frames(page)
    assert page.evaluate("direct") is direct
    drawn = page.evaluate("view._fullData.map((trace) => Array.from(trace.x).filter((value) => value !== null))[2]")
    moved = page.evaluate("traces[2].numbers.filter((i) => i >= 0).map((i) => moved()[3 * i])")
    np.testing.assert_allclose(drawn, moved, atol=1e-12)
    page.evaluate("direct = true")


def test_the_picture_is_turned_by_the_mouse_and_stays_so_when_it_moves(page):
    page.click("#views button:first-child")
    page.evaluate("play(false); choose(0)")
    before = page.evaluate(CAMERA)
    box = page.locator("#view").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    for i in range(5):
        page.mouse.move(x + 36 * i, y)
        page.evaluate("state.phase += 0.3; draw()")
    page.mouse.up()
    frames(page)
    page.evaluate("draw()")
    after = page.evaluate(CAMERA)
    turned = np.degrees(np.arctan2(after["y"], after["x"]) - np.arctan2(before["y"], before["x"]))
    assert abs((turned + 180.0) % 360.0 - 180.0) > 20.0


def test_views_and_layers(page):
    page.click("#views button:nth-child(4)")
    page.wait_for_function(f"{CAMERA}.z > 1.5")
    count = "view.data.reduce((sum, trace) => sum + (trace.visible && trace.mode === 'lines' ? trace.x.length : 0), 0)"
    full = page.evaluate(count)
    page.click("#layers label:has-text('springs')")
    page.wait_for_function(f"{count} < {full}")
    page.click("#layers label:has-text('springs')")
    page.wait_for_function(f"{count} === {full}")
    page.click("#views button:first-child")


def test_the_pointer_tells_what_a_part_is(page):
    texts = page.evaluate("view.data.flatMap((trace) => trace.text || [])")
    assert any("leg1.head" in text and "joint between" in text for text in texts)
    assert any("leg2.head" in text and ", cut" in text for text in texts)


@pytest.mark.parametrize(("source", "result"), [("Fz", "z"), ("Fx", "x"), ("ax", "platform.ax")])
def test_any_input_and_output_can_be_chosen(page, stewart, source, result):
    system = stewart[1]
    choose_pair(page, source, result)
    drawn = page.evaluate("({x: by('bode').data[0].x, y: by('bode').data[0].y, phase: by('bode').data[1].y})")
    G = system.frequency_response(2.0 * np.pi * np.array(drawn["x"]))
    G = G[system.outputs.index(result), system.inputs.index(source)]
    np.testing.assert_allclose(drawn["y"], np.abs(G), rtol=1e-6)
    off = np.exp(1j * np.radians(drawn["phase"])) - G / np.abs(G)
    assert np.abs(off).max() < 1e-5
    titles = page.evaluate("['xaxis', 'yaxis', 'yaxis2'].map((name) => by('bode').layout[name].title.text)")
    assert titles[0] == "frequency [Hz]"
    assert titles[1] == f"magnitude [{'m/N' if source != 'ax' else '1'}]"
    assert titles[2] == "phase [deg]"


def test_a_click_on_a_resonance_shows_its_mode(page):
    page.evaluate("choose(0)")
    page.evaluate("by('bode').emit('plotly_click', {points: [{x: 1265.0}]})")
    assert page.evaluate("state.mode") == 5


def test_energy_of_springs_or_of_bodies(page, stewart):
    system = stewart[1]
    modes = system.modes()
    drawn = "({names: by('shares').layout.yaxis.ticktext, z: by('shares').data[0].z})"
    page.click("#kinetic")
    kinetic = page.evaluate(drawn)
    share = kinetic["z"][kinetic["names"].index("platform")]
    np.testing.assert_allclose(share, 100.0 * modes.kinetic_energy["platform"], rtol=1e-3)
    page.click("#strain")
    strain = page.evaluate(drawn)
    shares = system.stiffness_shares(modes)
    assert strain["names"] == list(shares.elements)
    np.testing.assert_allclose(strain["z"], 100.0 * shares.shares, atol=0.01)


def test_the_keyboard_does_what_the_mouse_does(page):
    """Rows of the table take Enter and the space bar, without a scroll of the page; Tab reaches all controls."""
    page.evaluate("play(false); choose(0); document.documentElement.style.scrollBehavior = 'auto'")
    row = page.locator("#modes tbody tr:nth-child(4)")
    row.focus()
    page.keyboard.press("Enter")
    assert page.evaluate("[state.mode, state.playing]") == [3, True]
    page.locator("#play").focus()
    page.keyboard.press("Space")
    assert page.evaluate("state.playing") is False
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "next"
    page.keyboard.press("Enter")
    assert page.evaluate("state.mode") == 4
    page.locator("#modes tbody tr:nth-child(2)").focus()
    frames(page)
    top = page.evaluate("window.scrollY")
    page.keyboard.press("Space")
    assert page.evaluate("state.mode") == 1
    page.evaluate("play(false)")
    frames(page)
    assert page.evaluate("window.scrollY") == top
    page.locator("#amplitude").focus()
    before = float(page.evaluate("by('amplitude').value"))
    page.keyboard.press("ArrowRight")
    assert float(page.evaluate("by('amplitude').value")) > before
    page.keyboard.press("ArrowLeft")
    page.locator("#output").focus()
    first = page.evaluate("chosen[0].output")
    page.keyboard.press("ArrowDown")
    assert page.evaluate("chosen[0].output") != first


def test_the_first_response_is_not_zero_by_symmetry(look):
    """The stage's payload does not move sideways in pitch: floor.x to metrology.az is rounding."""
    page = look(mv.library.wafer_stage())
    first = page.evaluate("[chosen[0].input, chosen[0].output, chosen[0].negligible]")
    assert first == ["floor.z", "metrology.az", False]
    end = page.evaluate("times[1]")
    assert 1.0 < end < 10.0  # the stage above it goes on for a minute, which this output does not see
    assert page.trouble == []


def test_frequencies_at_ticks_are_whole_numbers(page, stewart):
    """0.2, 0.5, 1, 2, ...: a 2 beside a 10 would be read as 2 Hz where 20 Hz are meant."""
    choose_pair(page, "Fz", "z")
    values, texts = page.evaluate("(({tickvals, ticktext}) => [tickvals, ticktext])(by('bode').layout.xaxis)")
    assert [float(text) for text in texts] == pytest.approx(values)
    assert len(values) >= 3


def test_names_in_the_topology_do_not_overlap_on_a_phone(look):
    page = look(mv.library.stewart_isolator())
    page.set_viewport_size({"width": 390, "height": 800})
    page.reload()
    page.wait_for_function("document.body.dataset.ready === 'yes'")
    boxes = page.evaluate("""[...document.querySelectorAll('#graph .annotation-text-g')].map((e) => {
        const {left, right, top, bottom} = e.getBoundingClientRect(); return [left, right, top, bottom]; })""")
    assert len(boxes) == 14
    for i, (left, right, top, bottom) in enumerate(boxes):
        for other_left, other_right, other_top, other_bottom in boxes[:i]:
            assert right <= other_left or other_right <= left or bottom <= other_top or other_bottom <= top
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.trouble == []


def test_phases_go_on_beyond_poles_without_damping_and_all_modes_have_shares(look):
    """At a pole itself a phase is no number; those beyond it were lost, and shares of modes from the 61st on."""
    model = mv.library.cantilever()
    page = look(model)
    phases = page.evaluate("by('bode').data.find((trace) => trace.yaxis === 'y2').y")
    assert None not in phases[-20:]
    angles = [value for value in phases if value is not None]
    dtick = page.evaluate("by('bode').layout.yaxis2.dtick")
    assert dtick % 90 == 0
    assert (max(angles) - min(angles)) / dtick <= 8
    assert len(set(np.round(phases[-20:], 6)) | {0.0}) == 2  # above all poles it is not what it is at rest
    assert page.evaluate("phases([{re: 1, im: 0}, {re: NaN, im: 0}, {re: -1, im: 0}])") == [0, None, -180]
    assert page.evaluate("by('shares').data[0].z.map((row) => row.length)") == [120] * 20
    page.evaluate("tell(119)")
    assert "Strain energy by element" in page.inner_text("#detail")
    assert page.trouble == []


def test_topology_tells_what_was_cut(page, stewart):
    assert page.locator("#cut li").all_inner_texts() == list(stewart[1].cut_joints)
    assert "15 of 15" in page.inner_text("#loops")
    assert page.evaluate("by('graph').data.map((trace) => trace.name).includes('cut joint')")
    page.click("summary")
    assert "minimal:" in page.inner_text("#explained")
    assert page.locator("#skipped li").count() >= 3


def test_all_data_can_be_had_as_csv(page, stewart):
    system = stewart[1]
    name, rows = saved(page, "#csv-modes")
    assert name == "stewart-modes.csv"
    assert [float(row[1]) for row in rows[1:]] == system.modes().frequencies.tolist()
    choose_pair(page, system.inputs[0], system.outputs[0])
    name, rows = saved(page, "#csv-response")
    values = np.array(rows[1:], dtype=float)
    G = system.frequency_response(2.0 * np.pi * values[:, 0])[0, 0]
    np.testing.assert_allclose(values[:, 1], np.abs(G), rtol=1e-6)
    assert "m/N" in rows[0][1]
    name, rows = saved(page, "#csv-shapes")
    assert len(rows) == 1 + 6 * len(system.bodies)
    column = [float(row[4]) for row in rows[1:]]
    expected = np.concatenate([system.modes().body_shapes[body][:, 1] for body in system.bodies])
    np.testing.assert_allclose(column, expected, rtol=1e-6, atol=1e-9)
    _, rows = saved(page, "#csv-energy")
    assert rows[0][-1] == "mode 6"
    _, rows = saved(page, "#csv-topology")
    assert {row[0] for row in rows[1:]} == {"tree", "cut", "spring"}


def test_the_picture_is_there(page):
    """A WebGL scene that failed to draw is one colour all over."""
    pixels = page.locator("#view").screenshot()
    assert len(pixels) > 15_000
    assert page.locator("#view canvas").count() >= 1


def test_names_are_shown_as_they_are(look):
    model = mv.Model(EVIL)
    model.add_body(EVIL, 1.0, (1, 1, 1))
    model.add_joint(EVIL + "j", "prismatic", "ground", EVIL, axis=(1, 0, 0))
    model.add_spring(EVIL + "k", "ground", EVIL, (-1, 0, 0), (0, 0, 0), stiffness=1.0)
    model.add_input(EVIL, EVIL, "x")
    model.add_output(EVIL, EVIL, "x")
    page = look(model)
    page.on("dialog", lambda dialog: page.trouble.append("dialog"))
    assert page.inner_text("h1") == EVIL
    assert page.locator("img[src='x']").count() == 0
    assert EVIL in page.inner_text("#modes")
    assert EVIL in page.inner_text("#graph")
    assert page.trouble == []


def test_what_has_no_mode_is_a_page_too(look):
    model = mv.Model("locked")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("weld", "fixed", "ground", "b")
    page = look(model)
    page.click("#csv-modes")
    assert page.trouble == []
