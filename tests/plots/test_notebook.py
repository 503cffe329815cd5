"""What a notebook shows."""

import pytest

import mbsvib as mv

EVIL = "<img src=x onerror=alert(1)>"


@pytest.mark.slow
def test_models_systems_and_modes_show_themselves():
    model = mv.library.quarter_car()
    system = model.linearize()
    modes = system.modes()
    lowest = f"{modes.frequencies[0]:.6f}"
    for source, words in ((model, model.inputs), (system, system.coordinates), (modes, [lowest])):
        page = source._repr_html_()
        assert page.count("<table>") == page.count("</table>") == 1
        assert all(word in page for word in words)
    assert "data:image/png;base64," in model._repr_html_()
    assert "data:image/png;base64," in system._repr_html_()


@pytest.mark.slow
def test_names_are_escaped():
    model = mv.Model(EVIL)
    model.add_body(EVIL, 1.0, (1, 1, 1))
    for source in (model, model.linearize(), model.linearize().modes()):
        assert EVIL not in source._repr_html_()


def test_empty_and_huge_models_have_no_picture():
    assert "<img" not in mv.Model("empty")._repr_html_()
    assert "<img" not in mv.library.chain(300)._repr_html_()
