"""A finite element payload on a hexapod, reduced, as FMU: 906 coordinates become twelve.

A printed tower of solid elements stands on the platform of a hexapod. Its matrices stay sparse: 25 nodes of its foot
find the ports of the platform by their positions, and move with it. The whole is reduced to twelve motions that match
its responses about three frequencies, and exported for co-simulation. The reduced curve is the full one up to 150 Hz;
a rigid payload of the same mass is 12 % off at the first resonance, and misses the bending of the tower at 137 Hz.
"""

from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy.sparse as sp

import mbsvib as mv
import mbsvib_export as mx

CELLS, SIZE, FOOT = np.array([4, 4, 12]), np.array([0.03, 0.03, 0.03]), np.array([-0.06, -0.06, 0.05])
E, NU, RHO = 1.5e8, 0.35, 1200.0


def brick():
    """Stiffness and mass of a solid element with eight nodes, by two Gauss points along each axis."""
    corners, mu = np.array(list(product((-1, 1), repeat=3))), E / (2 * (1 + NU))
    law = np.diag([2 * mu] * 3 + [mu] * 3)
    law[:3, :3] += E * NU / ((1 + NU) * (1 - 2 * NU))
    stiffness, mass = np.zeros((24, 24)), np.zeros((24, 24))
    for point in np.array(list(product((-1, 1), repeat=3))) / np.sqrt(3):
        terms = (1 + corners * point) / 2
        shape = terms.prod(axis=1)
        slope = np.array([corners[:, k] / SIZE[k] * shape / terms[:, k] for k in range(3)])
        strain = np.zeros((6, 8, 3))
        strain[range(3), :, range(3)] = slope
        for row, (i, j) in enumerate(((0, 1), (1, 2), (0, 2)), 3):
            strain[row, :, i], strain[row, :, j] = slope[j], slope[i]
        stiffness += strain.reshape(6, 24).T @ law @ strain.reshape(6, 24)
        mass += RHO * np.kron(np.outer(shape, shape), np.eye(3))
    return SIZE.prod() / 8 * stiffness, SIZE.prod() / 8 * mass


def tower():
    """The sparse system of the tower with ports at the nodes of its foot and at its tip, and where these are."""
    nodes = np.array(list(np.ndindex(*(CELLS + 1))))
    cells = np.array(list(np.ndindex(*CELLS)))[:, None] + list(np.ndindex(2, 2, 2))
    at = (3 * np.ravel_multi_index(cells.T, CELLS + 1).T[..., None] + np.arange(3)).reshape(len(cells), 24)
    i, j = np.repeat(at, 24, axis=1).ravel(), np.tile(at, 24).ravel()
    K, M = (sp.coo_matrix((np.tile(one.ravel(), len(cells)), (i, j))).tocsc() for one in brick())
    ports = {f"n{k}": k for k, node in enumerate(nodes) if node[2] == 0} | {"tip": len(nodes) - 1}
    names = [f"{name}.{axis}" for name in ports for axis in "xyz"]
    select = sp.eye(K.shape[0]).tocsr()[[3 * k + axis for k in ports.values() for axis in range(3)]]
    places = {f"tower.{name}": FOOT + SIZE * nodes[k] for name, k in ports.items()}
    return mv.System.from_matrices(M, 5e-5 * K, K, select.T, select, inputs=names, outputs=names), places, M.sum() / 3


fe, places, mass = tower()
stage = mv.library.cubic_hexapod(stiffness=8e5, damping=40.0)
for name, place in places.items():
    if name != "tower.tip":
        stage.add_port(name.replace("tower.n", "foot"), "platform", place)
whole = mv.assemble({"stage": stage, "tower": fe}, [("stage.foot*", "tower.n*", "rigid", ("x", "y", "z"))],
                    positions=places)["tower.tip.x", "stage.Fx"]
small = whole.reduced(12, near=(0.0, 60.0, 120.0), method="krylov")
omega = 2 * np.pi * np.geomspace(5.0, 200.0, 300)
full, few = (system.frequency_response(omega)[0, 0] for system in (whole, small))
off = np.abs(few - full)[omega < 2 * np.pi * 150.0].max() / np.abs(full).max()
print(f"{whole.dof} coordinates become {small.dof}; error up to 150 Hz {off:.1e} of the largest response")
with TemporaryDirectory() as folder:
    unit = mx.to_fmu(small, Path(folder) / "tower.fmu")
    print(mx.check_export(unit, small, run=True))
assert off < 1e-3

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    rigid = mv.library.cubic_hexapod(stiffness=8e5, damping=40.0)
    middle = FOOT + SIZE * CELLS / 2
    rigid.add_body("box", mass, mass / 12 * ((SIZE * CELLS) @ (SIZE * CELLS) - (SIZE * CELLS) ** 2), position=middle)
    rigid.add_joint("bolts", "fixed", "platform", "box", position=FOOT)
    rigid.add_output("tip", "box", "x", position=places["tower.tip"])
    stiff = rigid.linearize()["tip", "Fx"].frequency_response(omega)[0, 0]
    _, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    for response, line, label in ((full, "-", f"{whole.dof} coordinates"), (stiff, ":", "rigid payload"),
                                  (few, "k--", f"{small.dof} coordinates, in the FMU")):
        axes.loglog(omega / (2 * np.pi), np.abs(response), line, label=label)
    axes.set(xlabel="frequency [Hz]", ylabel="tip x per force on the platform [m/N]")
    axes.set_xticks([5, 10, 20, 50, 100, 200], ["5", "10", "20", "50", "100", "200"])
    axes.legend()
    plt.show()
