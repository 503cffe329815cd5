"""Constraints that are redundant in one pose only are refused: as a model, sparse, and as a variant by its index."""

import numpy as np
import pytest

import mbsvib as mv


def cardan():
    """Two shafts, joined by two equal universal joints: the second is redundant in all poses."""
    model = mv.Model("cardan")
    for name, axis in (("s1", (1.0, 0, 0)), ("s2", (0.8, 0.6, 0))):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), axis)
        model.add_joint(f"{name}.bearing", "revolute", "ground", name, (0, 0, 0), axis=axis)
        model.add_bushing(f"{name}.k", "ground", name, (0, 0, 0), (0, 0, 0, 5, 5, 5))
    for name in ("u1", "u2"):
        model.add_joint(name, "universal", "s1", "s2", (0, 0, 0), axis=(0, 0.3, 1), axis2=(-0.48, 0.64, 0.5))
    return model


# the normal of both axes: turned about it, the second joint asks for the same rates, here but in no pose nearby
NORMAL = np.cross((0, 0.3, 1), (-0.48, 0.64, 0.5))
TURN = {f"u2.orientation.{way}": 0.4 * float(v) for way, v in zip(("rx", "ry", "rz"), NORMAL, strict=True)}
TOLD = r"singular pose. 1 of (their )?8 constraint rows are independent here, 2 in neighbouring poses"


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_a_universal_joint_that_is_redundant_in_one_pose(method):
    words = {"cut": ["u1", "u2"], "method": method}
    assert cardan().linearize(**words).dof == 1
    with pytest.raises(mv.SingularPoseError, match=TOLD):
        cardan().with_values(TURN).linearize(**words)


@pytest.mark.parametrize("at", [0, 1, 2])
def test_one_variant_of_three(at):
    values = {name: np.where(np.arange(3) == at, value, 0.0) for name, value in TURN.items()}
    with pytest.raises(mv.SingularPoseError, match=f"^variant {at}: .*{TOLD}"):
        cardan().linearize(values=values, cut=["u1", "u2"])
    both = {name.replace("u2", joint): np.array([0.0, value, -value]) for name, value in TURN.items()
            for joint in ("u1", "u2")}  # fmt: skip
    batch = cardan().linearize(values=both, cut=["u1", "u2"])
    for i in range(3):
        single = cardan().with_values({name: array[i] for name, array in both.items()})
        system = single.linearize(cut=["u1", "u2"], independent=batch.coordinates)
        np.testing.assert_allclose(batch.K[i], system.K, rtol=1e-12)
        np.testing.assert_allclose(batch.M[i], system.M, rtol=1e-12)
