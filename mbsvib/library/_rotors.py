"""Bodies that spin: a rotor in its stator, and the top that sleeps."""

from __future__ import annotations

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.library._pendulums import FREE_FALL

ORIGIN = (0.0, 0.0, 0.0)


def rotor_stator(speed: float = 10.0, *, height: float = 0.75) -> Model:
    """Build a rotor in a stator on soft mounts, whose whirls depend on the speed: 7 degrees of freedom.

    With x + i y and W the speed, (1500 s^2 + s + 1000)(1281.25 s^2 + (10 -+ 1000 i W) s + 1e4) - 975^2 s^4 = 0 for the
    whirls; up and down 1500 s^2 + s + 1000 = 0, of the stator about z 10 s^2 + 100 s + 1e5 = 0; and the rotor's own
    turning, which nothing holds. ``mbsvib.studies.campbell.campbell`` follows them over the speed.

    Parameters
    ----------
    speed : float
        Of the rotor [rad/s], about z.
    height : float
        Of the rotor's centre of mass above the bearing [m].

    Returns
    -------
    Model
        Bodies ``stator`` and ``rotor``, joint ``bearing``, bushing ``mount``, rotor ``spin``; input ``unbalance``, a
        force on the rotor along x, outputs ``rotor.x`` and ``rotor.y``, ``stator.x``, and the force in the bearing,
        ``bearing.fx``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.

    Source: D. Negrut, J. L. Ortiz, "A practical approach for the linearization of the constrained multibody dynamics
    equations", ASME J. Comput. Nonlinear Dynam. 1 (2006) 230-239, for the data.
    """
    model = Model("rotor_stator")
    model.add_body("stator", 200.0, (50.0, 50.0, 10.0))
    model.add_body("rotor", 1300.0, (500.0, 500.0, 1000.0), (0.0, 0.0, height))
    model.add_joint("bearing", "revolute", "stator", "rotor", ORIGIN, axis=(0.0, 0.0, 1.0))
    model.add_bushing("mount", "ground", "stator", ORIGIN, (1e3, 1e3, 1e3, 1e4, 1e4, 1e5),
                      (1.0, 1.0, 1.0, 10.0, 10.0, 100.0))  # fmt: skip
    model.add_rotor("spin", "rotor", speed, (0.0, 0.0, 1.0))
    model.add_input("unbalance", "rotor", "x")
    model.add_output("rotor.x", "rotor", "x")
    model.add_output("rotor.y", "rotor", "y")
    model.add_output("stator.x", "stator", "x")
    model.add_force_output("bearing.fx", "bearing", "x")
    return model


def sleeping_top(
    speed: float = 200.0, *, mass: float = 0.5, height: float = 0.04, axial: float = 5e-4, across: float = 4e-4,
    gravity: float = FREE_FALL,
) -> Model:  # fmt: skip
    """Build a top that spins upright on its tip: 3 degrees of freedom.

    With x + i y, A = I + m h^2 the moment about the tip and W the speed, A s^2 - i Ia W s - m g h = 0: the top sleeps,
    upright and stable, where (Ia W)^2 > 4 A m g h, and falls where it spins more slowly.

    Parameters
    ----------
    speed : float
        About the vertical [rad/s].
    mass : float
        Of the top [kg].
    height : float
        Of its centre of mass above the tip [m].
    axial, across : float
        Its moments of inertia about its axis, and across that about the centre of mass [kg m^2].
    gravity : float
        Acceleration of free fall [m/s^2], along -z.

    Returns
    -------
    Model
        Body ``top``, joint ``tip`` at the origin, rotor ``spin``; input ``torque`` about x, outputs ``rx`` and ``ry``.

    Raises
    ------
    ModelError
        If the height is not positive, or a value is refused by the part it is for.
    """
    above = check.positive(height, "sleeping_top", "height", "m")
    model = Model("sleeping_top", gravity=(0.0, 0.0, -gravity))
    model.add_body("top", mass, (across, across, axial), (0.0, 0.0, above))
    model.add_joint("tip", "spherical", "ground", "top", ORIGIN)
    model.add_rotor("spin", "top", speed, (0.0, 0.0, 1.0))
    model.add_input("torque", "top", "rx")
    model.add_output("rx", "top", "rx")
    model.add_output("ry", "top", "ry")
    return model
