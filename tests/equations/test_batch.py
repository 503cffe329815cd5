"""Batches: every variant as if it had been linearized by itself, and what is refused by its index."""

import warnings

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import mbsvib as mv
import mbsvib.equations.assembly
import mbsvib.equations.batch_equations
from mbsvib import library
from tests.support.compare import elastic_size
from tests.support.random_models import closed_loops, open_trees, planar_loops, seeds
from tests.support.sizes import examples

MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
WORDS = {"negative": st.booleans(), "damped": st.booleans()}
ANY = st.one_of(open_trees(**WORDS), open_trees(floating=st.just(True)), closed_loops(**WORDS), planar_loops())
FIELDS = ("mass", "inertia", "position", "orientation", "pitch", "start", "end", "stiffness", "damping")
# Loops whose smallest pivot is smaller lose digits in proportion, by either way of solving for the coordinates.
HEALTHY = 0.1


def field_of(name):
    return next(word for word in reversed(name.split(".")) if word in FIELDS)


def other_values(model, rng, names, count, step=0.05):
    """Values near those of the model: n numbers for each name."""
    result = {}
    for name in names:
        value, field = model.parameters[name], field_of(name)
        if field in ("position", "start", "end"):
            result[name] = value + step * rng.normal(size=count)
        elif field == "orientation":
            result[name] = 5.0 * step * rng.normal(size=count)
        elif field in ("stiffness", "damping") and rng.random() < 0.3:
            result[name] = value + elastic_size(model)[field == "damping"] * rng.uniform(0.0, 0.1, size=count)
        elif field == "inertia":
            result[name] = value + step * 0.1 * rng.uniform(-1, 1, size=count) * max(
                model.parameters[f"{name.rsplit('.', 1)[0]}.{end}"] for end in ("xx", "yy", "zz"))  # fmt: skip
        else:
            result[name] = value * rng.uniform(0.6, 1.6, size=count)
    return result


def some_names(model, rng, fields=FIELDS):
    """Names of every kind of parameter that the model has."""
    names = [name for name in model.parameters if field_of(name) in fields]
    groups = {}
    for name in names:
        groups.setdefault((field_of(name), name.count(".")), []).append(name)
    picked = [group[k] for group in groups.values() for k in rng.integers(len(group), size=2)]
    return list(dict.fromkeys(picked))


def one_by_one(model, values, coordinates, count):
    """The systems of the variants, None where one is refused or has other coordinates."""
    result = []
    for i in range(count):
        with warnings.catch_warnings():
            warnings.simplefilter("error", mv.NearSingularWarning)
            try:
                system = model.with_values({k: v[i] for k, v in values.items()}).linearize(independent=coordinates)
            except (mv.ModelError, mv.SingularPoseError, mv.NearSingularWarning):
                system = None
        result.append(system if system is not None and system.coordinates == coordinates else None)
    return result


def assert_same(model, batch, i, system, rtol=1e-13):
    """Every matrix of a variant, in its norm; the norm of one that should be zero is that of what it is made of."""
    condition = min((group.retained for group in system.provenance.reduction.groups), default=1.0)
    stiffness, damping = elastic_size(model)
    floor = {"K": stiffness, "C": damping, "Cq": max(1.0, stiffness), "Cv": max(1.0, damping)}
    for key in MATRICES:
        result, expected = getattr(batch, key)[i], getattr(system, key)
        assert result.shape == expected.shape, key
        size = max(np.abs(expected).max(initial=0.0), 1e-2 * floor.get(key, 1.0))
        assert np.abs(result - expected).max(initial=0.0) <= rtol * size / min(1.0, condition / HEALTHY), (key, i)


def check(model, values, count):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.NearSingularWarning)
        try:
            nominal = model.linearize()
        except mv.SingularPoseError:
            assume(False)
        systems = one_by_one(model, values, nominal.coordinates, count)
        if None in systems:
            refused_or_the_same(model, values, systems)
            return
        batch = model.linearize(values=values)
    assert_all_the_same(model, batch, systems)


def refused_or_the_same(model, values, systems):
    """A variant that is refused by itself, or nearly singular: the batch is refused by its index, or right."""
    try:
        batch = model.linearize(values=values)
    except (mv.ModelError, mv.SingularPoseError) as error:
        message = str(error)
    else:
        assert_all_the_same(model, batch, systems)
        return
    assert f"variant {systems.index(None)}:" in message


def assert_all_the_same(model, batch, systems):
    assert len(batch) == len(systems)
    for i, system in enumerate(systems):
        if system is not None:
            assert_same(model, batch, i, system)
            single = batch[i]
            assert all((getattr(single, key) == getattr(batch, key)[i]).all() for key in MATRICES)


@pytest.mark.slow
@examples(20, slow=40)
@given(ANY, seeds())
def test_every_kind_of_parameter(model, seed):
    """All at once: whatever a model is made of."""
    rng = np.random.default_rng(seed)
    check(model, other_values(model, rng, some_names(model, rng), 3), 3)


@pytest.mark.slow
@examples(8, slow=40)
@pytest.mark.parametrize("fields", [("mass", "inertia"), ("stiffness", "damping"), ("position",), ("orientation",),
                                    ("start", "end"), ("pitch",), ("mass",), ("damping",)], ids="-".join)  # fmt: skip
@given(model=ANY, seed=seeds())
def test_one_kind_of_parameter(fields, model, seed):
    """One by one: what does not vary must not be taken from where something does."""
    rng = np.random.default_rng(seed)
    names = some_names(model, rng, fields)
    assume(names)
    check(model, other_values(model, rng, names[: 1 + seed % 3], 3), 3)


def four_bar(y=0.5, axis=(0, 0, 1)):
    """Cut at one of its joints; flat where y is 0."""
    model = mv.Model("four-bar")
    model.add_body("crank", 1.0, (0.1, 0.1, 0.1), (0.5, y / 2, 0))
    model.add_body("coupler", 1.0, (0.1, 0.1, 0.1), (2.0, y, 0))
    model.add_body("rocker", 1.0, (0.1, 0.1, 0.1), (3.5, y / 2, 0))
    model.add_joint("a", "revolute", "ground", "crank", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("b", "revolute", "crank", "coupler", (1, y, 0), axis=axis)
    model.add_joint("c", "revolute", "coupler", "rocker", (3, y, 0), axis=(0, 0, 1))
    model.add_joint("d", "revolute", "rocker", "ground", (4, 0, 0), axis=(0, 0, 1))
    model.add_bushing("k", "ground", "crank", (0, 0, 0), (0, 0, 0, 0, 0, 50.0))
    return model


def test_a_flat_four_bar_is_refused_by_its_index():
    height = {"b.position.y": [0.5, 0.4, 0.0], "c.position.y": [0.5, 0.3, 0.0]}
    with pytest.raises(mv.SingularPoseError, match=r"variant 2: .*loops closed by"):
        four_bar().linearize(values=height)
    batch = four_bar().linearize(values={name: value[:2] for name, value in height.items()})
    assert batch.K.shape == (2, 1, 1)


def test_a_loop_that_locks_is_refused_by_its_index(monkeypatch):
    """A joint's axis out of the plane: the redundant rows of the others are not redundant any more."""
    tilt = np.zeros(40)
    tilt[37] = 0.2
    with pytest.raises(mv.SingularPoseError, match=r"variant 37: .*tie the coordinates d\.rz of the nominal pose"):
        four_bar().linearize(values={"b.orientation.rx": tilt}, independent=["d.rz"])
    monkeypatch.setattr(mbsvib.equations.batch_equations, "CHUNK", 1)
    with pytest.raises(mv.SingularPoseError, match=r"variant 37: "):
        four_bar().linearize(values={"b.orientation.rx": tilt})
    four_bar().linearize(values={"*.orientation.rz": 5.0 * tilt})


def test_a_variant_in_which_the_pivots_degenerate():
    """At its dead centre, crank and coupler in line, the rocker stands still and cannot be what the others follow."""
    model = four_bar()  # (0, 0), (1, 0.5) and (3, 1.5) are in line
    with pytest.raises(mv.SingularPoseError, match=r"variant 1: .*pin other coordinates"):
        model.linearize(independent=["d.rz"], values={"c.position.y": [0.5, 1.5]})
    near = {"c.position.y": [0.5, 1.5 + 2e-5]}
    with pytest.warns(mv.NearSingularWarning, match=r"^variant 1: .*nearly singular pose"):
        batch = model.linearize(independent=["d.rz"], values=near)
    with pytest.warns(mv.NearSingularWarning):
        single = model.with_values({"c.position.y": near["c.position.y"][1]}).linearize(independent=["d.rz"])
    np.testing.assert_allclose(batch.K[1], single.K, rtol=1e-9)
    assert batch.K[1] > 1e6 * batch.K[0]


@pytest.mark.parametrize(("values", "words"), [
    ({"leg1.k.stifness": [1.0]}, r"Did you mean 'leg1\.k\.stiffness'"),
    ({"leg1.k.stiffness": [1.0, float("nan")]}, r"values\['leg1\.k\.stiffness'\]\[1\] = nan"),
    ({"leg*.k.stiffness": [1.0, 2.0, float("inf")]}, r"\.k\.stiffness'\]\[2\] = inf"),
    ({"leg1.k.stiffness": float("nan")}, r"values\['leg1\.k\.stiffness'\] = nan"),
    ({"leg1.k.stiffness": [1.0, 2.0], "platform.mass": [1.0, 2.0, 3.0]}, r"has 3 entries.*leg1\.k\.stiffness'\] has 2"),
    ({"leg1.k.stiffness": [[1.0, 2.0]]}, r"shape \(1, 2\)"),
    ({"leg1.k.stiffness": ["soft"]}, r"expected a number or a vector of numbers \[N/m\]"),
    ({"leg1.k.stiffness": []}, r"at least one variant"),
    ({"platform.mass": [1.0, 2.0, -1.0]}, r"variant 2: values\['platform\.mass'\]\[2\] = -1.*positive number \[kg\]"),
    ({"platform.inertia.xx": [0.003, 9.0]}, r"variant 1: values\['platform\.inertia\.xx'\]\[1\] = 9.*exceeds the sum"),
    ({"platform.inertia.zz": [0.005, -0.1]}, r"variant 1: values\['platform\.inertia\.zz'\]\[1\] = -0\.1.*negative"),
    ({"leg1.k.stiffness": [1.0, 0.0], "leg1.k.damping": 0.0}, r"variant 1: .*neither stiffness nor damping"),
    ({"*.stiffness": [1.0], "leg*.k.stiff*": [2.0]}, r"both '\*\.stiffness' and"),
    ({}, "expected a mapping"), ([1.0], "expected a mapping"),
])  # fmt: skip
def test_values_that_are_refused(values, words):
    with pytest.raises(mv.ModelError, match=words) as caught:
        library.stewart().linearize(values=values)
    assert caught.value.field == "values" or isinstance(caught.value, KeyError)


def test_a_spring_that_shrinks_to_nothing_is_refused_by_its_index():
    spring = library.stewart().springs["leg1.k"]
    values = {f"leg1.k.start.{axis}": [begin, end] for axis, begin, end in zip("xyz", spring.start, spring.end,
                                                                            strict=True)}  # fmt: skip
    with pytest.raises(mv.ModelError, match=r"variant 1: .*leg1\.k\.start\.x'\]\[1\].*no line to act along"):
        library.stewart().linearize(values=values)


def test_a_thin_plate_passes_as_it_does_by_itself():
    """Ixx + Iyy = Izz to the digits of a print-out: at the edge of what is refused."""
    model = mv.Model("plate")
    model.add_body("b", 1.0, (1.0, 2.0, 3.0))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (1.0,) * 6)
    izz = np.array([3.0, 3.0 * (1 + 0.95e-6), 2.9])
    np.testing.assert_allclose(model.linearize(values={"b.inertia.zz": izz}).M[:, 5, 5], izz, rtol=1e-15)
    with pytest.raises(mv.ModelError, match=r"variant 3: "):
        model.linearize(values={"b.inertia.zz": [*izz, 3.0 * (1 + 1.1e-6)]})


@pytest.mark.slow
def test_what_does_not_vary_is_computed_once():
    model = library.stewart()
    batch = model.linearize(values={"leg1.k.stiffness": np.linspace(1e7, 3e7, 50)})
    assert [name for name in MATRICES if getattr(batch, name).strides[0] == 0] == ["M", "C", "B", "Cq", "Cv", "Ca", "D"]
    assert "computed once, as nothing varies in them: M, C, B" in batch.explain()
    assert "50 variants of 1 parameter: leg1.k.stiffness" in batch.explain()
    assert batch.explain().startswith(model.linearize().explain())
    batch = model.linearize(values={"platform.mass": [1.0, 2.0]})
    assert batch.K.strides[0] == 0
    assert batch.M.strides[0] > 0


def test_stiffness_needs_no_kinematics_of_the_variants(monkeypatch):
    """The geometry of a sweep over stiffness is looked at as often as that of a single system, and one piece more."""
    shapes = []

    def counted(coordinates, position):
        shapes.append(coordinates.point.ndim)
        return mbsvib.kinematics.relative_motion.body_motion(coordinates, position)

    monkeypatch.setattr(mbsvib.equations.matrices, "body_motion", counted)
    model = library.stewart()
    model.linearize(values={"leg*.k.stiffness": np.linspace(1e7, 3e7, 1000)})
    assert shapes == [2, 2]
    model.linearize(values={"leg1.head.position.x": np.full(1000, 0.05)})
    assert shapes[3:] == [3] * (len(shapes) - 3)
    assert len(shapes) > 4


def test_pieces_of_a_batch_are_put_together_in_order(monkeypatch):
    model = library.stewart()
    values = {"leg1.head.position.x": 0.05 + np.linspace(0, 1e-2, 40), "platform.mass": np.linspace(1, 2, 40)}
    full = model.linearize(values=values)
    monkeypatch.setattr(mbsvib.equations.batch_equations, "CHUNK", 1)
    parts = model.linearize(values=values)
    for key in MATRICES:
        np.testing.assert_allclose(getattr(parts, key), getattr(full, key), rtol=1e-14, atol=0)
    values["platform.mass"] = np.where(np.arange(40) == 33, -1.0, 1.0)
    with pytest.raises(mv.ModelError, match="variant 33"):
        model.linearize(values=values)


def test_coordinates_without_mass_are_refused_by_index():
    model = mv.Model("shaft")
    model.add_body("b", 1.0, (1.0, 1.0, 1.0))
    model.add_joint("j", "revolute", "ground", "b", (0, 0, 0), axis=(0, 0, 1))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (1.0,) * 6)
    values = {"b.inertia.xx": [1.0, 1.0, 1.0], "b.inertia.yy": [1.0, 1.0, 1.0], "b.inertia.zz": [1.0, 0.5, 0.0]}
    with pytest.raises(mv.ModelError, match=r"variant 2: coordinate 'j\.rz': the mass matrix is singular"):
        model.linearize(values=values)


@pytest.mark.slow
def test_one_by_one():
    model = library.stewart()
    values = {"leg*.k.stiffness": [1e7, 2e7, 3e7], "leg2.head.position.z": [0.075, 0.076, 0.077], "platform.mass": 2.0}
    batch = model.linearize(values=values)
    assert len(batch) == 3
    assert batch.coordinates == batch[0].coordinates == model.linearize().coordinates
    assert repr(batch) == "Batch('stewart': 3 variants, 6 DOF)"
    assert [system.parameters["leg4.k.stiffness"] for system in batch] == [1e7, 2e7, 3e7]
    for i, system in enumerate(batch[:]):
        separate = model.with_values({name: v if np.ndim(v) == 0 else v[i] for name, v in values.items()})
        assert dict(system.parameters) == dict(separate.parameters)
        single = separate.linearize(independent=batch.coordinates)
        assert system.provenance.topology.joints == single.provenance.topology.joints
        np.testing.assert_allclose(
            system.provenance.reduction.matrix, single.provenance.reduction.matrix, rtol=0, atol=1e-13
        )
        assert system.explain().splitlines()[0] == single.explain().splitlines()[0]
    assert np.array_equal(batch[-1].K, batch.K[2])
    with pytest.raises(IndexError, match="has 3 variants, and none of number 3; expected 0 to 2"):
        batch[3]
    with pytest.raises(ValueError, match="read-only"):
        batch.M[0, 0, 0] = 1.0
    assert list(batch.parameters) == [*(f"leg{i}.k.stiffness" for i in range(1, 7)), "leg2.head.position.z",
                                      "platform.mass"]  # fmt: skip


def test_scalars_alone_are_one_variant():
    batch = library.stewart().linearize(values={"platform.mass": 2.0})
    assert batch.M.shape == (1, 6, 6)


def test_pinned_coordinates_and_cuts():
    model = four_bar()
    batch = model.linearize(independent=["d.rz"], cut=["b"], values={"k.stiffness.rz": [50.0, 100.0]})
    assert batch.coordinates == ("d.rz",)
    assert batch.nominal.cut_joints == ("b",)
    np.testing.assert_allclose(batch.K[1], 2.0 * batch.K[0], rtol=1e-15)


@pytest.mark.parametrize("cut", ["nut", "pin"])
def test_pitch_of_a_screw_in_a_loop(cut):
    """A slider without rotation on a screw: x = -pitch * angle of the screw, whichever joint is cut."""
    model = mv.Model("press")
    model.add_body("slider", 2.0, (1.0, 1.0, 1.0))
    model.add_body("shaft", 3.0, (1.0, 1.0, 0.5))
    model.add_joint("guide", "prismatic", "ground", "slider", axis=(0, 0, 1))
    model.add_joint("pin", "revolute", "ground", "shaft", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("nut", "screw", "shaft", "slider", (0, 0, 0), axis=(0, 0, 1), pitch=0.1)
    model.add_bushing("k", "ground", "slider", (0, 0, 0), (0, 0, 100.0, 0, 0, 0), (0, 0, 3.0, 0, 0, 0))
    model.add_bushing("t", "slider", "shaft", (0, 0, 0), (0, 0, 0, 0, 0, 5.0), (0, 0, 0, 0, 0, 0.7))
    model.add_input("F", "slider", "z")
    model.add_input("Mz", "shaft", "rz")
    for name, quantity in (("angle", "displacement"), ("speed", "velocity"), ("spin-up", "acceleration")):
        model.add_output(name, "shaft", "rz", quantity=quantity)
    pitch = np.array([0.1, 0.2, -0.3])
    batch = model.linearize(independent=["guide.z"], cut=[cut], values={"nut.pitch": pitch})
    assert batch.coordinates == ("guide.z",)
    for matrix, of_slider, of_shaft in ((batch.M, 2.0, 0.5), (batch.C, 3.0, 0.7), (batch.K, 100.0, 5.0)):
        np.testing.assert_allclose(matrix[:, 0, 0], of_slider + of_shaft / pitch**2, rtol=1e-14)
    np.testing.assert_allclose(batch.B[:, 0], np.stack((np.ones(3), -1.0 / pitch), axis=1), rtol=1e-14)
    for row, matrix in enumerate((batch.Cq, batch.Cv, batch.Ca)):
        np.testing.assert_allclose(matrix[:, row, 0], -1.0 / pitch, rtol=1e-14)
        assert not np.delete(matrix, row, axis=1).any()


def test_directions_of_a_bushing_come_and_go():
    """Stiff along x as given, along y in a variant, along neither in another: rows that only some variants have."""
    model = mv.Model("mount")
    model.add_body("b", 1.0, (1.0, 1.0, 1.0))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (9.0, 0, 4.0, 0, 0, 0), orientation=(0.3, 0.2, 0.1))
    values = {"k.stiffness.x": [9.0, 0.0, 0.0], "k.stiffness.y": [0.0, 3.0, 0.0], "k.damping.rz": [0.0, 0.0, 2.0]}
    batch = model.linearize(values=values)
    systems = one_by_one(model, values, batch.coordinates, 3)
    assert_all_the_same(model, batch, systems)
    assert [len(system.row_stiffness) for system in batch] == [2, 2, 2]
    assert [len(system.row_stiffness) for system in systems] == [2, 2, 2]
