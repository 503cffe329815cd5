"""A family of elements and a kind of joint that only a test knows work everywhere, from what they state themselves."""

from dataclasses import dataclass

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements import joint_kinds, spring
from mbsvib.elements.connection import ENDS, Connection
from mbsvib.elements.families import EXPANSIONS
from mbsvib.elements.roles import number, point, stated
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.plots._scene import of_model

SIDES = ("left", "right")
OMEGA = [5.0, 30.0]


@dataclass(frozen=True, slots=True)
class Vee(Connection):
    """Two equal line springs from two points of the first body to one of the second."""

    roles = stated(**ENDS, stiffness=number("N/m"), left=point("first"), right=point("first"), tip=point("second"))

    left: tuple[float, ...]
    right: tuple[float, ...]
    tip: tuple[float, ...]
    stiffness: float


def springs(part):
    return {f"{part.name}.{side}": spring.make(f"{part.name}.{side}", part.first, part.second, getattr(part, side),
                                               part.tip, part.stiffness, 0.0) for side in SIDES}  # fmt: skip


@pytest.fixture(autouse=True)
def families(monkeypatch):
    monkeypatch.setitem(EXPANSIONS, Vee, lambda part, *_: ExpandedPart(springs=springs(part)))
    kind = joint_kinds.Kind(("x", "rz"), drawn=(0, 2))
    monkeypatch.setitem(joint_kinds.KINDS, "pin_in_slot", kind)
    monkeypatch.setitem(joint_kinds.SUBSPACES, "pin_in_slot", joint_kinds.subspaces(kind.free))


def arm(joint=None):
    """An arm on a slotted hinge, and a second one on its end."""
    model = mv.Model("arm")
    for name, x in (("upper", 0.2), ("lower", 0.6)):
        model.add_body(name, 2.0, (0.01, 0.02, 0.03), position=(x, 0, 0))
    model.add_joint("slot", joint, "ground", "upper", (0, 0, 0), free=None if joint else ("x", "rz"))
    model.add_joint("elbow", "universal", "upper", "lower", (0.4, 0, 0))
    model.add_bushing("root", "ground", "upper", (0, 0, 0), (900, 0, 0, 0, 0, 80), damping=(3, 0, 0, 0, 0, 1))
    model.add_bushing("pad", "upper", "lower", (0.4, 0, 0), (0, 0, 0, 30, 30, 0))
    model.add_input("F", "lower", "y")
    model.add_output("y", "lower", "y")
    model.add_force_output("across", "slot", "y")
    return model


def with_vee(model, in_parts=False):
    part = Vee("vee", "upper", "lower", (0.2, 0.1, 0.1), (0.2, -0.1, 0.1), (0.6, 0, 0.2), 500.0)
    return model.with_parts(springs=dict(model.springs) | (springs(part) if in_parts else {"vee": part}))


def test_an_element_that_others_replace():
    model, plain = with_vee(arm()), with_vee(arm(), in_parts=True)
    expected = plain.linearize().frequency_response(OMEGA)
    for method in ("dense", "sparse"):
        np.testing.assert_allclose(model.linearize(method=method).frequency_response(OMEGA), expected, rtol=1e-12)
    batch = model.linearize(values={"vee.stiffness": [250.0, 500.0]})
    np.testing.assert_allclose(batch[1].K, plain.linearize().K, rtol=1e-14)
    np.testing.assert_allclose(batch[0].K, model.with_values({"vee.stiffness": 250.0}).linearize().K, rtol=1e-14)
    there = [case.moved({"slot.rz": 0.3, "elbow.rx": 0.2}, relaxed=True).linearize() for case in (model, plain)]
    np.testing.assert_allclose(there[0].K, there[1].K, rtol=1e-12)
    rates = model.linearize().eigenvalue_sensitivities(["vee.stiffness"]).reshape(-1)
    ends = [model.with_values({"vee.stiffness": k}).linearize().modes().eigenvalues for k in (499.0, 501.0)]
    np.testing.assert_allclose(rates, (ends[1] - ends[0]) / 2.0, rtol=1e-5, atol=1e-9)
    assert {line.name for line in of_model(model).lines} >= {"vee"}
    model.add_force_output("in_vee", "vee", "x")
    with pytest.raises(mv.ModelError, match=r"output 'in_vee': the vee 'vee' acts by several elements"):
        model.linearize()


def test_a_kind_of_joint():
    model, custom = arm("pin_in_slot"), arm()
    expected = custom.linearize().frequency_response(OMEGA)
    for method in ("dense", "sparse"):
        np.testing.assert_allclose(model.linearize(method=method).frequency_response(OMEGA), expected, rtol=1e-12)
    motion = {"slot.x": 0.1, "slot.rz": 0.3, "elbow.rx": 0.2}
    there = [case.moved(motion, relaxed=True).linearize() for case in (model, custom)]
    np.testing.assert_allclose(there[0].K, there[1].K, rtol=1e-12)
    assert sum(line.kind == "axis" and line.name == "slot" for line in of_model(model).lines) == 2


def test_a_kind_with_successive_rotations_and_a_translation(monkeypatch):
    """As the custom joint: where it would need axes that it has not, it is refused and does not lose a direction."""
    kind = joint_kinds.Kind(("z", "rx", "ry"), successive=True)
    monkeypatch.setitem(joint_kinds.KINDS, "telescopic", kind)
    monkeypatch.setitem(joint_kinds.SUBSPACES, "telescopic", joint_kinds.subspaces(kind.free))
    for words in ({"kind": "telescopic"}, {"kind": None, "free": ("z", "rx", "ry")}):
        model = mv.Model("mast")
        model.add_body("mast", 1.0, (0.1, 0.1, 0.1), position=(0, 0, 1))
        model.add_joint("foot", first="ground", second="mast", position=(0, 0, 0), **words)
        model.add_bushing("pad", "ground", "mast", (0, 0, 0), (1,) * 6)
        assert model.moved({"foot.z": 0.2}, relaxed=True).linearize().dof == 3
        with pytest.raises(mv.ModelError, match="turned against its locked translations"):
            model.moved({"foot.rx": 0.2, "foot.ry": 0.1})
