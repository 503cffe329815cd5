"""Some outputs and inputs of a system in every format."""

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library

OUTPUTS, INPUTS = ["z", "r?"], "F?"
KEPT = ("z", "rx", "ry", "rz"), ("Fx", "Fy", "Fz")


@pytest.fixture(scope="module")
def system():
    return library.stewart_isolator().linearize()


@pytest.fixture(scope="module")
def sources(system):
    loop = system.feedback(mv.StateSpace.from_arrays([[-9.0]], [[1.0]], [[-2.0]], 0.0), ["x"], ["Fx"])
    return {"system": system, "loop": loop, "state space": system.state_space(),
            "from a file": mx.from_json(mx.to_json(system)), "control": mx.to_control(system)}  # fmt: skip


def written(function, reader, suffix):
    def read_back(source, folder, **ports):
        path = folder / f"file{suffix}"
        function(source, path, **ports)
        return reader(path)

    return read_back


READ = {
    "json": lambda source, folder, **ports: mx.from_json(mx.to_json(source, **ports)),
    "npz": written(mx.to_npz, mx.from_npz, ".npz"),
    "hdf5": written(mx.to_hdf5, mx.from_hdf5, ".h5"),
    "mat": written(mx.to_mat, mx.from_mat, ".mat"),
}


@pytest.mark.few(6)
@pytest.mark.parametrize("kind", ["system", "loop", "state space", "from a file", "control"])
@pytest.mark.parametrize("reader", READ)
def test_files_hold_the_ports_named(sources, kind, reader, tmp_path):
    data = READ[reader](sources[kind], tmp_path, outputs=OUTPUTS, inputs=INPUTS)
    assert (data.outputs, data.inputs) == KEPT
    space = data.state_space if isinstance(data, mx.SystemData) else data
    whole = mx.to_control(sources[kind])
    rows, columns = ([known.index(name) for name in names] for known, names in
                     ((list(whole.output_labels), KEPT[0]), (list(whole.input_labels), KEPT[1])))  # fmt: skip
    assert np.allclose(space.D, whole.D[np.ix_(rows, columns)], rtol=1e-12, atol=1e-12)
    assert np.allclose(space.C, whole.C[rows], rtol=1e-12, atol=1e-12)
    assert np.allclose(space.B, whole.B[:, columns], rtol=1e-12, atol=1e-12)


def test_other_targets_have_the_ports_named(system, tmp_path):
    ports = {"outputs": OUTPUTS, "inputs": INPUTS}
    assert mx.to_scipy(system, **ports).C.shape[0] == 4
    model = mx.to_casadi(system, **ports)
    assert (model.outputs, model.inputs) == KEPT
    assert tuple(mx.from_uff(mx.to_uff(system, tmp_path / "a.uff", [10.0, 20.0], **ports)).outputs) == KEPT[0]
    text = mx.to_modelica(system, tmp_path / "a.mo", **ports).read_text(encoding="utf-8")
    assert "output Real rz" in text
    assert "output Real y" not in text
    header = mx.to_c(system, tmp_path / "c", **ports).header.read_text(encoding="ascii")
    assert "Fz" in header
    assert "Mx" not in header
    mx.to_op4(system, tmp_path / "a.op4", **ports)


def test_fmus_have_the_ports_named(system, tmp_path):
    from fmpy import read_model_description

    path = mx.to_fmu(system, tmp_path / "a.fmu", outputs=OUTPUTS, inputs=INPUTS).path
    variables = read_model_description(path).modelVariables
    for causality, names in zip(("output", "input"), KEPT, strict=True):
        assert tuple(v.name for v in variables if v.causality == causality) == names


def test_unknown_names(system):
    with pytest.raises(mv.ResponseError, match="no such output"):
        mx.to_json(system, outputs="zz")
    with pytest.raises(mv.ResponseError, match="'Fq'"):
        mx.to_json(mx.from_json(mx.to_json(system)), inputs="Fq")


def test_loops_of_python_control_are_made_without_warnings(system):
    """Of many ports only those named are exported, and those are connected."""
    gain = control.ss([], [], [], [[-2e3]], inputs=["x"], outputs=["Fx"], name="gain")
    loop = control.interconnect([mx.to_control(system, outputs="x", inputs="Fx"), gain], inputs=["Fx"], outputs=["x"])
    ours = system.feedback([[-2e3]], "x", "Fx")["x", "Fx"]
    w = np.array([1.0, 30.0, 200.0])
    np.testing.assert_allclose(loop(1j * w), ours.frequency_response(w)[0, 0], rtol=1e-8)


def test_transfer_functions_of_python_control_are_exported(tmp_path):
    source = control.tf([[[1.0], [2.0, 3.0]]], [[[1.0, 4.0], [1.0, 2.0, 50.0]]], inputs=["a", "b"], outputs=["leg1:f"],
                        name="filters")  # fmt: skip
    w = np.array([0.5, 7.0])
    for reader in READ.values():
        space = reader(source, tmp_path)
        assert (space.outputs, space.inputs) == (("leg1.f",), ("a", "b"))
        np.testing.assert_allclose(space.frequency_response(w), source(1j * w), rtol=1e-12)
    np.testing.assert_allclose(mx.to_frd(source, w).frdata, source(1j * w), rtol=1e-12)
    assert mx.to_fmu(source, tmp_path / "filters.fmu").names["output"] == {"leg1.f": "leg1.f"}


def driven_slider(quantity="displacement"):
    """A mass of 2 kg on a spring of 1800 N/m and a damper of 6 N s/m, the ground's end of which moves."""
    model = mv.Model("driven")
    model.add_body("mass", 2.0, (1, 1, 1), (0, 0, 1))
    model.add_joint("guide", "prismatic", "ground", "mass", (0, 0, 0), axis=(0, 0, 1))
    model.add_spring("k", "ground", "mass", start=(0, 0, 0), end=(0, 0, 1), stiffness=1800.0, damping=6.0)
    model.add_motion_input("floor", "k", quantity)
    model.add_output("z", "mass", "z")
    model.add_output("a", "mass", "z", quantity="acceleration")
    return model


def test_outputs_without_a_proper_state_space_are_left_out_before_there_is_one():
    """z / floor = (c s + k) / (m s^2 + c s + k); the acceleration would need the derivative of the floor's velocity."""
    s = 1j * np.array([0.5, 30.0, 200.0])
    system, batch = driven_slider().linearize(), driven_slider().linearize(values={"mass.mass": np.array([2.0, 3.0])})
    with pytest.raises(mv.ResponseError, match=r"'a' needs the derivative of input 'floor'.*leave this output out"):
        mx.to_control(system)
    for space, mass in zip((mx.to_control(system, outputs="z"), *mx.to_control(batch, outputs="z")), (2.0, 2.0, 3.0),
                           strict=True):  # fmt: skip
        np.testing.assert_allclose(space(s), (6 * s + 1800) / (mass * s**2 + 6 * s + 1800), rtol=1e-12)
    function, _ = mx.to_transfer_function(system, "z")
    np.testing.assert_allclose(function(s), (6 * s + 1800) / (2 * s**2 + 6 * s + 1800), rtol=1e-12)
