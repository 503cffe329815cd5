"""Names: a map that is reversible, never makes two names one, and that python-control takes."""

import re
import string

import control
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import mbsvib as mv
import mbsvib_export as mx
from mbsvib_export import SignalNames
from tests.export.plants import slider
from tests.support.sizes import examples

PRINTABLE = st.text(min_size=1).filter(str.isprintable)
TRICKY = st.text(".:~-[]$0123456789ABCDEFabcdefsystem2E", min_size=1, max_size=8)
NAMES = st.one_of(TRICKY, PRINTABLE)
# a model's names have no blanks at their ends
SAID = NAMES.filter(lambda name: name == name.strip() and name != "P")  # "P" is the plant itself


@examples(6, slow=40)
@given(NAMES)
@example("-")
@example("~system")
@example("~2E")
@example("~7Esystem")
@example("d(hip1.rx)/dt")
def test_the_way_back(name):
    assert SignalNames.to_mbsvib(SignalNames.to_control(name)) == name
    assert SignalNames.to_mbsvib(SignalNames.system_to_control(name)) == name
    assert SignalNames.to_mbsvib(SignalNames.system_to_control(name, (name,))) == name


@settings(deadline=None)
@given(NAMES, NAMES)
@example("a.b", "a:b")
@example("a:b", "a~3Ab")
@example("-a", "~2Da")
@example("a", "a~system")
def test_no_two_names_meet(first, second):
    for encoded in (SignalNames.to_control, SignalNames.system_to_control):
        assert (encoded(first) == encoded(second)) == (first == second)


@settings(deadline=None)
@given(NAMES)
def test_only_what_the_map_made_leads_back(name):
    try:
        origin = SignalNames.to_mbsvib(name)
    except mv.ExportError:
        return
    encodings = [SignalNames.to_control(origin), SignalNames.system_to_control(origin)]
    assert name in [*encodings, f"{encodings[1]}~system"]


@pytest.mark.parametrize("name", ["a.b", "x[0]", "sys$sampled", "a~", "a~2e", "a~zz", "~41", "-a", "~system"])
def test_names_of_other_makers_are_refused(name):
    with pytest.raises(mv.ExportError, match=re.escape(repr(name))):
        SignalNames.to_mbsvib(name)


def test_plain_names_stay_and_dots_become_colons():
    assert SignalNames.to_control("Fx") == "Fx"
    assert SignalNames.to_control("leg1.force") == "leg1:force"
    assert SignalNames.to_control("d(hip1.rx)/dt") == "d(hip1:rx)/dt"
    assert SignalNames.to_control("mode1'") == "mode1'"
    assert SignalNames.to_control("my_sensor-2 (top)") == "my_sensor-2 (top)"


def test_a_nameless_signal_is_refused():
    with pytest.raises(mv.ExportError, match="not empty"):
        SignalNames.to_control("")
    with pytest.raises(mv.ExportError, match="to_control made"):
        SignalNames.to_mbsvib("")


def plant(name):
    """Two integrators with a pole at -1 and -2; the first input is called ``name``, and so is the second output."""
    return control.StateSpace(
        np.diag([-1.0, -2.0]), np.eye(2), np.eye(2), np.zeros((2, 2)),
        inputs=[name, "other in"], outputs=["other out", name], states=[name, "other state"], name="P",
    )  # fmt: skip


def taken(name):
    """Whether python-control finds, slices, connects, samples and plots a signal of this name."""
    p = plant(name)
    k = control.StateSpace([], [], [], [[3.0]], inputs=["e"], outputs=["u"], name="K")
    loop = control.interconnect(
        [p, k], connections=[[f"P.{name}", "K.u"], ["K.e", f"-P.{name}"]], check_unused=False,
        inplist=[f"P.{name}"], outlist=["P.other out", f"P.{name}"], inputs=["r"], outputs=["a", "b"],
    )  # fmt: skip
    lists = control.interconnect([p], inplist=[name, "other in"], outlist=[name, "other out"], connections=False)
    source = control.StateSpace([], [], [], [[5.0]], inputs=["r"], outputs=[name], name="source")
    series = control.interconnect([source, p], inplist=["source.r"], outlist=["P.other out"], check_unused=False)
    return (
        p.find_input(name) == 0
        and p.find_inputs([name, "other in"]) == [0, 1]
        and np.allclose(p[name, name](0.0), 0.0)
        and control.step_response(p, [0.0, 1.0]).outputs["other out", name][-1] == pytest.approx(1 - np.exp(-1))
        and np.allclose(loop(0.0)[:, 0], [1.0, 0.0])  # the output of that name belongs to the other state
        and np.allclose(lists(0.0), [[0.0, 0.5], [1.0, 0.0]])
        and np.allclose(series(0.0), 5.0)
        and p.sample(0.1).input_labels == p.input_labels
    )


@pytest.mark.parametrize("name", ["a.b", "-a", "a[0:1]", "leg[1]", "x.-y", ":", "~", "-", "{i}", "a,b", "'", "\\", "%"])
def test_python_control_takes_what_the_map_makes(name):
    assert taken(SignalNames.to_control(name))


@pytest.mark.slow
@settings(deadline=None)
@given(SAID)
def test_python_control_keeps_any_name(name):
    encoded = SignalNames.to_control(name)
    p = plant(encoded)
    assert p.input_labels == [encoded, "other in"]
    assert p.find_inputs([encoded, "other in"]) == [0, 1]
    assert np.allclose(control.interconnect([p], inplist=[encoded], outlist=["other out"], connections=False)(0.0), 1.0)


@pytest.mark.parametrize("name", ["a.b", "-a", "a[0:1]", ""])
def test_python_control_refuses_or_misreads_them_as_they_are(name):
    with pytest.raises((ValueError, IndexError)):
        taken(name)


def test_base_names_do_not_catch_an_indexed_name():
    both = ["F", "F[0]"]
    raw = control.StateSpace([], [], [], [[1.0]], inputs=["F[0]"], outputs=["y"])
    assert raw.find_inputs("F") == [0]  # python-control takes "F" for all of F[0], F[1], ...
    system = mx.to_control(slider(inputs=both))
    assert system.find_inputs("F") == [0]
    assert mx.to_control(slider(inputs=["F[0]"])).find_inputs("F") is None


@pytest.mark.slow
def test_names_that_would_be_formulas_can_be_drawn():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    def draw(system):
        control.bode_plot(system, [1.0, 10.0])
        try:
            plt.gcf().canvas.draw()
        finally:
            plt.close("all")

    name = r"$\foo$"
    with pytest.raises(ValueError, match="foo"):
        draw(plant(name))
    draw(mx.to_control(slider(inputs=[name], outputs=[f"{name} of it"], name=name)))


@pytest.mark.parametrize("name", ["a.b", "it's", "back\\", *(f"a{sign}b" for sign in string.punctuation)])
def test_the_repr_of_a_system_of_any_name_evaluates(name):
    system = mx.to_control(slider(name=name))
    again = eval(control.iosys_repr(system, "eval"), {"StateSpace": control.StateSpace, "array": np.array})
    assert again.name == system.name
    assert SignalNames.to_mbsvib(again.name) == name


def test_a_system_called_like_its_output_can_be_connected():
    system = mx.to_control(slider(name="z"))
    assert (system.name, system.output_labels) == ("z~system", ["z"])
    again = control.interconnect([system], inplist=["F"], outlist=["z"], connections=False)
    assert np.allclose(again(0.0), 1e-4)
