"""Batches: every variant as if it had been linearized by itself, and what is refused by its index."""

import warnings

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import mbsvib as mv
from tests.support.compare import elastic_size
from tests.support.random_models import closed_loops, open_trees, planar_loops, seeds

MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
WORDS = {"negative": st.booleans(), "damped": st.booleans()}
ANY = st.one_of(open_trees(**WORDS), open_trees(floating=st.just(True)), closed_loops(**WORDS), planar_loops())
FIELDS = ("mass", "inertia", "position", "orientation", "pitch", "start", "end", "stiffness", "damping")
# Loops far from singular lose no more than this many digits between two ways of solving for the same coordinates.
HEALTHY = 1e-2


def field_of(name):
    return next(word for word in reversed(name.split(".")) if word in FIELDS)


def other_values(model, rng, names, count, step=0.05):
    """Values near those of the model: n numbers for each name."""
    found = {}
    for name in names:
        value, field = model.parameters[name], field_of(name)
        if field in ("position", "start", "end"):
            found[name] = value + step * rng.normal(size=count)
        elif field == "orientation":
            found[name] = 5.0 * step * rng.normal(size=count)
        elif field in ("stiffness", "damping") and rng.random() < 0.3:
            found[name] = value + elastic_size(model)[field == "damping"] * rng.uniform(0.0, 0.1, size=count)
        elif field == "inertia":
            found[name] = value + step * 0.1 * rng.uniform(-1, 1, size=count) * max(
                model.parameters[f"{name.rsplit('.', 1)[0]}.{end}"] for end in ("xx", "yy", "zz"))  # fmt: skip
        else:
            found[name] = value * rng.uniform(0.6, 1.6, size=count)
    return found


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
    health = min((group.kept for group in system.provenance.reduction.groups), default=1.0)
    assume(health > HEALTHY)
    stiffness, damping = elastic_size(model)
    floor = {"K": stiffness, "C": damping, "Cq": max(1.0, stiffness), "Cv": max(1.0, damping)}
    for key in MATRICES:
        found, expected = getattr(batch, key)[i], getattr(system, key)
        assert found.shape == expected.shape, key
        size = max(np.abs(expected).max(initial=0.0), 1e-2 * floor.get(key, 1.0))
        assert np.abs(found - expected).max(initial=0.0) <= rtol * size / min(1.0, 10 * health), (key, i)


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
            one = batch[i]
            assert all((getattr(one, key) == getattr(batch, key)[i]).all() for key in MATRICES)


@given(ANY, seeds())
def test_every_kind_of_parameter(model, seed):
    """All at once: whatever a model is made of."""
    rng = np.random.default_rng(seed)
    check(model, other_values(model, rng, some_names(model, rng), 3), 3)


@pytest.mark.parametrize("fields", [("mass", "inertia"), ("stiffness", "damping"), ("position",), ("orientation",),
                                    ("start", "end"), ("pitch",), ("mass",), ("damping",)], ids="-".join)  # fmt: skip
@given(model=ANY, seed=seeds())
def test_one_kind_of_parameter(fields, model, seed):
    """One by one: what does not vary must not be taken from where something does."""
    rng = np.random.default_rng(seed)
    names = some_names(model, rng, fields)
    assume(names)
    check(model, other_values(model, rng, names[: 1 + seed % 3], 3), 3)
