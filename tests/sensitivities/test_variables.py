"""Parameters by name, pattern and linear map; what is no parameter is refused with what to do."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.sensitivities.variables import variables


@pytest.fixture(scope="module")
def system():
    return mv.library.stewart().linearize()


def test_every_parameter_has_a_value_and_a_unit(system):
    assert len(system.parameters) == 325
    assert system.parameters.units["platform.inertia.xy"] == "kg m^2"
    assert system.parameters.units["leg1.k.stiffness"] == "N/m"
    assert set(system.parameters.units) == set(system.parameters)


def test_patterns_move_all_that_they_pick_at_the_rate_of_the_map(system):
    result = variables(system.parameters, {"legs": {"leg*.k.stiffness": 2.0, "platform.mass": -1.0}})
    assert result.names == ("legs",)
    assert len(result.parameters) == 7
    assert result.chain(np.arange(7.0)[:, None])[0, 0] == 2 * (0 + 1 + 2 + 3 + 4 + 5) - 6


@pytest.mark.parametrize(("asked", "message"), [
    ("leg1.k.stifness", r"no parameter 'leg1\.k\.stifness'\. Did you mean 'leg1\.k\.stiffness'\?"),
    ("foo.mass", r"no parameter 'foo\.mass'\. Did you mean 'platform\.mass'\? Parameters are named"),
    ("leg1.k.radius", r"no parameter 'leg1\.k\.radius'\..* model\.parameters\.matching"),
    ("leq*.k.stiffness", r"no parameter 'leq\*\.k\.stiffness': the pattern matches none of 325\. Did you mean 'leg"),
    ({"a": {"leg*.q": 1.0}}, r"no parameter 'leg\*\.q': the pattern matches none"),
    ({"a": {"platform.mass": float("nan")}}, r"variable 'a': platform\.mass = nan; expected a finite rate"),
    ({"a": {}}, r"variable 'a': \{\}; expected the parameters that it moves"),
    ({"a": 3.0}, r"variable 'a': 3\.0; expected the parameters that it moves"),
    (42, r"parameters = 42; expected names, patterns, or a mapping"),
])  # fmt: skip
def test_what_is_no_parameter_is_refused(system, asked, message):
    with pytest.raises(mv.ModelError, match=message):
        system.eigenvalue_sensitivities(asked)
