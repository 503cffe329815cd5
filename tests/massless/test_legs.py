"""Platforms on legs with massless parts, condensed through closed loops."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import library


def light_stewart(split=None):
    """The Stewart platform with massless legs; ``split``: stiffnesses in series in each, a massless link between."""
    given = library.stewart()
    model = mv.Model("light")
    for body in given.bodies.values():
        massless = {} if body.name == "platform" else {"mass": 0.0, "inertia": (0, 0, 0)}
        model.add_body(**body.constructor_kwargs() | massless)
    springs = {frozenset((spring.first, spring.second)): spring for spring in given.springs.values()}
    for joint in given.joints.values():
        spring = springs.get(frozenset((joint.first, joint.second)))
        if spring is None or split is None:
            model.add_joint(**joint.constructor_kwargs())
            continue
        link = f"{spring.name}.link"
        middle = np.add(spring.start, spring.end) / 2
        model.add_body(link, 0.0, (0, 0, 0), position=middle)
        for i, (first, second, start, end) in enumerate((
            (spring.first, link, spring.start, middle), (link, spring.second, middle, spring.end),
        )):  # fmt: skip
            model.add_joint(f"{spring.name}.j{i}", "prismatic", first, second, axis=spring.line)
            model.add_spring(f"{spring.name}.k{i}", first, second, start, end, stiffness=split[i])
    if split is None:
        for spring in given.springs.values():
            model.add_spring(**(spring.constructor_kwargs() | {"damping": 0.0}))
    return model


def test_massless_legs():
    result = light_stewart().linearize()
    assert (result.dof, result.massless) == (6, 0)
    assert_allclose(result.modes().frequencies[[0, -1]], [935.1, 1722.6], atol=0.05)
    light = library.stewart(part_mass=1e-13).linearize().modes().frequencies
    assert_allclose(result.modes().frequencies, light, rtol=1e-10)


def test_massless_links_within_the_legs():
    soft = 2e7
    split = light_stewart((soft / 0.3, soft / 0.7)).linearize()
    assert (split.dof, split.massless) == (6, 0)
    assert len(split.provenance.separation.condensed) == 6
    assert_allclose(split.modes().frequencies, light_stewart().linearize().modes().frequencies, rtol=1e-11)


def test_spins_of_massless_struts_are_refused_by_name():
    """A strut between two spherical joints spins about its line, which moves nothing."""
    model = mv.Model("hung")
    model.add_body("load", 1.0, (1, 1, 1), position=(0, 0, 0))
    model.add_body("strut", 0.0, (0, 0, 0), position=(0, 0, 1))
    model.add_joint("top", "spherical", "ground", "strut", position=(0, 0, 2))
    model.add_joint("bottom", "spherical", "strut", "load", position=(0, 0, 0.5))
    with pytest.raises(mv.ModelError, match=r"'top\.rz'.*moves no mass, and no spring or damper holds it"):
        model.linearize()
