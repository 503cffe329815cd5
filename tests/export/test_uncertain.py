"""Uncertain plants in files and in python-control: at values of the parameters they are the plant there."""

import control
import numpy as np
import pytest
from scipy.io import loadmat

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib.common.mat_file import variable_names

LIMITS = {"leg1.k.stiffness": 0.1, "platform.mass": (9.0, 12.0)}
OMEGA = np.array([40.0, 300.0, 900.0])


def plants():
    plant = library.cubic_hexapod(damping=20.0).linearize().uncertain(LIMITS)
    return {"plant": plant, "loop": plant.feedback(-1e3 * np.eye(3), ["x", "y", "z"], ["Fx", "Fy", "Fz"])}


def response(a, b, c, d):
    return np.stack([c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) + d for w in OMEGA], axis=2)


@pytest.mark.parametrize("case", ["plant", "loop"])
def test_mat_has_what_uss_takes(case, tmp_path):
    """M closed by (p - nominal) / half, as the script does it by ureal and lft, is the plant at these values."""
    plant = plants()[case]
    data = loadmat(mx.to_mat(plant, tmp_path / "plant.mat", outputs="[xyz]", inputs=["Fz"]), simplify_cells=True)
    known = data["uncertain"]
    assert known["Name"].tolist() == list(LIMITS)
    assert known["Variable"].tolist() == ["leg1_k_stiffness", "platform_mass"]
    assert known["Unit"].tolist() == ["N/m", "kg"]
    assert known["Range"].tolist() == [[9e5, 1.1e6], [9.0, 12.0]]
    values = np.array([1.05e6, 11.5])
    delta = np.repeat((values - known["Nominal"]) / known["Half"], known["Repetitions"].astype(int))
    r = len(delta)
    a, b, c, d = (data[key] for key in "ABCD")
    inner = np.diag(delta) @ np.linalg.inv(np.eye(r) - d[:r, :r] @ np.diag(delta))
    closed = [matrix + left @ inner @ right for matrix, left, right in
              ((a, b[:, :r], c[:r]), (b[:, r:], b[:, :r], d[:r, r:]), (c[r:], d[r:, :r], c[:r]),
               (d[r:, r:], d[r:, :r], d[:r, r:]))]  # fmt: skip
    truth = plant.at(dict(zip(LIMITS, values.tolist(), strict=True))).with_ports("[xyz]", "Fz")
    expected = truth.frequency_response(OMEGA)
    np.testing.assert_allclose(response(*closed), expected, atol=1e-9 * np.abs(expected).max())
    assert mx.from_mat(tmp_path / "plant.mat").inputs[r:] == ("Fz",)
    assert "ureal(p.Variable{k}" in (tmp_path / "load_plant.m").read_text()


@pytest.mark.parametrize("case", ["plant", "loop"])
@pytest.mark.parametrize("end", [0, 1])
def test_limits_are_at_one_in_python_control(case, end):
    plant = plants()[case]
    space, blocks = mx.to_control(plant, "modal", outputs=["x", "z"], inputs="Fz")
    assert blocks == plant.blocks
    assert space.input_labels == ["leg1:k:stiffness:w", "platform:mass:w1", "platform:mass:w2", "platform:mass:w3",
                                  "Fz"]  # fmt: skip
    assert space.output_labels[-2:] == ["x", "z"]
    r = sum(plant.blocks.values())
    closed = control.ss([], [], [], (2 * end - 1) * np.eye(r)).lft(space)
    truth = plant.at({name: limits[end] for name, limits in plant.limits.items()}).with_ports(["x", "z"], "Fz")
    expected = truth.frequency_response(OMEGA)
    found = response(closed.A, closed.B, closed.C, closed.D)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_matrices_of_symmetric_limits_stay():
    plant = library.cubic_hexapod().linearize().uncertain({"leg*.k.stiffness": 0.1})
    np.testing.assert_array_equal(mx.to_control(plant)[0].A, plant.nominal.state_space().A)


def test_names_of_ureal_differ():
    assert variable_names(("a.b", "a_b", "1.x", "s" * 80, "s" * 79, "ü.z")) == (
        "a_b", "a_b_2", "p_1_x", "s" * 60, f"{'s' * 56}_5", "p___z")  # fmt: skip


def test_what_cannot_be_exported_is_refused():
    plant = plants()["plant"]
    with pytest.raises(mv.ExportError, match="its parameters act in continuous time"):
        mx.to_control(plant, dt=1e-3)
    with pytest.raises(mv.ExportError, match=r"is uncertain.*plant\.at\(values\)"):
        mx.to_json(plant, "plant.json")
