"""How far out of balance a pose may be: 1e-9 of the forces, or of the moments, that should cancel; in any units."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations.statics import balance
from mbsvib.linalg.rank import BALANCE


def slide(off, size):
    """A weight on a spring; the force is off by a share."""
    model = mv.Model("slide", gravity=(0, 0, -9.81))
    model.add_body("b", 3.0, np.full(3, size**2), (size, 2 * size, 0))
    model.add_joint("rail", "prismatic", "ground", "b")
    model.add_bushing("k", "ground", "b", (size, 2 * size, 0), (0, 0, 50.0, 0, 0, 0),
                      preload=(0, 0, 3.0 * 9.81 * (1 + off), 0, 0, 0))  # fmt: skip
    return model


def pendulum(off, size):
    """A weight held level by a spiral spring; the moment is off by a share."""
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("b", 3.0, np.full(3, size**2), (size, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "b", (0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (0, 0, 0, 0, 50.0, 0),
                      preload=(0, 0, 0, 0, -3.0 * 9.81 * size * (1 + off), 0))  # fmt: skip
    return model


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("make", [slide, pendulum])
def test_the_limit_of_balance(make, size):
    for off in (1e-10, -1e-10):
        make(off, size).linearize()
    for off in (1e-8, -1e-8):
        with pytest.raises(mv.EquilibriumError, match=r"'b'.*5\.0e-09"):
            make(off, size).linearize()


@pytest.mark.parametrize("first", ["turner", "slider"])
@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize(("force", "torque", "body", "missing", "share"), [
    (-15.0, -40.0, "slider", 5.0, 5.0 / 35.0),
    (-20.0, -30.0, "turner", 10.0, 10.0 / 70.0),
    (-16.0, -30.0, "turner", 10.0, 10.0 / 70.0),
    (-10.0, -35.0, "slider", 10.0, 10.0 / 30.0),
])  # fmt: skip
def test_the_share_is_that_of_the_forces_on_the_body(first, method, force, torque, body, missing, share):
    """A load of 20 N on one body and one of 40 N m on another, each held by a preload or not quite."""
    model = mv.Model("two")
    for name in (first, "slider" if first == "turner" else "turner"):
        kind, preload = {"slider": ("prismatic", (0, 0, -force, 0, 0, 0)),
                         "turner": ("revolute", (0, 0, 0, 0, 0, -torque))}[name]  # fmt: skip
        model.add_body(name, 1.0, (1, 1, 1))
        model.add_joint(f"{name} joint", kind, "ground", name, (0, 0, 0))
        model.add_bushing(f"{name} k", "ground", name, (0, 0, 0), (0, 0, 7.0, 0, 0, 9.0), preload=preload)
    model.add_load("force", "slider", force=(0, 0, -20.0))
    model.add_load("torque", "turner", torque=(0, 0, -40.0))
    with pytest.raises(mv.EquilibriumError, match=rf"\({share:.1e} of the forces") as caught:
        model.linearize(method=method)
    assert caught.value.body == body
    assert caught.value.missing == pytest.approx(missing)


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_what_springs_make_of_rounded_positions_is_balance(method):
    """64 roundings of 2 m against 1e3 N/m are 3e-11 N: 1e-13 N of preload is none of a force, 1e-8 N is."""

    def pressed(preload):
        model = mv.Model("pressed")
        model.add_body("b", 3.0, (0.1, 0.2, 0.3), (1.0, 2.0, 0))
        model.add_joint("rail", "prismatic", "ground", "b")
        model.add_bushing("k", "ground", "b", (1.0, 2.0, 0), (0, 0, 1e3, 0, 0, 0), preload=(0, 0, preload, 0, 0, 0))
        return model.linearize(method=method)

    assert pressed(1e-13).dof == 1
    with pytest.raises(mv.EquilibriumError, match="unbalanced force on body 'b'"):
        pressed(1e-8)


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_coordinates_that_loops_tie_together_are_in_balance_together(method):
    """What springs leave of the weight of a heavy cart is not compared with that of a light one fixed to it."""

    def pair(off):
        model = mv.Model("pair", gravity=(0, 0, -10.0))
        for name, mass, x in (("heavy", 10.0, 50.0), ("light", 1e-3, 50.5)):
            model.add_body(name, mass, (0.1, 0.1, 0.1), (x, 0, 0))
            model.add_joint(f"{name} rail", "prismatic", "ground", name, axis=(0, 0, 1))
        model.add_joint("bolt", "fixed", "heavy", "light", (50.25, 0, 0))
        model.add_bushing("spring", "ground", "heavy", (50, 0, 0), (0, 0, 1e3, 0, 0, 0), preload=(0, 0, off, 0, 0, 0))
        return model.linearize(method=method)

    assert pair(100.01 + 1e-10).dof == 1
    with pytest.raises(mv.EquilibriumError, match="unbalanced force"):
        pair(100.01 + 1e-5)


def test_what_moves_alone_is_in_balance_though_others_move_by_rounding():
    """Loops that let an unloaded body move alone leave the others 1e-16 of its motion, which their forces work on."""
    motion = np.zeros((2, 6, 1))
    motion[0, 2], motion[1, :3, 0] = 1.0, (1e-16, -2e-16, 1e-16)
    wrench = np.zeros((6, 2))
    wrench[:3, 1] = 20.0, 10.0, -30.0
    residual, size = balance(wrench, np.array([[0.0, 40.0], [0.0, 0.0]]), motion, reach=1.0)
    assert 0.0 < abs(residual[0]) < BALANCE * size[0]
    motion[1] = 0.0
    assert not np.any(balance(wrench, np.array([[0.0, 40.0], [0.0, 0.0]]), motion, reach=1.0))
