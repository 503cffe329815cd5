"""What the tab key completes: names for users, each with words, and none of the engine."""

import inspect
from functools import cached_property

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, plots, studies
from mbsvib.api.elsewhere import Elsewhere
from mbsvib.common.display import completed_names
from tests.test_display import RESULTS

# Words of the engine that no completion may list.
ENGINE = {
    "MOST", "basis", "declared_parts", "derived", "expansion", "far", "gathered", "inertia_factor", "judged", "law",
    "null_inertia", "provenance", "realized", "returned", "row_owner", "solver", "scene", "selection",
    "suspects", "tableau", "wrenches",
}  # fmt: skip


def described(kind, name):
    """Whether a method or property has words; fields have theirs in the reference, which another test compares."""
    item = inspect.getattr_static(kind, name, None)
    if isinstance(item, (staticmethod, classmethod)):
        item = item.__func__
    if isinstance(item, (property, cached_property)) or inspect.isfunction(item):
        return bool(item.__doc__)
    return True


@pytest.fixture(scope="module")
def objects():
    model = mv.library.stewart_isolator()
    system = model.linearize()
    omega = np.linspace(1.0, 100.0, 30)
    loop = system.feedback([[-1.0]], "x", "Fx")
    hexapod = mv.library.cubic_hexapod(damping=2.0)
    study, active = isolation.study(hexapod, "platform"), isolation.actuated(hexapod, "platform")
    closed = active.with_gains(isolation.force_feedback(active, 600.0))
    stiffness = {"leg1.k.stiffness": [1e4, 2e4]}
    uncertain = system.uncertain({"leg1.k.stiffness": 0.1})
    return [
        model, system, system.state_space(), system.modes(), model.linearize(values=stiffness), loop, loop.margins(),
        study, mv.library.chain(50).linearize(method="sparse"), closed, closed.sampled(rate=1e4), active,
        study.under({"x y z": [(1.0, 1e-6), (10.0, 1e-4)]}), isolation.passive(hexapod, "platform"),
        mv.Measurement(omega, system.frequency_response(omega), system.outputs, system.inputs),
        mv.MeasuredModes([1.0, 2.0]),
        model.compile(["leg1.k.stiffness"]), system.budget({"Fx": isolation.white(1e-6)}), uncertain,
        uncertain.worst_gain("x", "Fx"), system.hinf_norm("x", "Fx"), system["x", "Fx"].step_info(),
        mv.sweep(model, stiffness, "modes.frequencies"), mv.tunable.gain(["x"], ["Fx"]), mv.goals.hinf("x", "Fx"),
        mv.tolerances(model, {"leg1.k.stiffness": "10 %"}, studies.frequency(), samples=20),
        mv.compare(model, model),
        *model.springs.values(), *model.joints.values(), *model.bodies.values(),
    ]  # fmt: skip


def test_completions_have_words_and_no_names_of_the_engine(objects):
    for value in objects:
        names = [name for name in dir(value) if not name.startswith("_")]
        kind = type(value)
        assert not ENGINE & set(names), f"{kind.__name__}: {sorted(ENGINE & set(names))}"
        assert [name for name in names if not described(kind, name)] == [], kind.__name__


def public_names(kind):
    """What completions list of objects of a class: names of classes and fields, without those of other classes."""
    hidden = " ".join([vars(one).get("_engine", "") for one in kind.__mro__]).split()
    own = [one for one in kind.__mro__ if one.__module__.startswith("mbsvib")]
    names = {name for one in own for name in (*vars(one), *getattr(one, "__dataclass_fields__", ()))}
    return sorted(name for name in names if not name.startswith("_") and name not in hidden
                  and not isinstance(inspect.getattr_static(kind, name, None), Elsewhere))  # fmt: skip


def test_names_of_all_results_have_words_and_are_none_of_the_engine():
    walked = {f"{name}.{word}": (kind, word) for name, kind in RESULTS.items() for word in public_names(kind)}
    assert len(walked) > 1000
    assert [name for name, (_, word) in walked.items() if word in ENGINE] == []
    assert [name for name, (kind, word) in walked.items() if not described(kind, word)] == []


def test_names_of_the_engine_exist(objects):
    """A name that is hidden and no longer there would stay in the list for ever."""
    for value in objects:
        for kind in type(value).__mro__:
            for name in vars(kind).get("_engine", "").split():
                assert any(hasattr(one, name) for one in objects if isinstance(one, kind)), f"{kind.__name__}.{name}"
        assert set(completed_names(value)) < set(object.__dir__(value)) or not vars(type(value)).get("_engine")


@pytest.mark.parametrize("module", [mv, mv.tunable, mv.goals, studies, isolation, plots, mv.library, mv.report])
def test_modules_list_their_public_names(module):
    assert sorted(dir(module)) == sorted(module.__all__)


@pytest.mark.parametrize("close", [lambda system: system, lambda system: system.feedback([[-1.0]], "travel", "road"),
                                   lambda system: system.state_space()])  # fmt: skip
def test_brackets_complete_names_of_signals(close):
    system = close(mv.library.quarter_car().linearize())
    completions = system._ipython_key_completions_()
    assert len(completions) == len(system.outputs) * len(system.inputs)
    for output, port in completions:
        assert (system[output, port].outputs, system[output, port].inputs) == ((output,), (port,))
