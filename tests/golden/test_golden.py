"""Every golden scene has the results that it had when its numbers were written, see ``tests/golden/__main__.py``."""

import numpy as np
import pytest

import mbsvib as mv
from tests.golden import store
from tests.golden.answers import ACCURACY, answers, blocks, differences, has_zeros, names

INDEX = store.index()
# those that take longest: many coordinates, or modes whose rounding makes them be computed in more digits
SLOW = (
    "hunt_100", "hunt_101", "hunt_109", "hunt_11", "hunt_110", "hunt_111", "hunt_120", "hunt_123", "hunt_132",
    "hunt_141", "hunt_156", "hunt_17", "hunt_187", "hunt_189", "hunt_192", "hunt_205", "hunt_211", "hunt_222",
    "hunt_225", "hunt_233", "hunt_242", "hunt_245", "hunt_256", "hunt_274", "hunt_288", "hunt_294", "hunt_3",
    "hunt_316", "hunt_324", "hunt_328", "hunt_55", "hunt_57", "hunt_67", "hunt_76", "hunt_98", "library_four_bar",
    "library_slider_crank", "library_trifilar_pendulum", "library_wafer_stage", "loaded_2", "loaded_loop_19",
    "planar_4", "planar_5", "spatial_0", "spatial_floating_31", "spatial_loop_12", "spatial_loop_14",
    "spatial_loop_22", "spatial_loop_29",
)  # fmt: skip


def test_files_and_numbers_belong_together():
    assert list(INDEX) == list(store.scenes())


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in INDEX])
def test_scene(name):
    entry = INDEX[name]
    system, arrays = answers(mv.load(store.scenes()[name]), entry["question"])
    for key, listed in names(system).items():
        # the order in which groups of loops are solved, and redundant rows found, is of no account
        order = sorted if key == "redundant" else list
        assert order(listed) == order(entry[key]), key
    assert list(arrays) == list(entry["arrays"])
    for key, expected in store.expected(name, entry).items():
        array, stored = arrays[key], entry["arrays"][key]
        assert array.values.shape == expected.shape, key
        tolerance = stored.get("tolerance", ACCURACY[array.kind])
        off = np.array(differences(array, expected, tolerance))
        allowed = np.broadcast_to(tolerance, off.shape)
        assert np.all(off <= allowed), described(key, array, expected, off, allowed)
        if "zeros" not in stored:
            assert has_zeros(array.values, expected), f"{key}: entries that were exactly 0 are not"


def described(key, array, expected, off, allowed):
    """What differs, by how much, and what it is and was."""
    worst = int(np.argmax(off / allowed))
    text = f"{key}: differs by {off[worst]:.1e} of the largest entry, allowed are {allowed[worst]:.1e}"
    if array.columns is None:
        return f"{text}\n{array.values}\nwas\n{expected}"
    block = list(blocks(array))[worst]
    return f"{text}\n{array.values[block]}\nwas\n{expected[block]}"
