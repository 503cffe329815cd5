"""Geometry of platforms: legs follow their ends, exact rates, the same mechanism as one that is built anew."""

import math
import pickle

import mpmath as mp
import numpy as np
import pytest

from mbsvib import isolation, library, studies
from mbsvib.errors import ModelError
from mbsvib.isolation.platform import ring_of
from mbsvib.studies.design import design
from tests.isolation.scenes import stiff_isolator

SHAPE = {"base.radius": 0.13, "base.height": 0.01, "base.spread": math.radians(15), "platform.radius": 0.07,
         "platform.height": 0.09, "platform.spread": math.radians(4)}  # fmt: skip
LEGS, CM = {"leg*.k.stiffness": 2e6, "leg*.k.damping": 40.0}, "platform.position.z"
EVERY = SHAPE | {"base.angle": 0.05, "platform.angle": -0.1}
FLOOR = {"x y z": [(1.0, 1e-6), (10.0, 1e-5), (200.0, 1e-5), (1000.0, 1e-7)]}


def built(make=library.stewart, **v):
    """A platform from the library with the variables' geometry."""
    v = {"base.angle": 0.0, "platform.angle": 0.0} | {name.replace("_", "."): value for name, value in v.items()}
    side = np.array([-1, 1] * 3)
    low = np.radians([0, 0, 120, 120, 240, 240]) + side * v["base.spread"] + v["base.angle"]
    high = np.radians([-60, 60, 60, 180, 180, -60]) - side * v["platform.spread"] + v["platform.angle"]
    return make(ports="none", base_radius=v["base.radius"], platform_radius=v["platform.radius"], base_angles=low,
                platform_height=v["platform.height"], base_height=v["base.height"], platform_angles=high,
                leg_stiffness=v.get("leg*.k.stiffness", 20e6), leg_damping=v.get("leg*.k.damping", 20.0),
                payload_height=v.get(CM, 0.085))  # fmt: skip


def stewart():
    return library.stewart(ports="none")


@pytest.mark.parametrize("make", [library.stewart, stiff_isolator])
@pytest.mark.parametrize("shape", [EVERY, {"base.radius": 0.1151, "platform.spread": 0.3}])
def test_the_same_mechanism_as_one_built_anew(make, shape):
    model = make(ports="none")
    geometry = isolation.platform(model, "platform")
    moved = model.with_values(geometry.values(shape)).linearize()
    anew = built(make, **(dict(geometry.start) | shape)).linearize()
    modes, exact = moved.modes(), anew.modes()
    assert np.allclose(modes.frequencies, exact.frequencies, rtol=1e-10)
    assert np.allclose(modes.damping_ratios, exact.damping_ratios, rtol=1e-9)
    assert len(modes.frequencies) == (6 if make is library.stewart else 12)
    # loops close as they did: nothing is redundant, nothing carries a load
    assert moved.redundant == model.linearize().redundant == ()
    springs = model.with_values(geometry.values(shape)).springs.values()
    assert all(getattr(spring, "preload", None) is None for spring in springs)


def test_where_it_starts_the_model_is_as_given():
    model = stewart()
    geometry = isolation.platform(model, "platform")
    assert geometry.start == pytest.approx({
        "base.radius": 0.115, "base.height": 0.015, "base.spread": math.radians(10), "base.angle": 0.0,
        "platform.radius": 0.09, "platform.height": 0.075, "platform.spread": math.radians(10), "platform.angle": 0.0,
    }, rel=1e-14, abs=0.0)  # fmt: skip
    assert [leg.name for leg in geometry.legs] == [f"leg{i}" for i in range(1, 7)]
    for values in (geometry.values({}), geometry.values(geometry.start)):
        assert values == {name: model.parameters[name] for name in values}
    assert pickle.loads(pickle.dumps(geometry)).values(SHAPE) == geometry.values(SHAPE)


def test_parts_of_a_leg_keep_their_places():
    model = stewart()
    moved = model.with_values(isolation.platform(model, "platform").values(EVERY))
    for i in range(1, 7):
        leg, was = ({name: np.array(value) for name, value in (
            ("foot", m.joints[f"leg{i}.foot"].position), ("head", m.joints[f"leg{i}.head"].position),
            ("start", m.springs[f"leg{i}.k"].start), ("end", m.springs[f"leg{i}.k"].end),
            ("lower", m.bodies[f"leg{i}.lower"].position), ("upper", m.bodies[f"leg{i}.upper"].position))}
            for m in (moved, model))  # fmt: skip
        along = (leg["head"] - leg["foot"]) / np.linalg.norm(leg["head"] - leg["foot"])
        assert np.allclose(leg["start"], leg["foot"], atol=1e-16)
        assert np.allclose(leg["end"], leg["head"], atol=1e-16)
        assert np.allclose(leg["lower"], leg["foot"] + 0.025 * along, atol=1e-15)
        assert np.allclose(leg["upper"], leg["head"] - 0.025 * along, atol=1e-15)
        assert np.allclose(np.array(moved.joints[f"leg{i}.slide"].axes)[:, 2], along, atol=1e-15)
        assert not np.allclose(leg["foot"], was["foot"], atol=1e-3)
        # least rotation: none about the leg
        turn = np.array(moved.bodies[f"leg{i}.lower"].orientation)
        old = (was["head"] - was["foot"]) / np.linalg.norm(was["head"] - was["foot"])
        assert np.allclose(turn @ old, along, atol=1e-15)
        assert np.trace(turn) == pytest.approx(1 + 2 * old @ along, rel=1e-14)


def exactly(geometry, at):
    """All parameters to fifty digits, by angle and axis: written anew, not with the products of the program."""
    points, turns = {}, {}
    start = {k: mp.mpf(x) for k, x in geometry.start.items()}
    v = start | {k: mp.mpf(x) for k, x in at.items()}
    for i, leg in enumerate(geometry.legs):
        ends = []
        for which, old in (("base", leg.start), ("platform", leg.end)):
            x, y, z = (mp.mpf(float(c)) for c in old)
            side = int(geometry.rings[which].side[i])
            r = mp.sqrt(x * x + y * y) + v[f"{which}.radius"] - start[f"{which}.radius"]
            a = mp.atan2(y, x) + side * (v[f"{which}.spread"] - start[f"{which}.spread"]) + v[f"{which}.angle"]
            z += v[f"{which}.height"] - start[f"{which}.height"]
            ends.append((mp.matrix([mp.mpf(float(c)) for c in old]), mp.matrix([r * mp.cos(a), r * mp.sin(a), z])))
        (a0, a1), (b0, b1) = ends
        l0, l1 = mp.norm(b0 - a0), mp.norm(b1 - a1)
        u0, u1 = (b0 - a0) / l0, (b1 - a1) / l1
        axis = mp.matrix([u0[1] * u1[2] - u0[2] * u1[1], u0[2] * u1[0] - u0[0] * u1[2], u0[0] * u1[1] - u0[1] * u1[0]])
        sine, cosine = mp.norm(axis), sum(p * q for p, q in zip(u0, u1, strict=True))
        w = axis * (mp.atan2(sine, cosine) / sine) if sine else axis
        spin = mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        angle = mp.norm(w)
        turn = mp.eye(3) + mp.sinc(angle) * spin + mp.sinc(angle / 2) ** 2 / 2 * spin * spin
        for stem, point in leg.points.items():
            p = a1 + turn * (mp.matrix([mp.mpf(float(c)) for c in point]) - a0)
            p += mp.mpf(leg.shares[stem]) * (l1 - l0) * u1
            points |= {f"{stem}.{c}": p[j] for j, c in enumerate("xyz")}
        for stem in leg.orientations:
            turns |= {f"{stem}.{c}": w[j] for j, c in enumerate(("rx", "ry", "rz"))}
    return points | turns


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 1e-5, 1.0])
def test_values_and_rates_to_fifty_digits(share):
    model = stewart()
    geometry = isolation.platform(model, "platform")
    at = {name: value + share * (EVERY[name] - value) for name, value in geometry.start.items()}
    values, rates = geometry.values(at), geometry.rates(at)
    assert list(rates) == list(at)
    with mp.workdps(50):
        exact = exactly(geometry, at)
        assert list(exact) == list(values)
        assert max(abs(float(exact[name] - value)) for name, value in values.items()) < 1e-15
        h = mp.mpf(10) ** -17
        for variable in at:
            up, down = (exactly(geometry, at | {variable: mp.mpf(at[variable]) + s * h}) for s in (1, -1))
            for name in values:
                assert rates[variable].get(name, 0.0) == pytest.approx(
                    float((up[name] - down[name]) / (2 * h)), rel=1e-10, abs=1e-12
                ), (variable, name)


def test_arrays_of_values_at_once():
    geometry = isolation.platform(stewart(), "platform")
    columns = {"base.radius": np.array([0.1, 0.115, 0.2]), "platform.spread": np.array([0.1, 0.2, 0.3])}
    result = geometry.values(columns)
    for i in range(3):
        single = geometry.values({name: float(column[i]) for name, column in columns.items()})
        assert all(result[name][i] == pytest.approx(value, rel=1e-14, abs=1e-16) for name, value in single.items())


def test_sweep_of_geometry():
    swept = studies.sweep(stewart(), {"platform.radius": [0.07, 0.08], "base.angle": 0.05}, "modes.frequencies",
                          ties=isolation.platform(stewart(), "platform").ties)  # fmt: skip
    start = dict(isolation.platform(stewart(), "platform").start)
    for radius, result in zip([0.07, 0.08], swept["modes.frequencies"].reshape(2, 6), strict=True):
        anew = built(**(start | {"platform.radius": radius, "base.angle": 0.05}))
        assert np.allclose(result, anew.linearize().modes().frequencies, rtol=1e-10)


@pytest.mark.slow
def test_tolerances_and_fronts_of_geometry():
    model = stewart()
    geometry = isolation.platform(model, "platform")
    off = studies.tolerances(model, {"base.radius": "1 %", "platform.height": 1e-4}, samples=5, ties=geometry.ties)
    slope = studies.frequency(1).gradient(model.linearize(), design(model, ["base.radius"], geometry.ties).rates(
        geometry.start))[0, 0]  # fmt: skip
    assert off.worst[0] >= abs(slope) * 0.01 * 0.115
    goal = isolation.passive(model, "platform")
    sag = goal.sag(load=1.0)
    bounds = sag(goal.scene.system) * np.array([1.05, 1.005])
    front = goal.front({"platform.radius": (0.03, 0.12)}, goal.compliance(), sag, bounds, ties=geometry.ties)
    assert all(item.success for item in front.designs)
    assert (front.price <= bounds * (1 + 1e-6)).all()
    # what was found is another model: variables of the old one would turn its legs twice
    with pytest.raises(ModelError, match="make the tie for this model"):
        isolation.passive(front.designs[0].model, "platform").optimize(
            {"base.radius": (0.1, 0.2)}, goal.compliance(), ties=geometry.ties
        )


@pytest.mark.slow
def test_gradients_against_models_built_anew():
    model = built(**(EVERY | LEGS))
    goal = isolation.passive(model, "platform", point=(0, 0, 0.085), length=0.1)
    geometry = isolation.platform(model, "platform")
    at = SHAPE | LEGS | {CM: 0.1}
    at |= {"base.radius": 0.12, "platform.height": 0.08, "platform.spread": 0.1}
    selected = design(goal.scene.model, at, {name: tie for name, tie in geometry.ties.items() if name in at})
    system = goal.scene.model.with_values(selected.values(at)).linearize()
    turned = {"base.angle": EVERY["base.angle"], "platform.angle": EVERY["platform.angle"]}

    def asked(of):
        return [np.atleast_1d(item(of.scene.system)) for item in quantities(of)]

    def quantities(of):
        return of.rms(FLOOR), of.sag(load=10.0), of.stroke(FLOOR), of.force(FLOOR)

    def anew(values):
        other = built(**(values | turned))
        return asked(isolation.passive(other, "platform", point=(0, 0, 0.085), length=0.1))

    exact = [item.gradient(system, selected.rates(at)) for item in quantities(goal)]
    for value, other in zip([item(system) for item in quantities(goal)], anew(at), strict=True):
        assert np.allclose(value, other, rtol=1e-9)
    for i, (name, value) in enumerate(at.items()):
        h = 1e-4 * value
        up, down, up2, down2 = (anew(at | {name: value + s * h}) for s in (1, -1, 2, -2))
        for slope, a, b, c, d in zip(exact, up, down, up2, down2, strict=True):
            central = (8 * (a - b) - (c - d)) / (12 * h)
            assert np.allclose(slope[:, i], central, rtol=1e-6, atol=1e-9 * np.abs(a).max() / value), name


@pytest.mark.slow
def test_eight_variables_in_few_systems():
    model = library.stewart(leg_stiffness=2e6, ports="none")
    goal = isolation.passive(model, "platform", length=0.1)
    geometry = isolation.platform(model, "platform")
    angle = (math.radians(5), math.radians(30))
    variables = {"leg*.k.stiffness": (5e4, 1e7), "leg*.k.damping": (5.0, 200.0), "base.radius": (0.08, 0.16),
                 "platform.radius": (0.05, 0.12), "platform.height": (0.06, 0.12), "base.spread": angle,
                 "platform.spread": angle, CM: (0.06, 0.12)}  # fmt: skip
    limits = (goal.sag() <= 20e-6, goal.stroke(FLOOR) <= 0.5e-6)
    ties = {name: tie for name, tie in geometry.ties.items() if name in variables}
    result = goal.optimize(variables, goal.rms(FLOOR), limits, ties=ties)
    assert result.success
    assert result.optimum.evaluations < 150  # 49, 35 ms each
    assert result.optimum.objective < 0.5 * result.optimum.began
    # the mechanism that is given back is that of the variables, orientations and all
    anew = built(**(dict(geometry.start) | dict(result.values)))
    assert np.allclose(result.model.linearize().modes().frequencies, anew.linearize().modes().frequencies, rtol=1e-9)
    assert "base.spread [rad]" in str(result)


@pytest.mark.parametrize("half", [0.1, 0.5])
@pytest.mark.parametrize("turn", [0.0, 0.3, 1.0, 3.0, 5.5])
def test_ends_on_a_ring_are_pairs_whatever_the_direction_of_x(half, turn):
    """The nearest neighbours; ends at equal angles are 0.524 rad from the middle of each pair."""
    side = np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0])
    angle = turn + 2.0 * np.pi / 3.0 * np.array([0, 0, 1, 1, 2, 2]) + half * side
    ends = np.stack((0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.1 + 0.0 * angle), axis=1)
    others = np.stack((np.cos(angle + 0.2 * side), np.sin(angle + 0.2 * side), 0.0 * angle), axis=1)
    ring = ring_of(ends, others, [f"leg{k}" for k in range(6)], "platform")
    assert ring.half == pytest.approx(half, rel=1e-12)
    np.testing.assert_array_equal(ring.side, side)
    np.testing.assert_allclose(ring.radius, 0.3, rtol=1e-14)
