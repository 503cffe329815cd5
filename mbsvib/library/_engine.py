"""An engine on its mounts."""

from __future__ import annotations

from itertools import product

from mbsvib.api.model import Model
from mbsvib.library._families import positive
from mbsvib.library._pendulums import FREE_FALL


def engine_on_mounts(
    *, mass: float = 180.0, inertia: tuple[float, ...] = (6.0, 14.0, 12.0), half_length: float = 0.35,
    half_width: float = 0.25, drop: float = 0.12, vertical_stiffness: float = 2.5e5, lateral_stiffness: float = 1.2e5,
    loss: float = 1e-3, gravity: float | None = FREE_FALL,
) -> Model:  # fmt: skip
    """Build an engine with its gearbox on four rubber mounts that carry its weight: 6 degrees of freedom.

    Up and down and about z it moves alone: omega^2 = 4 kz / m and 4 kl (a^2 + b^2) / Iz. Along the crankshaft it
    pitches as well, across it rolls, as the mounts lie below the centre of mass.

    Parameters
    ----------
    mass : float
        Of the engine [kg].
    inertia : tuple of 3 floats
        Its moments [kg m^2] about x (along the crankshaft), y and z (up).
    half_length, half_width : float
        From the middle to the mounts, along x and y [m]: a and b.
    drop : float
        How far the mounts lie below the centre of mass [m].
    vertical_stiffness, lateral_stiffness : float
        Of a mount along z, and along x and y [N/m]: kz and kl.
    loss : float
        Damping over stiffness of the mounts [s].
    gravity : float, optional
        Acceleration of free fall [m/s^2], along -z; the mounts are preloaded by a quarter of the weight each. None: the
        weight does not matter.

    Returns
    -------
    Model
        Body ``engine`` at the origin, bushings ``mount1`` to ``mount4``; inputs ``roll`` (the torque about the
        crankshaft, to which the cylinders' gas forces add up) and ``shake`` (what pistons lack in balance, along z),
        outputs ``rx`` and ``z`` of the engine and the forces along z in the mounts, ``mount1.fz`` ...

    Raises
    ------
    ModelError
        If a distance is not positive, or a value is refused by the part it is for.
    """
    a = positive(half_length, "engine_on_mounts", "half_length", "m")
    b = positive(half_width, "engine_on_mounts", "half_width", "m")
    stiffness = (lateral_stiffness, lateral_stiffness, vertical_stiffness, 0.0, 0.0, 0.0)
    model = Model("engine_on_mounts", gravity=None if gravity is None else (0.0, 0.0, -gravity))
    model.add_body("engine", mass, inertia)
    mount_preload = None if gravity is None else (0.0, 0.0, 0.25 * mass * gravity, 0.0, 0.0, 0.0)
    for k, (x, y) in enumerate(product((-a, a), (-b, b)), start=1):
        model.add_bushing(f"mount{k}", "ground", "engine", (x, y, -drop), stiffness, [loss * s for s in stiffness],
                          preload=mount_preload)  # fmt: skip
    model.add_input("roll", "engine", "rx")
    model.add_input("shake", "engine", "z")
    model.add_output("rx", "engine", "rx")
    model.add_output("z", "engine", "z")
    for k in range(1, 5):
        model.add_force_output(f"mount{k}.fz", f"mount{k}", "z")
    return model
