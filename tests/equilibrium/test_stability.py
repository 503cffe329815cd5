"""Reports of equilibria say whether these are stable, and along what they are not."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.library import pendulum_chain
from tests.support.random_models import KINDS, spatial

G = 9.81


def upright(bodies=1, spring=0.0, free=("rx", "ry", "rz")):
    """Rods on ball joints that stand on each other, in balance upright."""
    model = mv.Model("upright", gravity=(0, 0, -G))
    for k in range(bodies):
        below = f"rod{k - 1}" if k else "ground"
        model.add_body(f"rod{k}", 1.0, (0.02, 0.02, 0.01), position=(0, 0, k + 0.5))
        model.add_joint(f"ball{k}", None, below, f"rod{k}", (0, 0, k), free=free)
        model.add_bushing(f"spring{k}", below, f"rod{k}", (0, 0, k), (0, 0, 0, 100.0, spring, 100.0))
    return model


@pytest.mark.parametrize("bodies", [1, 2, 3])
def test_an_upright_chain_falls_along_as_many_directions_as_it_has_hinges(bodies):
    """Every link falls about y, about x springs hold it."""
    result = upright(bodies).equilibrium(report=True)
    assert not result.stable
    assert len(result.unstable_modes) == bodies
    modes = result.model.linearize().modes()
    assert (modes.pairs[np.array(result.unstable_modes) - 1].real.max(axis=1) > 1.0).all()
    text = str(result)
    most = modes.strongest()
    assert f"UNSTABLE: {bodies} unstable mode" in text
    assert ", ".join(f"{k} (largest motion: {' '.join(most[k - 1])})" for k in result.unstable_modes) in text


def test_springs_of_more_than_its_weight_hold_it():
    """k > m g h at the hinge: the critical stiffness is 1 kg times 9.81 m/s^2 times 0.5 m."""
    for share, stable in ((0.99, False), (1.01, True)):
        result = upright(spring=share * G * 0.5).equilibrium(report=True)
        assert result.stable is stable
        assert ("UNSTABLE" not in str(result)) is stable
        assert result.unstable_modes == (() if stable else (1,))


def test_preloads_hold_a_pose_that_is_unstable():
    """A bar between two springs that push along it: their preloads balance, whatever it does sideways."""
    model = mv.Model("strut")
    model.add_body("bar", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("slide", None, "ground", "bar", (0, 0, 0), free=("x", "y"))
    for name, x in (("left", -1.0), ("right", 1.0)):
        model.add_spring(name, "ground", "bar", (x, 0, 0), (0, 0, 0), 50.0, preload=-100.0)
    result = model.equilibrium(preload=True, report=True)
    retained = model.equilibrium(report=True)
    assert result.stable
    assert retained.unstable_modes == (1,)
    assert "UNSTABLE: 1 unstable mode of model.linearize().modes(): 1 (largest motion: bar y)" in str(retained)


def test_stable_and_neutral_ones():
    assert "  stable\n" in str(pendulum_chain(2).equilibrium(report=True))
    model = upright(spring=20.0, free=("rx", "ry", "rz"))
    model = model.replace("spring0", stiffness=(0, 0, 0, 100.0, 20.0, 0.0))
    assert "  stable except for 1 rigid-body mode at 0 Hz\n" in str(model.equilibrium(report=True))


def test_what_is_only_rounding_does_not_grow():
    """Modes that no damper reaches have real parts of the size of rounding, of either sign."""
    model = spatial(17574, bodies=3, ports=False, negative=True, damped=True, kinds=KINDS)
    modes = model.linearize().modes()
    assert (np.abs(modes.damping_ratios) < 1e-12).sum() == 5, "parts without dampers"
    assert modes.stable
    assert not modes.growing.any()
    assert "Unstable" not in str(modes)
    assert model.equilibrium(report=True).stable


def test_a_follower_force_makes_a_column_flutter():
    """Two links that a force along the upper one pushes (Ziegler): no direction gives way, and yet motions grow."""
    def column(force):
        model = mv.Model("Ziegler")
        for k, mass in enumerate((2.0, 1.0)):
            below = f"link{k - 1}" if k else "ground"
            model.add_body(f"link{k}", mass, (1e-9, 1e-9, 1e-9), position=(0, 0, k + 1.0))
            model.add_joint(f"hinge{k}", "revolute", below, f"link{k}", (0, 0, k), axis=(0, 1, 0))
            model.add_bushing(f"spring{k}", below, f"link{k}", (0, 0, k), (0, 0, 0, 0, 1.0, 0))
        model.add_load("thrust", "link1", force=(0, 0, -force), position=(0, 0, 2.0), follower=True)
        return model.equilibrium(report=True)

    critical = 3.5 - np.sqrt(2.0)
    assert column(0.99 * critical).stable
    assert not column(1.01 * critical).stable
