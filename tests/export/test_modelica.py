"""Models in Modelica, read back by a compiler of Modelica that knows nothing of mbsvib."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.isolation import controller
from mbsvib_export.modelica_ import modelica_unit

casadi = pytest.importorskip("casadi")
api = pytest.importorskip("pymoca.backends.casadi.api")
parser = pytest.importorskip("pymoca.parser")


def read(folder, name):
    """The matrices A, B, C, D of a model, and its variables."""
    model = api.transfer_model(str(folder), name, {"expand_vectors": True})
    x, dx, y, u = ([v.symbol for v in part]
                   for part in (model.states, model.der_states, model.alg_states, model.inputs))  # fmt: skip
    residual = casadi.vertcat(*model.equations)
    every = [casadi.vertcat(*part) if part else casadi.MX(0, 1) for part in (x, u, dx, y)]
    slopes = [np.array(casadi.Function("j", [], [casadi.evalf(casadi.jacobian(residual, part))])()["o0"]).reshape(
        residual.shape[0], part.shape[0]) for part in every]  # fmt: skip
    n = len(x)
    assert_array_equal(slopes[2][:n], np.eye(n))
    assert_array_equal(slopes[3][n:], np.eye(len(y)))
    return model, -slopes[0][:n], -slopes[1][:n], -slopes[0][n:], -slopes[1][n:]


@pytest.mark.few(1)
@pytest.mark.parametrize(("name", "realization"), [
    ("stewart_isolator", "physical"), ("quarter_car", "modal"), ("rotor_stator", "balanced"),
])  # fmt: skip
def test_another_compiler_reads_the_same_matrices(name, realization, tmp_path):
    space = getattr(mv.library, name)().linearize().state_space(realization)
    assert mx.to_modelica(space, tmp_path / "plant.mo") == tmp_path / "plant.mo"
    model, *matrices = read(tmp_path, "plant")
    for key, matrix in zip("ABCD", matrices, strict=True):
        assert_array_equal(matrix, getattr(space, key), err_msg=key)
    signals = parser.parse((tmp_path / "plant.mo").read_text()).classes["plant"].symbols.values()
    groups = [signal for kind in ([], ["input"], ["output"]) for signal in signals if signal.prefixes == kind]
    assert [signal.comment for signal in groups] == [*space.states, *space.inputs, *space.outputs]
    first = [signal.class_modification.arguments[0].value for signal in groups if signal.prefixes]
    assert {change.component.name for change in first} == {"unit"}
    assert [change.modifications[0].value for change in first] == [
        modelica_unit(unit) for unit in (*space.input_units, *space.output_units)]  # fmt: skip
    assert set(model.outputs) == {v.symbol.name() for v in model.alg_states}


@pytest.mark.parametrize(("unit", "text"), [
    ("N m/rad", "N.m/rad"), ("m/s^2", "m/s2"), ("kg m^2", "kg.m2"), ("N m s/rad", "N.m.s/rad"), ("m", "m"),
    ("N/m rad", "N/(m.rad)"),
])  # fmt: skip
def test_units(unit, text):
    assert modelica_unit(unit) == text


def test_names_that_collide_or_are_words_of_modelica(tmp_path):
    law = controller([[1.0, 2.0, 0.0], [0.0, 0.0, 4.0]], ["a.b", "a b", "time"], ["end", '7 "x"'], "gain")
    mx.to_modelica(law, tmp_path / "gain.mo")
    model, _, _, _, gains = read(tmp_path, "gain")
    assert [v.symbol.name() for v in model.inputs] == ["a_b", "a_b_2", "time_2"]
    assert [v.symbol.name() for v in model.alg_states] == ["end_2", "v_7_x"]
    assert_array_equal(gains, law.D)


def test_connectors_of_the_standard_library(tmp_path):
    text = mx.to_modelica(mv.library.quarter_car().linearize(), tmp_path / "q.mo", connectors=True).read_text()
    assert '  Modelica.Blocks.Interfaces.RealInput actuator(unit = "N") "actuator";' in text
    assert '  Modelica.Blocks.Interfaces.RealOutput tyre_force(unit = "N") "tyre.force";' in text
    assert "input Real" not in text
    gain = controller([[2.0]], ["Modelica"], ["u"], "gain")     # a component would hide the library
    text = mx.to_modelica(gain, tmp_path / "g.mo", connectors=True).read_text()
    assert 'Modelica.Blocks.Interfaces.RealInput Modelica_2 "Modelica";' in text


def test_refusals(tmp_path):
    system = mv.library.quarter_car().linearize()
    with pytest.raises(mv.ExportError, match="no word of Modelica"):
        mx.to_modelica(system, tmp_path / "a.mo", name="model")
    with pytest.raises(mv.ExportError, match="Give the path of a file in a folder"):
        mx.to_modelica(system, tmp_path / "none" / "a.mo")
    with pytest.raises(mv.ExportError, match="expected a System"):
        mx.to_modelica("text", tmp_path / "a.mo")
    assert not list(tmp_path.iterdir())
