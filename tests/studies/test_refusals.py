"""What studies refuse: each refusal names what was given and says what to do."""

import importlib.util

import pytest

import mbsvib as mv
from mbsvib import studies as st
from tests.isolation.scenes import two_masses

MASS = {"b.mass": (0.5, 2.0)}


def slide(stiffness=4.0, damping=0.0):
    model = mv.Model("slide")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    if stiffness:
        model.add_bushing("k", "ground", "b", (0, 0, 0), (0, 0, stiffness, 0, 0, 0), (0, 0, damping, 0, 0, 0))
    model.add_input("F", "b", "z")
    model.add_output("x", "b", "z")
    return model


def twice_guided():
    model = slide()
    model.add_joint("j2", "prismatic", "ground", "b", position=(1, 0, 0), axis=(0, 0, 1))
    return model


def with_mass_on_top():
    model = slide()
    model.add_body("n", 0.1, (0, 0, 0), (0, 0, 1))
    model.add_joint("jn", "prismatic", "b", "n", axis=(0, 0, 1))
    model.add_bushing("kn", "b", "n", (0, 0, 1), (0, 0, 9.0, 0, 0, 0))
    return model


def swept(of, **words):
    return st.sweep(slide(), {"b.mass": [1.0, 2.0]}, of, **words)


def lighter(low, goal=None, **words):
    """Search for the mass of the highest frequency, where there is none within the bounds."""
    return st.optimize(slide(), {"b.mass": (low, 2.0)}, -st.frequency(1) if goal is None else goal,
                       start={"b.mass": 1.0}, **words)  # fmt: skip


def beyond():
    return 1.0 / (st.variable("b.mass") - 2.0)


REFUSALS = [
    (lambda: st.placement({}), r"placement: targets = \{\}; expected a frequency \[Hz\] for each mode"),
    (lambda: st.placement([3.0]),  # type: ignore[arg-type]
     r"placement: targets = \[3\.0\]; expected a frequency \[Hz\] for each mode"),
    (lambda: st.frequency([]), r"frequency: mode = \[\]; expected numbers of modes, 1, 2, "),
    (lambda: st.optimize(slide(), MASS, -st.frequency(2)), r"mode 2 of 'slide' is asked for, which has modes 1 to 1"),
    (lambda: st.optimize(slide(0.0), MASS, -st.smallest(st.frequency())), r"'slide' has no modes but 1 rigid-body"),
    (lambda: st.frequency(1)(slide().linearize(method="sparse")), r"not of a SparseSystem; .* try it on a smaller one"),
    (lambda: st.frequency(1).between(3, 2), r"frequency of mode 1 \[Hz\]: low = 3.0; expected no more than high = 2"),
    (lambda: swept({}), r"of = \{\}; expected at least one result"),
    (lambda: swept({"p": "poles"}).plot("p"), r"'p' is not of real numbers; draw results of real numbers"),
    (lambda: st.optimize(slide(), MASS, st.rms("x", {"F": 1.0}, (0.1, 2.0))),
     r"rms: the mode of 'slide' at 0\.31831 Hz is not damped, .*; give the mechanism damping, or a band without it"),
    (lambda: st.optimize(slide(), MASS, st.peak("x", "F", (0.1, 2.0))), r"mode of 'slide' .* is not damped"),
    (lambda: st.track(with_mass_on_top(), {"n.mass": [0.0, 0.1]}), r"number of modes is not the same.*leave out what"),
    (lambda: st.track(two_masses(), {"lower.stiffness": [1e4, 2e4]}, names={"up": 1, "down": 1}),
     r"track: mode 1 has two names, 'up' and 'down'"),
    (lambda: st.tolerances(twice_guided(), {"j2.orientation.rx": 0.1}, st.frequency(1)),
     r"no derivative to 'j2\.orientation\.rx': .* Leave it out, or tie it to what moves along"),
    (lambda: lighter(-1.0), r"body 'b': mass = -[01]\.\d+; expected a positive number"),
    (lambda: lighter(-1.0, starts=2), r"optimize: none of 2 starts leads anywhere, the first: body 'b': mass = -"),
    (lambda: lighter(0.5, beyond()), r"not finite at b\.mass = 2; give bounds that keep away from there"),
    (lambda: st.optimize(slide(4.0, 1.0), {"k.damping.z": (0.0, 1.0)}, -st.rms("x", {"F": 1.0}, (0.1, 2.0))),
     r"mode of 'slide' at 0\.31831 Hz is not damped"),
]  # fmt: skip


@pytest.mark.few(4)
@pytest.mark.parametrize(("ask", "message"), REFUSALS, ids=[told[:30] for _, told in REFUSALS])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_refusals_are_told(ask, message):
    with pytest.raises(mv.MbsvibError, match=message):
        ask()


@pytest.mark.slow
def test_refusals_on_the_way_say_where():
    with pytest.raises(mv.ModelError) as refused:
        lighter(-1.0)
    (note,) = refused.value.__notes__
    assert note.startswith("at b.mass = -")
    assert str(refused.value).startswith(f"body 'b': mass = {note.rpartition(' ')[2]}"[:24])
    with pytest.raises(mv.ResponseError) as refused:
        st.optimize(slide(4.0, 1.0), {"k.damping.z": (0.0, 1.0)}, -st.rms("x", {"F": 1.0}, (0.1, 2.0)))
    (note,) = refused.value.__notes__
    assert note.startswith("at k.damping.z = ")
    assert 0.0 <= float(note.rpartition(" ")[2]) < 1e-10  # the step ends at the bound but for rounding
    with pytest.raises(mv.ModelError) as refused:
        st.tolerances(slide(), {"b.mass": 0.01}, st.frequency(2))
    assert "derivatives=False" in refused.value.__notes__[0]


def test_results_that_are_no_numbers_are_told_at_their_points():
    with pytest.warns(UserWarning, match="all 2 points failed, the first by ModelError: of: 'value' is 'text'"):
        result = swept(lambda system: "text")
    assert list(result.errors.values()) == ["ModelError: of: 'value' is 'text'; expected numbers."] * 2


def test_records_that_cannot_be_kept(tmp_path):
    with pytest.raises(mv.ModelError, match=rf"{tmp_path}: cannot be read: it is a folder"):
        swept("poles", file=tmp_path)
    with pytest.raises(mv.ModelError, match=r"record: cannot be written: No such file or directory"):
        swept("poles", file=tmp_path / "none" / "record")


def test_ipopt_says_what_to_install(monkeypatch):
    there = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *more: None if name == "casadi" else there(name))
    with pytest.raises(mv.ModelError, match=r'pip install "mbsvib\[casadi\]"'):
        st.optimize(slide(), MASS, -st.frequency(1), method="ipopt")
