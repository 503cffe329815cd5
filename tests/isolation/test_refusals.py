"""What studies of isolation refuse: each refusal names what was given and says what to do."""

import sys
import warnings
from types import ModuleType

import pytest

import mbsvib as mv
from mbsvib import isolation, studies
from tests.isolation.scenes import active_strut, one_axis, two_masses
from tests.superelements.craig_bampton import NODES, reduced


def held(stiffness=None, damping=0.0):
    """A payload on a guide, welded to it or on a bushing."""
    model = mv.Model("shelf")
    model.add_body("payload", 1.0, (1, 1, 1), (0, 0, 0.3))
    if stiffness is None:
        model.add_joint("weld", "fixed", "ground", "payload")
        return model
    model.add_joint("guide", "prismatic", "ground", "payload", axis=(0, 0, 1))
    if stiffness or damping:
        model.add_bushing("k", "ground", "payload", (0, 0, 0), (0, 0, stiffness, 0, 0, 0), (0, 0, damping, 0, 0, 0))
    return model


def plant(along=None, stiffness=100.0):
    """An active strut; beside it on a spring, or on its payload, a mass that slides."""
    model = active_strut(damping=20.0)
    if along is not None:
        model.add_body("side", 1.0, (1, 1, 1), (0, 0, 1))
        model.add_joint("rail", "prismatic", along, "side", axis=(1, 0, 0))
        if along == "ground":
            model.add_spring("k", "ground", "side", (1, 0, 1), (0, 0, 1), stiffness)
    return isolation.actuated(model, "payload", legs=["leg"])


def closed():
    return plant().with_gains(isolation.velocity_feedback(plant(), 10.0))


def under(model):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.errors.UnstableWarning)
        return isolation.study(model, "payload", frequencies=[1.0, 2.0]).under({"z": 1.0})


def front():
    goal = isolation.passive(two_masses(), "payload")
    return goal.front({"lower.stiffness": (1e4, 1e5)}, -studies.frequency(1), studies.frequency(), [1000.0])


REFUSALS = [
    (lambda: isolation.passive(one_axis(), "payload", joints=3),  # type: ignore[arg-type]
     "passive: joints = 3; expected a name, or a list"),
    (lambda: isolation.platform(one_axis(), "payload", legs=[3]),  # type: ignore[list-item]
     r"platform: legs = \[3\]; expected a name"),
    (lambda: isolation.struts(one_axis(), "payload", 3),  # type: ignore[arg-type]
     "struts: legs = 3; expected a name, or a list"),
    (lambda: isolation.force_feedback_optimum(1.0, 2.0), "pole = 1, zero = 2 rad/s; expected 0 < zero < pole"),
    (lambda: closed().state_space("diagonal"), r"state_space: realization = 'diagonal'; expected 'physical', 'modal'"),
    (lambda: isolation.velocity_feedback(plant(), "strong"), r"velocity_feedback: gain = 'strong'; .*each of 1 leg"),
    (lambda: isolation.study(held(), "payload"), r"nothing vibrates, .*; give frequencies \[Hz\]"),
    (lambda: isolation.study(held(0.0), "payload"), r"nothing vibrates, .*; give frequencies \[Hz\]"),
    (lambda: under(held(-10.0, 1.0)).rms, r"rms: 'shelf' is not stable.*Add stiffness or damping"),
    (lambda: under(one_axis(-0.1)).rms, r"rms: 'one axis' is not stable.*Add stiffness or damping"),
    (lambda: isolation.white("loud"),  # type: ignore[arg-type]
     r"white noise: level = 'loud'; expected a density"),
    (lambda: isolation.shaped([5], [1, 5], level="loud"),  # type: ignore[arg-type]
     r"shaped noise: level = 'loud'; expected a density"),
    (lambda: isolation.passive(held(0.0), "payload").stroke({"z": 1.0}), r"model 'shelf' has no leg, spring or damper"),
    (front, r"front: 'all frequencies \[Hz\]' has 2 numbers; expected one, as largest\(\) makes"),
    (lambda: isolation.actuated(two_masses(), "payload", base="stage", legs=["lower"]),
     r"leg 'lower' is below the base 'stage'; choose legs above it"),
    (lambda: isolation.skyhook(plant("payload"), 0.1, coordinates="modal"),
     r"active: 'strut' has motions that no spring holds; .* needs a static stiffness"),
    (lambda: isolation.lqg(one_axis().linearize(), "leg.stroke", 1e-4), "lqg: plant = System; expected a plant with a"),
    (lambda: isolation.root_locus(one_axis(), None, [0.0, 1.0]),  # type: ignore[arg-type]
     "root_locus: plant = Model; expected a plant"),
    (lambda: isolation.collocation(one_axis()), "collocation: plant = Model; expected a plant with actuators"),
    (lambda: isolation.collocation(plant(), ("leg.actuator", "leg.rate")),  # type: ignore[arg-type]
     r"pairs = \('leg.actuator', 'leg.rate'\); expected one or more pairs of names"),
    (lambda: isolation.collocation(plant(), [("leg.actuator", "leg.*")]), "picks 1 actuator and 4 sensors; expe"),
    (lambda: isolation.placement(one_axis(), ["x"]), "placement: system = Model 'one axis'; expected a System"),
    *[(lambda k=k: isolation.lqg(plant("ground", k), ["leg.stroke"], 1e-4),
       r"lqg: no stabilising controller.*out of reach of the act") for k in (1e-3, 1e-1, 1e2, 1e4)],
]  # fmt: skip


@pytest.mark.parametrize(("ask", "message"), REFUSALS, ids=[told[:30] for _, told in REFUSALS])
def test_refusals_are_told(ask, message):
    with pytest.raises(mv.MbsvibError, match=message):
        ask()


def test_figures_of_what_is_not_stable_come_with_a_word():
    """m s^2 - k: transmissibility and compliance were printed as those of any isolator."""
    with pytest.warns(mv.errors.UnstableWarning, match=r"isolation: 'shelf' is not stable: the pole 5 1/s grows"):
        study = isolation.study(held(-25.0), "payload", frequencies=[1.0, 2.0])
    assert study.table()["notes"][-1].startswith("Unstable: 'shelf' is not stable: the pole 5 1/s grows")
    with pytest.raises(mv.ResponseError, match="psd: 'shelf' is not stable: the pole 5 1/s grows, so that no density"):
        study.scene.system.psd("acceleration.z", {"base.z": 1.0}, [1.0])


def test_hinf_without_a_law(monkeypatch):
    slicot = ModuleType("ctrlsys")
    slicot.sb10fd = lambda *_: (*[None] * 5, 7)
    monkeypatch.setitem(sys.modules, "ctrlsys", slicot)
    with pytest.raises(mv.ResponseError, match=r"hinf: effort = 0.0; expected a positive number"):
        isolation.hinf(plant(), ["leg.rate"], 0.0)
    with pytest.raises(mv.ResponseError, match="hinf: no controller was found by SLICOT's SB10FD"):
        isolation.hinf(plant(), ["leg.rate"], 1.0)


def test_a_base_whose_name_is_within_others_takes_the_place_of_the_ground():
    """A reduced pipe on the payload; a base called 'b' was said to be tied to it."""
    mass, stiffness = reduced(2)
    model = mv.Model("pipes")
    model.add_body("b", 5.0, (1, 1, 1), (0, 0, -1))
    model.add_bushing("mount", "ground", "b", (0, 0, -1), (1e5,) * 6)
    model.add_body("payload", 2.0, (1, 1, 1), (1, 0, 0))
    model.add_bushing("iso", "b", "payload", (1, 0, -0.5), (1e4,) * 6, (1,) * 6)
    ends = {"left": NODES[0], "right": NODES[-1]}
    model.add_superelement("pipe", mass, None, stiffness, ends, bodies={"left": "payload"})
    assert len(isolation.study(model, "payload", "b", frequencies=[1.0, 2.0]).frequencies) == 2
    tied = model.replace("pipe", bodies={"left": "b"})
    with pytest.raises(mv.ModelError, match="'pipe' is tied to 'b'"):
        isolation.study(tied, "payload", "b", frequencies=[1.0, 2.0])
