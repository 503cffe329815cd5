"""Bodies on springs: masses on an inclined rail, the quarter car, and an engine on its mounts."""

from __future__ import annotations

from itertools import product

from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.library._pendulums import FREE_FALL


def inclined_chain(
    n: int = 8, *, mass: float = 10.0, stiffness: float = 1e5, damping: float = 0.0,
    line: ArrayLike = (4.0, 3.0, 0.0), spacing: float = 1.0,
) -> Model:  # fmt: skip
    """Build n equal masses on an inclined rail, n + 1 equal springs between them and to the ground at both ends.

    The eigenfrequencies do not know about the inclination:

        f_i = (1/pi) sqrt(k/m) sin(i pi / (2 (n + 1))),   i = 1 ... n.

    Bodies ``mass1`` ..., prismatic joints ``rail1`` ..., springs ``spring0`` ... ``spring<n>``. Input ``f``: force
    along the rail on the first mass; outputs ``mass1.d`` ...: displacements along the rail.

    Parameters
    ----------
    n : int
        Number of masses.
    mass : float
        Of each [kg].
    stiffness, damping : float
        Of each spring [N/m, N s/m].
    line : array-like, shape (3,)
        Direction of the rail, world axes.
    spacing : float
        Distance between neighbours [m]; chosen, it changes nothing.

    Returns
    -------
    Model
        The chain, n degrees of freedom.

    Raises
    ------
    ModelError
        If n < 1, or a value is refused by the part it is for.

    Source: Commission VPCS, "Guide de validation des progiciels de calcul de structures" (AFNOR, 1990), SDLD02.
    """
    number = check.count(n, "inclined_chain", "n")
    x, y, z = along = check.axis(line, "inclined_chain", "line")
    distance = check.number(spacing, "inclined_chain", "spacing", "the distance between neighbours [m]")
    points = [(s * x, s * y, s * z) for s in (distance * i for i in range(number + 2))]
    model = Model("inclined_chain")
    for i in range(1, number + 1):
        # bodies do not rotate: the moment of inertia is arbitrary
        model.add_body(f"mass{i}", mass, (1.0, 1.0, 1.0), points[i])
        model.add_joint(f"rail{i}", "prismatic", "ground", f"mass{i}", points[i], axis=along)
    names = ["ground", *model.bodies, "ground"]
    for i in range(number + 1):
        # with a single mass both springs have the same two ends; the second then runs against the rail
        model.add_spring(f"spring{i}", names[i], names[i + 1], points[i], points[i + 1], stiffness, damping)
    model.add_input("f", "mass1", along)
    for name in names[1:-1]:
        model.add_output(f"{name}.d", name, along)
    return model


def quarter_car(
    *, body_mass: float = 317.5, wheel_mass: float = 45.4, suspension_stiffness: float = 22e3,
    suspension_damping: float = 0.0, tyre_stiffness: float = 192e3, tyre_damping: float = 0.0,
) -> Model:  # fmt: skip
    """Build a quarter car with an actuator in its suspension, on a road that moves: 2 degrees of freedom.

    The wheel slides along z against the ground (joint ``hub``), the body along z against the wheel (joint ``strut``);
    the ground is the road. Inputs: ``road``, the road's vertical acceleration; ``actuator``, a force that pushes
    body and wheel apart; ``load``, a force on the body. Outputs: displacement of the body ``body.z`` and of the wheel
    ``wheel.z`` relative to the road, ``travel`` of the suspension, absolute accelerations ``body.az`` and
    ``wheel.az``, and the force in the tyre ``tyre.force``.

    Without dampers, as is the default, the eigenfrequencies are the roots of a biquadratic equation, 7.87863 and
    68.70862 rad/s; a passenger car has 1 to 2 kN s/m in its suspension.

    Parameters
    ----------
    body_mass, wheel_mass : float
        Sprung and unsprung mass [kg].
    suspension_stiffness, suspension_damping : float
        Between wheel and body [N/m, N s/m].
    tyre_stiffness, tyre_damping : float
        Between road and wheel [N/m, N s/m].

    Returns
    -------
    Model
        The quarter car: bodies ``body`` and ``wheel``, springs ``suspension`` and ``tyre``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.
    """
    model = Model("quarter_car")
    # bodies do not rotate: the moments of inertia are plausible for a car but have no effect
    model.add_body("wheel", wheel_mass, (1.0, 1.7, 1.0), (0.0, 0.0, 0.3))
    model.add_body("body", body_mass, (100.0, 100.0, 100.0), (0.0, 0.0, 0.8))
    model.add_joint("hub", "prismatic", "ground", "wheel", (0.0, 0.0, 0.3))
    model.add_joint("strut", "prismatic", "wheel", "body", (0.0, 0.0, 0.5))
    model.add_spring("tyre", "ground", "wheel", (0.0, 0.0, 0.0), (0.0, 0.0, 0.3), tyre_stiffness, tyre_damping)
    model.add_spring("suspension", "wheel", "body", (0.0, 0.0, 0.3), (0.0, 0.0, 0.7),
                     suspension_stiffness, suspension_damping)  # fmt: skip
    model.add_base_motion("road", "z")
    model.add_input("actuator", "body", "z", relative_to="wheel")
    model.add_input("load", "body", "z")
    model.add_output("body.z", "body", "z")
    model.add_output("wheel.z", "wheel", "z")
    model.add_output("travel", "body", "z", relative_to="wheel")
    model.add_output("body.az", "body", "z", quantity="acceleration")
    model.add_output("wheel.az", "wheel", "z", quantity="acceleration")
    model.add_force_output("tyre.force", "tyre")
    return model


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
    a = check.positive(half_length, "engine_on_mounts", "half_length", "m")
    b = check.positive(half_width, "engine_on_mounts", "half_width", "m")
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
