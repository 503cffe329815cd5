"""Every bad input is refused at the door, in words: which element, what was given, what was expected, what to do."""

import pickle

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.common.arguments import known
from mbsvib.common.expected import ascending, reals
from tests.support.arm import arm

NAN, INF = float("nan"), float("inf")
BOX = (0.1, 0.1, 0.1)


def body(**words):
    return "add_body", {"name": "tool", "mass": 1.0, "inertia": BOX} | words


def joint(**words):
    arguments = {"name": "pin", "kind": "revolute", "first": "arm", "second": "hand", "position": (0, 0, 1)} | words
    return "add_joint", arguments


def bushing(**words):
    arguments = {"name": "pad", "first": "arm", "second": "hand", "position": (0, 0, 1), "stiffness": (1.0,) * 6}
    return "add_bushing", arguments | words


def spring(**words):
    arguments = {"name": "coil", "first": "arm", "second": "hand", "start": (0, 0, 0), "end": (0, 0, 1),
                 "stiffness": 1.0}  # fmt: skip
    return "add_spring", arguments | words


def source(**words):
    return "add_input", {"name": "pull", "body": "hand", "direction": "x"} | words


def output(**words):
    return "add_output", {"name": "drift", "body": "hand", "direction": "x"} | words


def base(**words):
    return "add_base_motion", {"name": "quake", "direction": "x"} | words


def force(**words):
    return "add_force_output", {"name": "load", "element": "mount", "direction": "x"} | words


def load(**words):
    return "add_load", {"name": "pull", "body": "hand", "force": (0, 0, -1)} | words


ASYMMETRIC = np.diag([1.0, 1.0, 1.0])
ASYMMETRIC[0, 1] = 0.25
LEFT = np.diag([1.0, 1.0, -1.0])
STRETCHED = np.diag([1.0, 1.0, 1.0 + 3e-4])

# what is wrong, the call, and words that the message must hold beside the element's name
CASES = {
    # values that no number is
    "mass NaN": (body(mass=NAN), ["mass", "nan", "NaN and infinity"]),
    "mass infinite": (body(mass=INF), ["mass", "inf"]),
    "mass text": (body(mass="heavy"), ["mass", "'heavy'", "a positive number"]),
    "mass None": (body(mass=None), ["mass", "None"]),
    "mass a list": (body(mass=[1.0]), ["mass", "[1.0]"]),
    "mass complex": (body(mass=1j), ["mass", "1j"]),
    "mass boolean": (body(mass=True), ["mass", "True"]),
    "position NaN": (body(position=(0, NAN, 0)), ["position", "nan"]),
    "position infinite both ways": (body(position=(INF, -INF, 0)), ["position", "inf"]),
    "position too short": (body(position=(0, 1)), ["position", "(0, 1)", "three"]),
    "position too long": (body(position=(0, 1, 2, 3)), ["position", "(0, 1, 2, 3)"]),
    "position a number": (body(position=7.5), ["position", "7.5"]),
    "position text": (body(position="abc"), ["position", "'abc'"]),
    "position with text": (body(position=(0, "up", 0)), ["position", "'up'"]),
    "position with None": (body(position=(0, None, 0)), ["position", "None"]),
    "position nested": (body(position=((0, 0, 0),)), ["position", "((0, 0, 0),)"]),
    "inertia NaN": (body(inertia=(0.1, NAN, 0.1)), ["inertia", "nan"]),
    "inertia of 4 values": (body(inertia=(1, 1, 1, 1)), ["inertia", "3 principal moments, 6 entries", "3x3"]),
    "inertia a number": (body(inertia=0.5), ["inertia", "0.5"]),
    "inertia 3x2": (body(inertia=np.ones((3, 2))), ["inertia", "3x3"]),
    "joint position NaN": (joint(position=(NAN, 0, 0)), ["position", "nan"]),
    "joint position short": (joint(position=(1,)), ["position", "(1,)"]),
    "bushing position NaN": (bushing(position=(NAN, 0, 0)), ["position", "nan"]),
    "bushing stiffness of 3": (bushing(stiffness=(1, 2, 3)), ["stiffness", "(1, 2, 3)", "6 values", "6x6"]),
    "bushing stiffness NaN": (bushing(stiffness=(NAN,) * 6), ["stiffness", "nan"]),
    "bushing damping infinite": (bushing(damping=(INF,) * 6), ["damping", "inf"]),
    "bushing stiffness a number": (bushing(stiffness=12.5), ["stiffness", "12.5"]),
    "bushing stiffness 6x5": (bushing(stiffness=np.ones((6, 5))), ["stiffness", "6x6"]),
    "bushing matrix NaN": (bushing(stiffness=np.full((6, 6), NAN)), ["stiffness", "nan"]),
    "spring stiffness NaN": (spring(stiffness=NAN), ["stiffness", "nan"]),
    "spring damping infinite": (spring(damping=INF), ["damping", "inf"]),
    "spring stiffness text": (spring(stiffness="soft"), ["stiffness", "'soft'"]),
    "spring start NaN": (spring(start=(NAN, 0, 0)), ["start", "nan"]),
    "spring end short": (spring(end=(0, 4)), ["end", "(0, 4)"]),
    "input direction NaN": (source(direction=(NAN, 0, 0)), ["direction", "nan"]),
    "input direction of 4": (source(direction=(1, 0, 0, 0)), ["direction", "(1, 0, 0, 0)"]),
    "input position NaN": (source(position=(NAN, 0, 0)), ["position", "nan"]),
    "output position short": (output(position=(1, 2)), ["position", "(1, 2)"]),
    "base position NaN": (base(position=(NAN, 0, 0)), ["position", "nan"]),
    # bodies that do not exist
    "mass negative": (body(mass=-2.5), ["mass", "-2.5", "positive"]),
    "inertia negative": (body(inertia=(0.1, -0.1, 0.1)), ["inertia", "-0.1", "negative"]),
    "inertia breaks the triangle": (body(inertia=(0.1, 0.1, 0.3)), ["inertia", "0.3", "exceeds the sum"]),
    "products break the triangle": (body(inertia=(1, 1, 1, 0.9, 0, 0)), ["inertia", "0.9", "sign of the products"]),
    "products make it negative": (body(inertia=(1, 1, 2, 1.5, 0, 0)), ["inertia", "1.5", "-0.5", "negative"]),
    "inertia not symmetric": (body(inertia=ASYMMETRIC), ["inertia", "0.25", "not symmetric"]),
    # directions and kinds
    "unknown kind": (joint(kind="revolut"), ["kind", "'revolut'", "Did you mean 'revolute'?"]),
    "kind None": (joint(kind=None), ["kind", "None", "revolute"]),
    "kind a number": (joint(kind=3), ["kind", "3", "revolute"]),
    "kind and free": (joint(free=("x",)), ["'revolute'", "free"]),
    "free unknown": (joint(kind=None, free=("x", "rot")), ["free", "'rot'"]),
    "free twice": (joint(kind=None, free=("x", "x")), ["free", "once"]),
    "input direction unknown": (source(direction="xx"), ["direction", "'xx'", "x y z rx ry rz"]),
    "input direction suggested": (source(direction="RX"), ["direction", "'RX'", "Did you mean 'rx'?"]),
    "output direction unknown": (output(direction="w"), ["direction", "'w'"]),
    "output direction zero": (output(direction=(0, 0, 0)), ["direction", "not zero"]),
    "base direction zero": (base(direction=np.zeros(6)), ["direction", "not zero"]),
    "base direction unknown": (base(direction="up"), ["direction", "'up'"]),
    "force direction unknown": (force(direction="fx"), ["direction", "'fx'"]),
    "quantity unknown": (output(quantity="velocty"), ["quantity", "'velocty'", "Did you mean 'velocity'?"]),
    "axis zero": (joint(axis=(0.0, 0.0, 0.0)), ["axis", "(0.0, 0.0, 0.0)", "not zero"]),
    "axis NaN": (joint(axis=(0, NAN, 0)), ["axis", "nan"]),
    "axis short": (joint(axis=(1, 0)), ["axis", "(1, 0)"]),
    "axis and orientation": (joint(axis=(1, 0, 0), orientation=np.eye(3)), ["axis", "orientation", "give one"]),
    "universal axes parallel": (
        joint(kind="universal", axis=(1, 0, 0), axis2=(-2.5, 0, 0)), ["axis2", "-2.5", "parallel"],
    ),
    "universal axis2 zero": (joint(kind="universal", axis=(1, 0, 0), axis2=(0, 0, 0)), ["axis2", "not zero"]),
    "universal without axis2": (joint(kind="universal", axis=(1, 0, 0)), ["axis2", "None"]),
    "universal without axis": (joint(kind="universal", axis2=(1, 0, 0)), ["axis", "None"]),
    "axis2 of a revolute": (joint(axis=(1, 0, 0), axis2=(0, 1, 0)), ["axis2", "universal", "revolute"]),
    "screw without pitch": (joint(kind="screw"), ["pitch", "None", "m/rad"]),
    "screw pitch NaN": (joint(kind="screw", pitch=NAN), ["pitch", "nan"]),
    "pitch of a revolute": (joint(pitch=0.01), ["pitch", "screw", "revolute"]),
    "no position": (joint(position=None), ["position", "None"]),
    "orientation left-handed": (body(orientation=LEFT), ["orientation", "left-handed"]),
    "orientation stretched": (body(orientation=STRETCHED), ["orientation", "orthonormal"]),
    "orientation sheared": (joint(orientation=[[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]), ["orientation", "orthonormal"]),
    "orientation singular": (bushing(orientation=np.zeros((3, 3))), ["orientation", "orthonormal"]),
    "orientation NaN": (body(orientation=np.full((3, 3), NAN)), ["orientation", "nan"]),
    "orientation 2x2": (body(orientation=np.eye(2)), ["orientation", "3x3"]),
    "orientation ragged": (body(orientation=[[1, 0, 0], [0, 1, 0], [0, 0]]), ["orientation"]),
    "rotation vector NaN": (body(orientation=(0, 0, NAN)), ["orientation", "nan"]),
    "rotation vector in degrees": (body(orientation=(0, 0, 90)), ["14.3 times around", "radians, not degrees"]),
    # elements that join nothing or do nothing
    "joint with itself": (joint(second="arm"), ["'arm'", "itself"]),
    "bushing with itself": (bushing(second="arm"), ["'arm'", "itself"]),
    "spring with itself": (spring(first="hand"), ["'hand'", "itself"]),
    "output against itself": (output(relative_to="hand"), ["'hand'", "relative_to"]),
    "input against itself": (source(relative_to="hand"), ["'hand'", "relative_to"]),
    "spring without length": (spring(end=(0, 0, 0)), ["end", "(0, 0, 0)", "bushing"]),
    "spring without effect": (spring(stiffness=0.0), ["neither stiffness nor damping"]),
    "bushing without effect": (bushing(stiffness=(0,) * 6), ["neither stiffness nor damping"]),
    "bushing 6x6 without effect": (bushing(stiffness=np.zeros((6, 6))), ["neither stiffness nor damping"]),
    "bushing without position": (bushing(position=(1e3,) * 6), ["position = (1000.0, 1000.0,", "(x, y, z)"]),
    # names
    "body unknown to a joint": (joint(second="hnad"), ["second", "'hnad'", "Did you mean 'hand'?"]),
    "ground misspelt": (joint(first="Ground"), ["first", "'Ground'", "Did you mean 'ground'?"]),
    "body unknown to a bushing": (bushing(first="leg"), ["first", "'leg'"]),
    "body unknown to a spring": (spring(second="leg"), ["second", "'leg'"]),
    "body unknown to an input": (source(body="leg"), ["body", "'leg'"]),
    "body unknown to an output": (output(body="leg"), ["body", "'leg'"]),
    "reference unknown": (output(relative_to="leg"), ["relative_to", "'leg'"]),
    "body of the wrong type": (output(body=17), ["body", "17"]),
    "element unknown": (force(element="mout"), ["element", "'mout'", "Did you mean 'mount'?"]),
    "force across a line spring": (force(element="strut", direction="x"), ["direction", "'x'", "'z'"]),
    "moment in a line spring": (force(element="strut", direction=(0, 0, 1, 0, 0, 1)), ["direction", "'z'"]),
    "absolute against a body": (output(quantity="acceleration", relative_to="arm", absolute=True), ["absolute"]),
    # loads
    "bushing preload of wrong size": (bushing(preload=(1, 2, 3)), ["preload", "(1, 2, 3)", "6 values"]),
    "spring preload no number": (spring(preload="tight"), ["preload", "'tight'", "tension"]),
    "spring preload twice": (spring(preload=12.5, free_length=0.75), ["both preload and free_length"]),
    "spring preload without a line": (spring(end=(0, 0, 0), start=(0, 0, 0), preload=3.0), ["end", "no line"]),
    "spring free length negative": (spring(free_length=-0.75), ["free_length", "-0.75", "not negative"]),
    "spring free length without stiffness": (spring(stiffness=0, damping=1.0, free_length=0.7), ["needs a stiffness"]),
    "load on ground": (load(body="ground"), ["body", "'ground'", "no load moves"]),
    "load on an unknown body": (load(body="hnad"), ["'hnad'", "Did you mean 'hand'?"]),
    "load without effect": (load(force=(0, 0, 0)), ["neither force nor torque"]),
    "load follower no bool": (load(follower="yes"), ["follower", "'yes'", "True"]),
    "load force no vector": (load(force=3.0), ["force", "3.0", "three finite numbers"]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_refused_in_words(case):
    (adder, words), expected = CASES[case]
    model = arm()
    before = repr(model)
    with pytest.raises(mv.ModelError) as caught:
        getattr(model, adder)(**words)
    message = str(caught.value)
    assert f"'{words['name']}'" in message, "the element is named"
    for word in expected:
        assert word in message
    assert caught.value.field is not None
    assert caught.value.element == message.split(":")[0]
    assert message.endswith((".", "?")), message
    assert "\n" not in message
    assert len(message) < 400
    assert repr(model) == before, "a refused part leaves nothing behind"


@pytest.mark.parametrize("call", [body, joint, bushing, spring])
@pytest.mark.parametrize("taken", ["arm", "hinge", "mount", "strut"])
def test_bodies_joints_and_springs_share_their_names(call, taken):
    adder, words = call(name=taken)
    with pytest.raises(mv.ModelError, match=f"'{taken}': the name is taken by an? "):
        getattr(arm(), adder)(**words)


@pytest.mark.parametrize(("call", "taken"), [(source, "push"), (base, "shake"), (output, "sway"), (force, "tension"),
                                             (source, "shake"), (output, "tension")])  # fmt: skip
def test_ports_share_their_names_by_side(call, taken):
    adder, words = call(name=taken)
    with pytest.raises(mv.ModelError, match=f"'{taken}': the name is taken by an? "):
        getattr(arm(), adder)(**words)


def test_an_input_an_output_and_a_body_may_have_one_name():
    model = arm()
    model.add_input("hand", "hand", "x")
    model.add_output("hand", "hand", "x")
    assert (model.inputs["hand"].body, model.outputs["hand"].body) == ("hand", "hand")


@pytest.mark.parametrize("name", ["", " arm2", "arm2 ", "a\nb", "\t", None, 3, b"arm2", ("a",)])
@pytest.mark.parametrize("call", [body, joint, bushing, spring, source, output, base, force])
def test_names_that_are_no_names(call, name):
    adder, words = call(name=name)
    with pytest.raises(mv.ModelError, match="name = ") as caught:
        getattr(arm(), adder)(**words)
    assert repr(name) in str(caught.value)


@pytest.mark.parametrize("name", ["leg 1", "leg.1", "Bein-links", "bras_d'été", "脚"])
def test_names_may_hold_blanks_dots_and_letters_of_any_language(name):
    model = arm()
    adder, words = body(name=name)
    assert getattr(model, adder)(**words).name == name


def test_ground_cannot_be_added():
    adder, words = body(name="ground")
    with pytest.raises(mv.ModelError, match="'ground' is there from the start"):
        getattr(arm(), adder)(**words)


@pytest.mark.parametrize("gravity", [9.81, "down", (0, 0), (0, 0, np.nan)])
def test_gravity_that_is_no_vector(gravity):
    with pytest.raises(mv.ModelError, match=r"model: gravity = .*such as \(0, 0, -9.81\)"):
        mv.Model("m", gravity=gravity)


@pytest.mark.parametrize("name", ["", None, 5, " x"])
def test_model_names_that_are_no_names(name):
    with pytest.raises(mv.ModelError, match="name = "):
        mv.Model(name)


def test_one_root_for_all_errors():
    for error in (mv.ModelError, mv.SingularPoseError, mv.ResponseError, mv.ExportError):
        assert issubclass(error, mv.MbsvibError)
    assert issubclass(mv.ModelError, ValueError), "code that expects ValueError of bad values keeps working"


def test_a_part_of_another_model_is_no_part_of_this_one():
    other = mv.Model("other")
    stranger = other.add_body("stranger", 1.0, BOX)
    adder, words = joint(second=stranger)
    with pytest.raises(mv.ModelError, match="'stranger' is not a body of model 'robot'"):
        getattr(arm(), adder)(**words)


def test_unknown_bodies_are_told_with_those_that_are_there():
    adder, words = joint(second="arn")
    with pytest.raises(mv.ModelError, match=r"second = 'arn' is not a body .* Did you mean 'arm'\? It has ground, arm"):
        getattr(arm(), adder)(**words)


def test_verbs_of_systems_asked_of_models_and_the_reverse_are_told():
    model = arm()
    with pytest.raises(AttributeError, match=r"no attribute 'modes'; systems have it: model\.linearize\(\)\.modes"):
        model.modes()
    with pytest.raises(AttributeError, match=r"no attribute 'with_values'; models have it: .* model\.with_values"):
        mv.library.quarter_car().linearize().with_values({})
    with pytest.raises(AttributeError, match=r"no attribute 'feedback'; dense systems have it, system\.reduced\(20"):
        mv.library.chain(5).linearize(method="sparse").feedback([[1.0]])
    with pytest.raises(AttributeError, match=r"no attribute 'feedback'; its systems have it: batch\[0\]\.feedback"):
        mv.library.quarter_car().linearize(values={"body.mass": [300.0, 320.0]}).feedback([[1.0]])
    with pytest.raises(AttributeError, match=r"no attribute 'K'; systems have it: model\.linearize\(\)\.K"):
        _ = model.K
    with pytest.raises(AttributeError, match=r"no attribute 'nothing'$"):
        _ = model.nothing
    assert not hasattr(model, "modes")
    assert "modes" not in dir(model)


def test_unbalanced_bodies_that_nothing_joins_to_the_ground_are_told():
    model = mv.Model("forgotten", gravity=(0, 0, -9.81))
    model.add_body("box", 1.0, BOX)
    with pytest.raises(mv.EquilibriumError, match=r"No joint leads from body 'box' to the ground: join them"):
        model.linearize()
    model.add_joint("slide", "prismatic", "ground", "box", axis=(0, 0, 1))
    with pytest.raises(mv.EquilibriumError) as refused:
        model.linearize()
    assert "No joint leads" not in str(refused.value)


def test_messages_of_names_without_end_are_short():
    """A file can hold a name of two megabytes, which the message repeated, and more than once."""
    name = "n" * 2_000_000
    model = mv.Model("m")
    model.add_body(name, 1.0, [1.0, 1.0, 1.0])
    with pytest.raises(mv.ModelError) as caught:
        model.add_body(name, 1.0, [1.0, 1.0, 1.0])
    assert len(str(caught.value)) < 4100
    assert caught.value.element == name
    short = mv.EquilibriumError("x" * 4000, body="b")
    assert str(short) == "x" * 4000
    assert str(pickle.loads(pickle.dumps(mv.ExportError("a" * 3000 + "b" * 3000 + "end")))).endswith("bend")


@pytest.mark.parametrize(("given", "names", "told"), [
    ("Legs", ["leg"], " Did you mean 'leg'? It has leg."),
    ("z", [], " It has none."),
    (["leg"], {"axle": 1}, " It has axle."),
    ("q", [f"p{i:02}" for i in range(99)], f" It has {', '.join(f'p{i:02}' for i in range(12))}, ... (99 in all)."),
])  # fmt: skip
def test_names_that_are_none_of_those_known_are_told_the_nearest_and_which_there_are(given, names, told):
    with pytest.raises(mv.ModelError) as caught:
        known(given, names, "no such part", "parts")
    error = caught.value
    assert (str(error), error.element, error.field) == (f"no such part.{told}", str(given), "parts")
    with pytest.raises(mv.ResponseError):
        known(given, names, "no such part", error=mv.ResponseError)
    known("leg", ["leg"], "no such part")


@pytest.mark.parametrize(("given", "told"), [
    ([0.0, 2.0, 1.0], "1 behind 2 at index 2"), ([-1.0, 2.0], "-1 at index 0"), ([0.0, NAN], "nan behind 0 at index 1"),
    ([INF, INF], "inf at index 0"), (1.0, r"the shape \(\)"), ([], r"the shape \(0,\)"),
    ([[0.0, 1.0]], r"the shape \(1, 2\)"),
])  # fmt: skip
def test_numbers_that_do_not_ascend_are_told_by_the_first_that_does_not(given, told):
    with pytest.raises(mv.ResponseError, match=f"^step: t with {told}; expected times.$"):
        ascending(given, "step", "t", "times", least=0.0, count=2)
    rising = np.array([0.0, 1.0])
    result = ascending(rising, "step", "t", "times", least=0.0, count=2)
    assert result is not rising
    assert np.array_equal(result, rising)


def test_complex_numbers_without_imaginary_parts_are_real():
    gain = np.array([1.0 + 2.0j, 3.0j])
    assert reals(gain * gain.conj(), "noise", "values", "densities").tolist() == [5.0, 9.0]
