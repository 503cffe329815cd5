"""Flexures against closed forms, integrals in extended precision, refined beams, and in all engines."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.elements import flexure
from mbsvib.elements.beam_element import Prismatic
from mbsvib.elements.material import Material
from mbsvib.elements.sections import Properties

E, NU, RHO = 2.1e11, 0.3, 7800.0
G = E / (2 + 2 * NU)
STEEL = {"E": E, "nu": NU, "rho": RHO}
L, B, T = 0.05, 0.02, 0.0005
LEAF = {"type": "leaf", "length": L, "width": B, "thickness": T}
NOTCH = {"type": "notch", "radius": 0.003, "thickness": 0.0005, "width": 0.01}
ELLIPTIC = {"type": "elliptic", "length": 0.012, "depth": 0.002, "thickness": 0.0007, "width": 0.004}
FILLETED = {"type": "corner_filleted", "length": 0.01, "radius": 0.001, "thickness": 0.0005, "width": 0.008}
CUTS = (NOTCH, ELLIPTIC, FILLETED, NOTCH | {"thickness": 0.00002}, NOTCH | {"radius": 0.0001},
        ELLIPTIC | {"depth": 0.02, "thickness": 0.0001})  # fmt: skip
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
TURN = (0.4, -0.7, 1.1)
AT = (0.3, -0.2, 0.5)


def extent(shape):
    return shape.get("length", 2 * shape.get("radius", 0.0))


def thickness(shape):
    """h(x) of a notch, in the precision of mpmath."""
    t, half = mp.mpf(shape["thickness"]), mp.mpf(extent(shape)) / 2
    along = mp.mpf(shape["radius"]) if "radius" in shape else half
    deep = mp.mpf(shape.get("depth", shape.get("radius")))
    flat = half - along

    def h(x):
        return t + 2 * deep * (1 - mp.sqrt(max(0, 1 - ((abs(x) - flat) / along) ** 2))) if abs(x) > flat else t

    return h, [0, flat, flat + along / 30, flat + along / 4, half] if flat > 0 else [0, half / 30, half / 4, half]


def torsion(b, h):
    a, b = float(max(b, h)), float(min(b, h))
    n = np.arange(1, 4000, 2.0)
    return a * b**3 * (1 / 3 - 64 * b / (np.pi**5 * a) * np.sum(np.tanh(np.pi * n * a / (2 * b)) / n**5))


def stiffness_of_notch(shape):
    """The six stiffnesses about the middle along x, y (width), z (length), by adaptive quadrature on 30 digits."""
    with mp.workdps(30):
        h, cuts = thickness(shape)
        b, e, g = mp.mpf(shape["width"]), mp.mpf(E), mp.mpf(E) / mp.mpf(2 + 2 * NU)
        integrands = (
            lambda x: 12 * x**2 / (e * b * h(x) ** 3) + 1.2 / (g * b * h(x)),
            lambda x: 12 * x**2 / (e * b**3 * h(x)) + 1.2 / (g * b * h(x)),
            lambda x: 1 / (e * b * h(x)), lambda x: 12 / (e * b**3 * h(x)), lambda x: 12 / (e * b * h(x) ** 3),
            lambda x: 1 / (g * torsion(b, h(x))),
        )  # fmt: skip
        return [float(1 / (2 * mp.quad(f, cuts))) for f in integrands]


def stiffness_of_leaf(length, b, t, shear=False):
    factors = [1 + 12 * E * side**2 / 12 / (5 / 6 * G * length**2) if shear else 1.0 for side in (t, b)]
    x = mp.mpf(length) / b * mp.sqrt(12 * G / E)
    j = float(torsion(mp.mpf(b), mp.mpf(t)) / (1 - mp.tanh(x) / x))
    soft, stiff = E * b * t**3 / 12, E * t * b**3 / 12
    return [12 * soft / length**3 / factors[0], 12 * stiff / length**3 / factors[1], E * b * t / length,
            stiff / length, soft / length, G * j / length]  # fmt: skip


def held(shape, **words):
    """A block on a flexure, with forces and displacements in its axes at its middle, away from the origin."""
    model = mv.Model("held")
    axes = mv.Model("axes").add_body("b", 1.0, (1, 1, 1), orientation=TURN).orientation
    model.add_body("block", 2.0, (1e-3, 2e-3, 1.5e-3), np.array(AT) + np.array(axes) @ (0, 0, 0.02))
    model.add_flexure("f", "ground", "block", shape, STEEL, position=AT, orientation=TURN, **words)
    for i, name in enumerate(DIRECTIONS):
        axis = np.array(axes)[:, i % 3]
        direction = [*axis, 0, 0, 0] if i < 3 else [0, 0, 0, *axis]
        model.add_input(f"F{name}", "block", direction, AT)
        model.add_output(name, "block", direction, AT)
    return model


def compliance(model, method="dense"):
    return model.linearize(method=method).frequency_response([0.0])[:, :, 0].real


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize("sides", [(L, B, T), (0.02, 0.02, 0.004), (0.01, 0.03, 0.03)])
@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_stiffness_of_a_leaf(sides, shear, method):
    shape = dict(zip(("length", "width", "thickness"), sides, strict=True))
    result = compliance(held({"type": "leaf", **shape}, shear=shear), method)
    expected = 1 / np.array(stiffness_of_leaf(*sides, shear))
    assert_allclose(np.diag(result), expected, rtol=1e-10)
    size = np.sqrt(np.outer(expected, expected))
    assert_allclose(result / size, np.eye(6), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("shape", CUTS)
def test_stiffness_of_a_notch(shape):
    result, expected = compliance(held(shape)), 1 / np.array(stiffness_of_notch(shape))
    assert_allclose(result / np.sqrt(np.outer(expected, expected)), np.eye(6), atol=1e-9)


@pytest.mark.parametrize("ratio", [0.001, 0.05, 0.4, 3.0])
def test_bending_of_a_circular_notch_in_closed_form(ratio):
    """Paros and Weisbord (1965), without their terms of the angle at which the cut ends, here 90 degrees."""
    radius, b = 0.003, 0.01
    beta = 0.5 * ratio
    g, s = 1 + beta, 2 * beta + beta**2
    angle = np.arctan(np.sqrt((2 + beta) / beta))
    expected = 3 / (2 * E * b * radius**2 * s) * (1 / g + (3 + 2 * beta + beta**2) / (g * s) + 6 * g / s**1.5 * angle)
    shape = {"type": "notch", "radius": radius, "thickness": ratio * radius, "width": b}
    assert_allclose(compliance(held(shape))[4, 4], expected, rtol=1e-10)


def test_against_refined_beams():
    """A leaf of one element and beams of 1, 3 and 8, with the same torsion constant: statics are the same."""
    j = stiffness_of_leaf(L, B, T)[5] * L / G
    section = {"A": B * T, "Iy": B * T**3 / 12, "Iz": T * B**3 / 12, "J": j}
    leaf = held(LEAF)
    expected = compliance(leaf)
    ends = leaf.beams["f"].points
    for elements in (1, 3, 8):
        model = held(LEAF)
        axes = np.array(model.beams["f"].orientation)
        model = model.with_parts(composed={})
        model.add_beam("f", "ground", "block", section, STEEL, *ends, elements=elements, y_axis=axes[:, 1])
        result = compliance(model)
        size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert_allclose(result / size, expected / size, atol=1e-9)


def stepped(shape, count):
    """Ends of many short Timoshenko beams with the section at their middles, along x of the world."""
    h, _ = thickness(shape)
    edges = np.linspace(-0.5, 0.5, count + 1) * extent(shape)
    for i in range(count):
        t = float(h(mp.mpf(0.5 * (edges[i] + edges[i + 1]))))
        b = shape["width"]
        section = {"A": b * t, "Iy": b * t**3 / 12, "Iz": t * b**3 / 12, "J": float(torsion(b, t)), "ky": 5 / 6,
                   "kz": 5 / 6}  # fmt: skip
        yield edges[i], edges[i + 1], section


def extrapolated(of_count):
    """The limit of what converges with the square of the element size, from 40 and 80 elements."""
    coarse, fine = (np.array(of_count(count)) for count in (40, 80))
    return (4 * fine - coarse) / 3


def bar(shape, count=None, mass=1e-3, **words):
    """A small block on a notch along z, or on so many beams."""
    model, half = mv.Model("bar", **words.pop("model", {})), 0.5 * extent(shape)
    model.add_body("block", mass, (1e-9, 1e-9, 1e-9), (0, 0, half))
    if count is None:
        model.add_flexure("f", "ground", "block", shape, STEEL, **words)
        return model
    before = "ground"
    for i, (start, end, section) in enumerate(stepped(shape, count)):
        after = "block" if i == count - 1 else None
        model.add_beam(f"f{i}", before, after, section, STEEL, (0, 0, start), (0, 0, end), elements=1, shear=True,
                       y_axis=(0, 1, 0))  # fmt: skip
        before = f"f{i}.1"
    return model


@pytest.mark.slow
@pytest.mark.parametrize("shape", [FILLETED, ELLIPTIC | {"depth": 0.0005}])
def test_mass_of_a_notch(shape):
    """How much its mass lowers the modes of a block on it, which are far below its own, as that of short beams does."""
    def shifts(count):
        model = bar(shape, count, 5e-3)
        block = replace(model.bodies["block"], inertia=(2e-7, 3e-7, 2.5e-7, 0, 0, 0))
        model = model.with_parts(bodies=dict(model.bodies) | {"block": block})
        heavy, light = (model.with_values({f"{name}.rho": rho for name in model.beams}) for rho in (RHO, 1e-6 * RHO))
        return heavy.linearize().modes().frequencies[:6] / light.linearize().modes().frequencies[:6] - 1

    expected = extrapolated(shifts)
    assert np.all(np.abs(expected) > 1e-4)
    assert_allclose(shifts(None), expected, rtol=0.03)


@pytest.mark.parametrize("shape", [NOTCH, ELLIPTIC, FILLETED])
def test_a_notch_has_its_mass_at_points(shape):
    """Sums over the points are the consistent mass matrix, and the integrals of all rigid motions."""
    part = held(shape).beams["f"].element(extent(shape))
    points, rows = part.mass_points(), part.mass_rows()
    matrix = np.einsum("n,nij,nik->jk", points.masses, points.moves, points.moves)
    matrix += np.einsum("ni,nij,nik->jk", points.sections, points.turns, points.turns)
    assert_allclose(matrix, rows.T @ rows, rtol=1e-12, atol=1e-13 * np.abs(matrix).max())
    half, b, count = 0.5 * extent(shape), shape["width"], 200000
    x = half * (2 * np.arange(count) + 1 - count) / count
    along, deep = shape.get("radius", half), shape.get("depth", shape.get("radius"))
    share = np.maximum(0.0, np.abs(x) - (half - along)) / along
    h = shape["thickness"] + 2 * deep * (1 - np.sqrt(1 - share**2))
    rigid = np.zeros((6, 12))
    for k, end in enumerate((-half, half)):
        rigid[:, 6 * k : 6 * k + 6] = np.eye(6)
        rigid[4, 6 * k + 2], rigid[5, 6 * k + 1] = -end, end
    assert_allclose(points.turns @ rigid.T, np.broadcast_to(np.eye(6)[3:], (len(points.masses), 3, 6)), atol=1e-12)
    soft, (at_end, lever) = points.moves[:, 2], part.odd_load
    for load, force, arm in ((np.ones(len(soft)), 0.5 * part.mass, part.arm), (soft @ rigid[4] / -half, at_end, lever)):
        assert_allclose((points.masses * load) @ soft[:, [8, 10]], [force, force * arm], rtol=1e-12)
    w = RHO * b * h * 2 * half / count
    expected = [w.sum()] * 3 + [w @ (b * b + h * h) / 12, w @ (x * x + h * h / 12), w @ (x * x + b * b / 12)]
    assert_allclose(rigid @ matrix @ rigid.T, np.diag(expected), rtol=1e-6, atol=1e-9 * max(expected))


@pytest.mark.parametrize("part", [flexure.Elliptic(B, T, L, 1e-9), flexure.CornerFilleted(B, T, L, 1e-9 * L)])
def test_a_notch_without_cuts_is_a_bar(part):
    """All numbers of the integrals come down to those of a constant section."""
    material = Material(E, RHO, NU)
    j = float(torsion(mp.mpf(B), mp.mpf(T)))
    section = Properties(B * T, B * T**3 / 12, T * B**3 / 12, j, 5 / 6, 5 / 6)
    one, other = part.element(L, material, True), Prismatic(L, section, material, True)
    assert_allclose((one.mass, one.arm), (other.mass, other.arm), rtol=1e-4)
    assert_allclose(one.stiffness(), other.stiffness(), rtol=1e-4)
    assert_allclose(one.bent_lines(), other.bent_lines(), rtol=1e-4)
    products = [rows.T @ rows for rows in (one.mass_rows(), other.mass_rows())]
    size = np.sqrt(np.outer(*2 * [np.diag(products[1])]))
    assert_allclose(products[0] / size, products[1] / size, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [NOTCH, ELLIPTIC, FILLETED])
def test_tension_and_weight_of_a_notch(shape):
    """Compliances of a block that is pulled and weighs, to first order in both, as those of short beams."""
    def change(count):
        model = bar(shape, count, 1e-3)
        for name in ("x", "y", "rx", "ry"):
            model.add_input(f"F{name}", "block", name)
            model.add_output(name, "block", name)
        free = compliance(model)
        pulled = [compliance(model.with_parts(gravity=gravity, loads=loads)) - free for gravity, loads in cases(model)]
        size = np.sqrt(np.outer(np.diag(free), np.diag(free)))
        return np.array([item / size / np.abs(item / size).max() for item in pulled])

    def cases(model):
        other = model.with_parts()
        load = other.add_load("pull", "block", (0, 0, 1e-3))
        return ((None, {"pull": load}), ((0, 0, 1e-3), {}))

    expected = extrapolated(change)
    result = change(None)
    assert_allclose(result[0], expected[0], atol=2e-4)
    assert_allclose(result[1], expected[1], atol=1e-3)   # its weight is consistent with soft bending


@pytest.mark.parametrize("share", [1e-3, 0.1, 0.5, -2.0])
def test_stiffness_of_a_guided_leaf_under_a_force(share):
    """P = share pi^2 E I / L^2 that presses: k = (P/L) / (tan u / u - 1), pulled with tanh; to first order in P."""
    model = mv.Model("guide")
    model.add_body("stage", 1.0, (1, 1, 1), (0, 0, L / 2))
    model.add_joint("rail", "custom", "ground", "stage", (0, 0, L / 2), free=["x", "z"])
    model.add_flexure("f", "ground", "stage", LEAF, STEEL)
    soft = E * B * T**3 / 12
    force = share * np.pi**2 * soft / L**2
    model.add_load("P", "stage", (0, 0, -force))
    model.add_input("F", "stage", "x")
    model.add_output("x", "stage", "x")
    u = 0.5 * L * np.sqrt(abs(force) / soft)
    exact = force / L / (np.tan(u) / u - 1) if force > 0 else -force / L / (1 - np.tanh(u) / u)
    result = 1 / compliance(model)[0, 0]
    assert_allclose(result, 12 * soft / L**3 - 1.2 * force / L, rtol=1e-9)
    assert_allclose(result, exact, rtol=max(1e-9, 0.03 * share**2))


@pytest.mark.parametrize(("share", "told"), [(0.7, "0.69"), (1.2, "1.2")])
def test_flexures_that_nearly_buckle_are_told_of(share, told):
    model = mv.Model("guide")
    model.add_body("stage", 1.0, (1, 1, 1), (0, 0, L / 2))
    model.add_joint("rail", "custom", "ground", "stage", (0, 0, L / 2), free=["x", "z"])
    model.add_flexure("f", "ground", "stage", LEAF, STEEL)
    model.add_load("P", "stage", (0, 0, -share * np.pi**2 * E * B * T**3 / 12 / L**2))
    with pytest.warns(mv.AccuracyWarning, match=f"flexure 'f': its compression is {told} of that at which it buckles"):
        model.linearize()


def guide():
    """A stage on two leaves, guided parallel."""
    model = mv.Model("guide")
    model.add_body("stage", 0.5, (1e-4, 1e-4, 1e-4), (0, 0, L / 2))
    for name, x in (("left", -0.03), ("right", 0.03)):
        model.add_flexure(name, "ground", "stage", LEAF, STEEL, position=(x, 0, 0))
    model.add_input("F", "stage", "x")
    model.add_output("x", "stage", "x")
    model.add_output("z", "stage", "z")
    return model


def test_mass_that_goes_along_with_a_guide():
    """13/35 of each leaf, but for the tilt that the leaves' stretch lets happen (1e-5)."""
    mass = RHO * B * T * L
    stiff = 2 * E * B * T**3 / L**3
    model = guide()
    expected = np.sqrt(stiff / (0.5 + 2 * 13 / 35 * mass)) / (2 * np.pi)
    assert_allclose(model.linearize().modes().frequencies[0], expected, rtol=3e-4)
    model.add_joint("level", "custom", "ground", "stage", (0, 0, L / 2), free=["x", "z"])
    assert_allclose(model.linearize().modes().frequencies[0], expected, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [LEAF, NOTCH, ELLIPTIC, FILLETED])
@pytest.mark.parametrize("gravity", [None, (1.0, -2.0, 3.0)])
def test_sensitivities_are_slopes_of_variants(shape, gravity):
    model = held(shape, beta=1e-5, damping_ratio=0.01)
    if gravity is not None:
        model = model.with_parts(gravity=gravity)
    system = model.linearize()
    names = [name for name in system.parameters if name.startswith("f.")]
    assert {"f.thickness", "f.width", "f.E", "f.position.x", "f.orientation.ry"} <= set(names)
    result = system.mode_sensitivities(names)
    now = system.modes().frequencies
    for i, name in enumerate(names):
        value = float(system.parameters[name])
        size = abs(value) or 0.02

        def of(x, name=name, value=value):
            return model.with_values({name: value + x}).linearize().modes().frequencies

        one, two = ((of(step * size) - of(-step * size if value else 0.0)) / ((2 if value else 1) * step)
                    for step in (1e-4, 2e-4))  # fmt: skip
        expected = (4 * one - two) / 3 if value else 2 * one - two
        assert_allclose(size * result.frequencies[i] / now, expected / now, atol=1e-7, err_msg=name)


def test_sensitivity_to_the_thickness_in_closed_form():
    """k of t^3, M with the stage and 13/35 of two leaves."""
    model = guide()
    model.add_joint("level", "custom", "ground", "stage", (0, 0, L / 2), free=["x", "z"])
    system = model.linearize()
    result = system.mode_sensitivities(["left.thickness"])
    mass = RHO * B * T * L
    f = system.modes().frequencies[0]
    expected = 0.5 * f * (1.5 / T - 13 / 35 * mass / T / (0.5 + 2 * 13 / 35 * mass))
    assert_allclose(result.frequencies[0, 0], expected, rtol=1e-10)


@pytest.mark.parametrize("shape", [LEAF, NOTCH])
def test_damping_in_proportion_to_mass_and_stiffness_and_of_modes(shape):
    """alpha M of the flexure without the block, beta K; a ratio damps no motion of the block as a rigid whole."""
    def of(**words):
        return held(shape, **words).linearize()

    plain = of()
    own = plain.M - held(shape).with_values({"f.rho": 1e-9}).linearize().M
    for got, expected in ((of(alpha=3.0).C, 3.0 * own), (of(beta=2e-5).C, 2e-5 * plain.K),
                          (of(alpha=3.0, beta=2e-5).C, 3.0 * own + 2e-5 * plain.K)):  # fmt: skip
        assert_allclose(got, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    damping = of(damping_ratio=0.01).C
    assert np.linalg.eigvalsh(damping).min() > 0.0
    assert_allclose(of(damping_ratio=0.03).C, 3.0 * damping, rtol=1e-12)


def test_shapes_may_be_given_as_objects():
    for shape, part in ((LEAF, flexure.Leaf(LEAF["length"], LEAF["width"], LEAF["thickness"])),
                        (NOTCH, flexure.Notch(NOTCH["width"], NOTCH["thickness"], NOTCH["radius"])),
                        (ELLIPTIC, flexure.Elliptic(*(ELLIPTIC[k] for k in ("width", "thickness", "length", "depth")))),
                        (FILLETED, flexure.CornerFilleted(*(FILLETED[k] for k in ("width", "thickness", "length",
                                                                                  "radius"))))):  # fmt: skip
        assert held(part).beams["f"] == held(shape).beams["f"]


@pytest.mark.parametrize(("shape", "parameter", "values"), [
    (LEAF, "f.thickness", [4e-4, 5e-4, 6e-4]), (NOTCH, "f.nu", [0.25, 0.3, 0.35]), (FILLETED, "f.nu", [0.25, 0.3]),
])  # fmt: skip
def test_variants_and_compiled_plants(shape, parameter, values):
    model = held(shape)
    batch = model.linearize(values={parameter: values})
    plant = model.compile(parameter)(np.array(values)[:, None])
    for i, value in enumerate(values):
        expected = model.with_values({parameter: value}).linearize()
        assert_allclose(batch.modes().frequencies[i], expected.modes().frequencies, rtol=1e-12)
        assert_allclose(plant.K[i], expected.K, rtol=1e-12)


@pytest.mark.slow
def test_files(tmp_path):
    model = guide()
    model.add_body("foot", 0.1, (1e-5, 1e-5, 1e-5), (0, 0, 0.04))
    model.add_flexure("hinge", "stage", "foot", FILLETED, STEEL, (0, 0, 0.03), TURN, beta=1e-5, second_order=False)
    model.add_load("push", "stage", (0.2, 0, 0))
    for suffix, item in (("yaml", model), ("json", model.equilibrium())):
        back = mv.load(mv.save(item, tmp_path / f"guide.{suffix}"))
        assert dict(back.beams) == dict(item.beams)
        assert_allclose(back.linearize().modes().frequencies, item.linearize().modes().frequencies, rtol=0)


@pytest.mark.parametrize(("words", "message"), [
    ({"shape": {"type": "lief", "length": 1}}, "leaf, notch, elliptic, corner_filleted"),
    ({"shape": LEAF | {"thickness": 0.03}}, "thickness = 0.03; expected at most the width, 0.02 m"),
    ({"shape": NOTCH | {"thickness": 1e-8}}, "at least 0.001 of the depth"),
    ({"shape": FILLETED | {"radius": 0.006}}, "at most half the length"),
    ({"shape": {"type": "notch", "radius": 0.1}}, "needs width, thickness"),
    ({"shape": NOTCH | {"length": 0.1}}, "shape has no 'length'"),
    ({"shape": LEAF | {"width": -1}}, "a positive number"),
    ({"b": "ground"}, "connects body 'ground' with itself"),
    ({"b": "nobody"}, "nobody"),
    ({"shear": 1}, "True"),
    ({"displacements": [[0] * 6]}, "each of the 2 nodes"),
    ({"alpha": -1}, "not negative"),
])  # fmt: skip
def test_refusals(words, message):
    model = mv.Model("m")
    model.add_body("block", 1, (1, 1, 1))
    with pytest.raises(mv.ModelError, match=message):
        model.add_flexure("f", **({"a": "ground", "b": "block", "shape": LEAF, "material": STEEL} | words))
