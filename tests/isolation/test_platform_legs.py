"""Which chains of a mechanism are legs, what of them follows which end, and what is refused by name."""

import math

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from tests.isolation.scenes import relaxing_hexapod


def strutted(ends, base="ground", k=1e5, leg=None):
    """A payload on legs between two bodies; ``leg`` makes one of its own."""
    model = mv.Model("strutted")
    if base != "ground":
        model.add_body(base, 5.0, (0.2, 0.2, 0.3), (0, 0, -0.1))
        model.add_joint(f"{base}.table", "prismatic", "ground", base, (0, 0, -0.1), axis=(1, 0, 0))
        model.add_spring(f"{base}.drive", "ground", base, (-1, 0, -0.1), (0, 0, -0.1), 1e6)
    model.add_body("payload", 4.0, (0.05, 0.06, 0.08), (0.01, 0, 0.45))
    for i, (start, end) in enumerate(ends):
        (leg or plain)(model, f"s{i}", base, start, end, k * (1 + 0.1 * i))
    model.add_output("z", "payload", "z")
    return model


def plain(model, name, base, start, end, k):
    if "payload.free" not in model.joints:
        model.add_joint("payload.free", "free", base, "payload", (0, 0, 0))
    model.add_spring(f"{name}.k", base, "payload", start, end, k, 10.0)


def inertial(model, name, base, start, end, k):
    """A spring, an inerter parallel to it, and a torsion spring, which has no point to move."""
    plain(model, name, base, start, end, k)
    model.add_inerter(f"{name}.b", base, "payload", start, end, 0.3)
    model.add_torsion_spring(f"{name}.twist", base, "payload", (0, 0, 1), 50.0)


def relaxing(model, name, base, start, end, k):
    """Two tubes, of which one slides in the other, with a relaxation element and a flexure below."""
    start, end = np.array(start), np.array(end)
    line = (end - start) / np.linalg.norm(end - start)
    for part, position in (("tube", start + 0.1 * line), ("rod", end - 0.08 * line)):
        axes = mv.common.arguments.frame_along(tuple(line))
        model.add_body(f"{name}.{part}", 0.2, (1e-3, 1e-3, 1e-4), position, orientation=axes)
    model.add_joint(f"{name}.foot", "universal", base, f"{name}.tube", start, orientation=axes)
    model.add_joint(f"{name}.slide", "prismatic", f"{name}.tube", f"{name}.rod", axis=line)
    model.add_joint(f"{name}.head", "spherical", f"{name}.rod", "payload", end)
    model.add_bushing(f"{name}.flexure", base, f"{name}.tube", start, (0, 0, 0, 3.0, 3.0, 3.0))
    model.add_maxwell(f"{name}.damper", f"{name}.tube", f"{name}.rod", start, end, 3 * k, 100.0, k)


def flexed(model, name, base, start, end, k):
    """Flexures at both ends instead of joints, and one beside the slide; names without a common stem."""
    start, end = np.array(start), np.array(end)
    line = (end - start) / np.linalg.norm(end - start)
    axes = mv.common.arguments.frame_along(tuple(line))
    model.add_body(f"low {name}", 0.2, (1e-3, 1e-3, 1e-4), start + 0.1 * line, orientation=axes)
    model.add_body(f"high {name}", 0.2, (1e-3, 1e-3, 1e-4), end - 0.1 * line, orientation=axes)
    stiff = (8e5, 8e5, 9e5, 5.0, 5.0, 6.0)
    model.add_bushing(f"foot {name}", base, f"low {name}", start, stiff, orientation=axes)
    model.add_joint(f"slide {name}", "cylindrical", f"low {name}", f"high {name}", start + 0.1 * line, axis=line)
    model.add_bushing(f"middle {name}", f"low {name}", f"high {name}", start, (0, 0, k, 0, 0, 7.0), orientation=axes)
    model.add_bushing(f"head {name}", f"high {name}", "payload", end, stiff, orientation=axes)


def ends(radius=0.2, height=0.4, half=0.2, top=0.1, count=6):
    """Legs between two rings, in pairs."""
    result = []
    for i in range(count):
        low = 2 * math.pi * (i // 2) / (count // 2) + (-half if i % 2 == 0 else half)
        high = 2 * math.pi * (i // 2) / (count // 2) + (-0.8 if i % 2 == 0 else 0.8)
        result.append(((radius * math.cos(low), radius * math.sin(low), 0.0),
                       (top * math.cos(high), top * math.sin(high), height)))  # fmt: skip
    return result


def frequencies(model):
    return model.linearize().modes().frequencies


@pytest.mark.parametrize("base", ["ground", "table"])
@pytest.mark.parametrize("leg", [plain, inertial, relaxing, flexed])
def test_legs_of_all_kinds(leg, base):
    model = strutted(ends(), base, leg=leg)
    geometry = isolation.platform(model, "payload", base)
    assert len(geometry.legs) == 6
    assert repr(geometry).startswith("Platform(6 legs: base.radius 0.2, base.height 0, base.spread 0.2")
    assert geometry.start["base.spread"] == pytest.approx(0.2, rel=1e-13)
    at = {"base.radius": 0.23, "base.spread": 0.3, "platform.height": 0.35, "platform.radius": 0.11}
    anew = strutted(ends(0.23, 0.35, 0.3, 0.11), base, leg=leg)
    assert np.allclose(frequencies(model.with_values(geometry.values(at))), frequencies(anew), rtol=1e-10)


def test_what_is_between_the_ends_keeps_its_share():
    # the massless node of an unfolded relaxation element hangs between both tubes
    model = isolation.unfolded(strutted(ends(), leg=relaxing))
    geometry = isolation.platform(model, "payload")
    leg = geometry.legs[0]
    assert leg.shares["s0.tube.position"] == leg.shares["s0.flexure.position"] == 0.0
    assert leg.shares["s0.rod.position"] == leg.shares["s0.damper.damper.end"] == 1.0
    assert leg.shares["s0.damper.node.position"] == pytest.approx(0.5, rel=1e-14)
    assert leg.shares["s0.damper.spring.end"] == leg.shares["s0.damper.node.position"]
    at = {"base.radius": 0.23, "platform.height": 0.35}
    anew = isolation.unfolded(strutted(ends(0.23, 0.35), leg=relaxing))
    assert np.allclose(frequencies(model.with_values(geometry.values(at))), frequencies(anew), rtol=1e-10)


def test_legs_without_bodies_agree_with_linear_rings():
    model = library.cubic_hexapod()
    geometry, ring = isolation.platform(model, "platform"), isolation.ring(model, "end")
    by = {"platform.radius": ("end.radius", 0.01), "platform.height": ("end.height", -0.02)}
    for name, (linear, step) in by.items():
        result = geometry.values({name: geometry.start[name] + step})
        for parameter, rate in ring[linear].items():
            assert result[parameter] == pytest.approx(model.parameters[parameter] + rate * step, rel=1e-13, abs=1e-15)
    # what is side by side is one leg, also where only a part of it is named
    unfolded = isolation.unfolded(relaxing_hexapod())
    for legs in (None, "*.static", "*.node"):
        relaxed = isolation.platform(unfolded, "platform", legs=legs)
        assert len(relaxed.legs) == 6
        points = {"leg1.k.static.start", "leg1.k.node.position", "leg1.k.damper.end", "leg1.k.guide.position"}
        assert points <= set(relaxed.legs[0].points)
        assert relaxed.start == pytest.approx(geometry.start, rel=1e-13)


def test_rods_are_legs():
    model = strutted(ends()[:2], leg=plain)
    model.add_joint("rod", "distance", "ground", "payload", (0.2, 0.3, 0), end=(0.1, 0.2, 0.4))
    geometry = isolation.platform(model, "payload", legs=["rod", "s0.k"])
    assert [leg.name for leg in geometry.legs] == ["rod", "s0.k"]
    result = geometry.values({"platform.height": 0.5})
    assert result["rod.end.z"] == pytest.approx(0.5, rel=1e-15)
    assert result["rod.position.z"] == 0.0


def test_rods_within_legs_keep_their_length():
    """A rod from the ground to a node, from which a spring leads on: the node goes with the lower end."""
    model, start, node, end = strutted(ends()[:2], leg=plain), (0.2, 0.3, 0), (0.175, 0.275, 0.1), (0.1, 0.2, 0.4)
    model.add_body("node", 0.1, (1e-4, 1e-4, 1e-4), node)
    model.add_joint("rod", "distance", "ground", "node", start, end=node)
    model.add_spring("rest", "node", "payload", node, end, 1e4)
    geometry = isolation.platform(model, "payload", legs=["rod", "s0.k"])
    at = {"platform.height": 0.5, "base.radius": 1.1 * geometry.start["base.radius"]}
    changed = model.with_values(geometry.values(at))
    rod = changed.joints["rod"]
    assert np.linalg.norm(np.subtract(rod.end, rod.position)) == pytest.approx(
        np.linalg.norm(np.subtract(node, start)), rel=1e-13)
    assert changed.springs["rest"].end[2] == pytest.approx(0.5)


def test_pairs_are_nearest_neighbours_and_lines_at_one_place_do_not_cross():
    for half in (0.2, 0.0, -0.2):
        side = isolation.platform(strutted(ends(half=half)), "payload").rings["base"].side
        assert (side == (np.array([-1, 1] * 3) if half >= 0.0 else np.array([1, -1] * 3))).all()
    lone = isolation.platform(strutted(ends()[:3]), "payload")
    assert "base.spread" not in lone.start  # three legs make no pairs
    with pytest.raises(mv.ModelError, match=r"no variable 'base\.spread'"):
        lone.values({"base.spread": 0.1})


def test_another_axis():
    model = strutted(ends())
    lying = strutted([tuple((z + 1.0, x, y) for x, y, z in pair) for pair in ends()])
    up, flat = (isolation.platform(m, "payload", **words) for m, words in (
        (model, {"centre": (0, 0, -1.0)}), (lying, {"axis": (2, 0, 0)})))  # fmt: skip
    assert flat.start == pytest.approx(up.start, rel=1e-13, abs=1e-13)
    at = {"base.radius": 0.25, "platform.angle": 0.1, "base.height": 1.1}
    first, second = up.values(at), flat.values(at)
    assert second["s3.k.start.x"] == pytest.approx(first["s3.k.start.z"] + 1.0, rel=1e-13)
    assert second["s3.k.end.y"] == pytest.approx(first["s3.k.end.x"], rel=1e-13)


def bent():
    model = library.stewart(ports="none")
    return model.replace("leg2.slide", axis=(0, 0.1, 1))


def spread_out():
    model = library.stewart(ports="none")
    model.add_spring("leg3.second", "ground", "leg3.lower", (0.5, 0.5, 0), (0, 0, 0), 1.0)
    return model


def welded():
    return library.stewart(ports="none").replace("leg4.slide", kind="revolute")


def tethered():
    model = strutted(ends(), "table", leg=relaxing)
    model.add_bushing("tether", "ground", "s2.tube", (0, 0, 0), (1.0,) * 6)
    return model


def with_part(adder, *words, **others):
    model = library.stewart(ports="none")
    getattr(model, f"add_{adder}")(*words, **others)
    return model


def held_by(node, at):
    """A leg whose one body is held at both ends where it is."""
    model = library.stewart(ports="none")
    if node == "dot":
        model.add_body("dot", 1.0, (1, 1, 1), at)
    else:
        model.add_beam("tube", None, None, {"type": "circle", "radius": 0.01}, {"E": 2e11, "rho": 7800, "nu": 0.3},
                       start=at, end=(0.3, 0, 0.02), elements=1)  # fmt: skip
    model.add_joint("low", "spherical", "ground", node, at)
    model.add_spring("high", node, "platform", at, (0.05, 0, 0.07), 1.0)
    return model if node != "dot" else model.replace("high", start=(0, 0, 0), end=at)


def hanging():
    model = library.stewart(ports="none")
    model.add_body("pendulum", 1.0, (1, 1, 1), (0, 0, -1))
    model.add_joint("pivot", "spherical", "ground", "pendulum", (0, 0, 0))
    return model


def pole():
    model = library.stewart(ports="none")
    model.add_spring("pole", "ground", "platform", (0, 0, 0), (0, 0, 0.1), 1.0)
    return model


def nowhere():
    model = strutted(ends(), leg=relaxing)
    return model.replace("s1.head", kind="prismatic", position=None, axis=np.array(model.joints["s1.slide"].axis))


@pytest.mark.parametrize(
    ("make", "words", "message"),
    [
        (library.stewart, {"body": "platfrom"}, "Did you mean 'platform'"),
        (library.stewart, {"base": "floor"}, "base = 'floor'; expected a body"),
        (library.stewart, {"base": "platform"}, "body and base are both 'platform'"),
        (library.stewart, {"axis": (0, 0, 0)}, "axis"),
        (library.stewart, {"centre": (0, 0)}, "centre"),
        (library.stewart, {"legs": "leg9*"}, r"no part of a leg is named 'leg9\*'"),
        (library.quarter_car, {"body": "body", "base": "ground"}, "no leg leads from 'ground' to 'body'|leg"),
        (bent, {}, "leg 'leg2': 'leg2.slide' slides along .* not the line from end to end"),
        (spread_out, {}, "leg 'leg3': 'ground' holds it at two points, .* 'leg3.foot' and .* by 'leg3.second'"),
        (welded, {}, "leg 'leg4': its body 'leg4.lower' goes with both ends"),
        (tethered, {"body": "payload", "base": "table", "legs": "s2.rod"}, "leg '.*': it is held by the ground too"),
        (hanging, {"legs": ["leg*.k", "pendulum"]}, "leg 'pendulum': it does not reach 'platform'"),
        (pole, {}, "end of leg 'pole' on the base is on the axis"),
        (lambda: held_by("dot", (0.1, 0, 0.02)), {}, r"leg 'dot': it has no length, .* at \(0\.1, 0, 0\.02\) m"),
        (lambda: held_by("tube.0", (0.1, 0, 0.02)), {}, r"'tube\.0' belongs to a beam or superelement"),
        (lambda: with_part("body", "alone", 1.0, (1, 1, 1)), {"body": "alone"}, "no leg leads from 'ground' to 'a"),
        (nowhere, {"body": "payload"}, "joint 's1.head' has no position"),
        (lambda: with_part("load", "push", "leg1.upper", (1, 0, 0)), {}, "'push' on its body 'leg1.upper' keeps"),
        (lambda: with_part("rotor", "gyro", "leg1.upper", 1.0, (1, 0, 0), 1.0), {}, "'gyro' on its body"),
    ],
)
def test_what_is_no_leg_is_refused(make, words, message):
    with pytest.raises(mv.ModelError, match=message):
        isolation.platform(make(), **({"body": "platform"} | words))


def test_free_lengths_and_legs_of_no_length_are_refused():
    model = library.stewart(ports="none")
    spring = model.springs["leg5.k"]
    loaded = model.replace("leg5.k", free_length=math.dist(spring.start, spring.end))
    with pytest.raises(mv.ModelError, match=r"spring 'leg5\.k' has a free length"):
        isolation.platform(loaded, "platform")
    geometry = isolation.platform(strutted(ends()), "payload")
    with pytest.raises(mv.ModelError, match=r"base\.radius leaves the end of leg 's\d\.k' at -0\.05 m"):
        geometry.values({"base.radius": -0.05})
    both = strutted([((0.1, 0, 0), (0.1, 0, 0.2)), ((0, 0.1, 0), (0, 0.1, 0.3))])
    geometry = isolation.platform(both, "payload")
    low = geometry.start["platform.height"] - 0.2
    with pytest.raises(mv.ModelError, match=r"leg 's0\.k' has no length where platform\.height = 0\.05"):
        geometry.values({"platform.height": low})
    with pytest.raises(mv.ModelError, match=r"leg 's0\.k' has been turned end for end where platform\.height = "):
        geometry.rates({"platform.height": low - 0.05})
    with pytest.raises(mv.ModelError, match=r"has no length where platform\.height = 0\.05"):
        geometry.values({"platform.height": np.array([0.2, low])})
    with pytest.raises(mv.ModelError, match="finite number"):
        geometry.values({"platform.height": math.nan})
    with pytest.raises(mv.ModelError, match=r"Did you mean 'platform\.height'"):
        geometry.rates({"platform.heigth": 0.1})


def test_ports_along_legs_are_warned_of():
    with pytest.warns(UserWarning, match=r"stay where they are, leg1\.f, leg2\.f, leg3\.f, leg4\.f, \.\.\.; leave"):
        isolation.platform(library.stewart(ports="legs"), "platform")
    with pytest.warns(UserWarning, match=r"leg1\.f"):  # no bodies, but a point of a leg
        isolation.platform(library.cubic_hexapod(ports="legs"), "platform")
    isolation.platform(library.stewart(ports=("platform", "base")), "platform")
