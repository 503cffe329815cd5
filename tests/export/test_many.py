"""Batches and large systems: one export a variant, one file for all, and a choice of modes of what is held sparse."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
import mbsvib_export as mx
from tests.export.plants import same_bits
from tests.export.test_json import assert_same

VALUES = {"leg*.k.stiffness": np.linspace(1e6, 3e7, 5), "platform.mass": np.linspace(1.0, 2.0, 5)}


@pytest.fixture(scope="module")
def batch():
    return mv.library.stewart(ports="all").linearize(values=VALUES)


@pytest.fixture(scope="module")
def long():
    model = mv.library.chain(700, line=(0, 1, 0))
    model.add_output("a", "body300", "x", quantity="acceleration")
    model.add_force_output("root", "spring1", "rz")
    return model.linearize()


@pytest.mark.parametrize("realization", ["physical", "modal"])
def test_python_control_gets_a_list(batch, realization):
    plants = mx.to_control(batch, realization)
    assert len(plants) == len(batch) == 5
    for plant, system in zip(plants, batch, strict=True):
        single = mx.to_control(system, realization)
        assert all(same_bits(getattr(plant, key), getattr(single, key)) for key in "ABCD")
        assert plant.input_labels == single.input_labels
        assert plant.output_labels == single.output_labels


@pytest.mark.parametrize("realization", ["physical", "modal"])
def test_one_file_for_all_variants(batch, realization, tmp_path):
    path = mx.to_npz_batch(batch, tmp_path / "legs.npz", realization)
    data = mx.from_npz_batch(path)
    assert len(data) == 5
    assert set(data.values) == set(batch.parameters)
    for name, values in batch.parameters.items():
        assert same_bits(data.values[name], values)
    for item, system in zip(data.systems, batch, strict=True):
        assert_same(item, system, realization)
    assert "5 variants of" in repr(data)


def test_numpy_alone_reads_it(batch, tmp_path):
    with np.load(mx.to_npz_batch(batch, tmp_path / "legs.npz")) as arrays:
        assert arrays["K"].shape == (5, 6, 6)
        assert arrays["state_space.A"].shape == (5, 12, 12)
        assert arrays["body_motion"].shape == (5, len(batch.bodies), 6, 6)
        assert arrays["inputs"].tolist() == list(batch.inputs)
        assert_allclose(arrays["values"][arrays["parameters"].tolist().index("platform.mass")], VALUES["platform.mass"])
        assert all(array.dtype != object for array in arrays.values())


@pytest.mark.parametrize("name", ["to_json", "to_npz", "to_scipy"])
def test_a_batch_is_refused_where_one_system_goes_in(batch, name, tmp_path):
    words = {"path": tmp_path / "file"} if name == "to_npz" else {}
    with pytest.raises(mv.MbsvibError, match=f"{name}: 'stewart' is a batch of 5 variants; export them one by one, "
                                             rf"{name}\(batch\[i\]\)"):  # fmt: skip
        getattr(mx, name)(batch, **words)
    with pytest.raises(mv.MbsvibError, match="to_frd: 'stewart' is a batch of 5 variants"):
        mx.to_frd(batch, [1.0])


@pytest.mark.parametrize("name", ["to_control", "to_json", "to_npz", "to_scipy"])
def test_what_is_held_sparse_is_refused_with_the_way_out(long, name, tmp_path):
    words = {"path": tmp_path / "file"} if name == "to_npz" else {}
    message = (rf"{name}: '.*' has 700 degrees of freedom and is held sparse; export some of its modes, "
               rf"{name}\(system.reduced\(20, correction=True\)\)")  # fmt: skip
    with pytest.raises(mv.MbsvibError, match=message):
        getattr(mx, name)(long, **words)


def test_a_choice_of_modes_with_names_and_static_correction(long):
    """The response is that of the whole within the error that truncation_error states."""
    small = long.reduced(12, correction=True)
    plant = mx.to_control(small, "modal")
    assert plant.nstates == 24
    assert tuple(map(mx.SignalNames.to_mbsvib, plant.output_labels)) == long.outputs
    omega = 2 * np.pi * np.geomspace(0.2, 5, 12) * long.modes(1).frequencies[0]
    full, result = long.frequency_response(omega), plant(1j * omega)
    size = np.abs(full).max(axis=2, keepdims=True)
    error = long.truncation_error(small, omega)
    assert_allclose(np.abs(result - full) / size, error, rtol=1e-3, atol=1e-8)
    motion = [i for i, name in enumerate(long.outputs) if name in ("x", "y", "root")]
    assert error[motion].max() < 1e-3


def test_response_data_of_the_whole(long):
    omega = [0.01, 0.1]
    data = mx.to_frd(long, omega)
    assert_allclose(data.frdata, long.frequency_response(omega), rtol=1e-15)


def test_files_of_a_choice_of_modes(long, tmp_path):
    small = long.reduced(3)
    data = mx.from_npz(mx.to_npz(small, tmp_path / "chain.npz"))
    assert data.coordinates == ("mode1", "mode2", "mode3")
    assert same_bits(data.K, small.K)
    assert mx.from_json(mx.to_json(small)).inputs == long.inputs


def test_files_of_the_wrong_kind(batch, tmp_path):
    single, many = mx.to_npz(batch[0], tmp_path / "one"), mx.to_npz_batch(batch, tmp_path / "many")
    with pytest.raises(mv.MbsvibError, match="A single system is read by from_npz"):
        mx.from_npz_batch(single)
    with pytest.raises(mv.MbsvibError, match="format = 'mbsvib-batch'"):
        mx.from_npz(many)
    with pytest.raises(mv.MbsvibError, match="cannot be read"):
        mx.from_npz_batch(tmp_path / "none")
    (tmp_path / "text").write_text("no archive")
    with pytest.raises(mv.MbsvibError, match=r"no \.npz file of to_npz_batch, or a damaged one"):
        mx.from_npz_batch(tmp_path / "text")
    with pytest.raises(mv.MbsvibError, match="expected a Batch"):
        mx.to_npz_batch(batch[0], tmp_path / "file")
