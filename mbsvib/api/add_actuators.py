"""The calls that add actuators with their electronics, each of several parts: voice coils and piezo stacks.

What turns motion into current is a mechanical element that an input drives. With the elongation x, a spring k1 in
series with a damper c, and the deformation z of the damper, the force on the second body along the line is
F = k1 (z - x), and

c z' = k1 (x - z) + h u

A voice coil, F = T i and L i' + R i = u - T x', is k1 = T^2 / L, c = T^2 / R, h = T / R: i = T (z - x) / L. A piezo
stack, F = T u - k x and Q = T x + C u with the capacity C of blocked ends, fed through a resistance R, is the spring k
and k1 = T^2 / C, c = R T^2, h = T: Q = T z. So both are reciprocal and passive, without states of another kind.

Source: Preumont, Mechatronics: Dynamics of Electromechanical and Piezoelectric Systems (2006), sections 3.2 and 4.4.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.add_parts import RigidMechanism
from mbsvib.api.add_ports import PortedMechanism
from mbsvib.common import arguments as check
from mbsvib.common.expected import one_of
from mbsvib.elements import Body
from mbsvib.elements.connection import line_between
from mbsvib.errors import ModelError
from mbsvib.mechanism.names import check_name

WEIGHTLESS = (0.0, 0.0, 0.0)


class ActuatedMechanism(RigidMechanism, PortedMechanism):
    """A mechanism with actuators, which are springs, dampers, bodies without mass and inputs."""

    def add_voice_coil(
        self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike, constant: float,
        resistance: float | None = None, inductance: float = 0.0,
    ) -> tuple[str, ...]:  # fmt: skip
        """Add a voice coil along the line between two points, driven by a voltage or, without resistance, a current.

        F = T i,  L i' + R i = u - T x'

        F pushes both bodies apart, x is their elongation; where they move far, the force of the input turns with one
        of them; springs and dampers follow the line. Driven by a current it is the input ``NAME.current`` [A].
        By a voltage, ``NAME.voltage`` [V], its back-EMF is the damper ``NAME.resistance`` of T^2 / R, with an
        inductance in series with the spring ``NAME.inductance`` of T^2 / L: its force is -T i. Between both is the
        body without mass ``NAME.node`` on the prismatic joint ``NAME.flux``, a first-order state: -T times it is the
        flux L i + T x.

        Parameters
        ----------
        name : str
            What the names of its parts begin with.
        first, second : str or Body
            The two bodies.
        start, end : array-like, shape (3,)
            The point on ``first`` and the one on ``second`` [m], world axes.
        constant : float
            Motor constant T [N/A], the same number as that of the back-EMF [V s/m]; negative: pulls.
        resistance : float, above 0, optional
            R of coil and amplifier [Ohm], above 0; default: driven by a current.
        inductance : float, at least 0
            L [H]; needs a resistance.

        Returns
        -------
        tuple of str
            The names of its parts, the input first.

        Raises
        ------
        ModelError
            If a name is taken, a body is unknown, the points coincide, or a number is refused.

        Source: as in ``mbsvib.api.add_actuators``.
        """
        who = f"voice coil '{name}'"
        T = check.not_zero(constant, who, "constant", "the force per current [N/A]")
        L = _least(inductance, who, "inductance", "an inductance [H] of 0 or more")
        if resistance is None and L:
            raise check.refuse(who, "inductance", inductance, "a resistance with it", "A current has no inductance.")
        expected = "a resistance [Ohm] above 0"
        R = None if resistance is None else check.above_zero(resistance, who, "resistance", expected)
        ends = self._line(who, first, second, start, end)
        if R is None:
            return self._driven(who, name, ends, "current", T, "A")
        words = ("flux", "inductance", "resistance")
        return self._driven(who, name, ends, "voltage", T / R, "V", words, T**2 / L if L else None, T**2 / R)

    def add_piezo_stack(
        self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike, stiffness: float,
        constant: float, capacitance: float | None = None, resistance: float = 0.0, drive: str = "voltage",
        damping: float = 0.0,
    ) -> tuple[str, ...]:  # fmt: skip
        """Add a piezo stack along the line between two points, driven by a voltage or a charge.

        F = T u - k x,  Q = T x + (C - T^2 / k) u

        F pushes both bodies apart, x is their elongation; where they move far, the force of the input turns with one
        of them; springs and dampers follow the line. By a voltage it is the spring ``NAME.spring`` of stiffness k,
        that of shorted electrodes, and the input ``NAME.voltage`` [V]; by a charge, ``NAME.charge`` [C], this spring is
        that of open electrodes, k / (1 - T^2 / (k C)). Fed through a resistance, or shunted by it, it has besides the
        spring ``NAME.capacitance`` in series with the damper ``NAME.resistance``, between them the body without mass
        ``NAME.node`` on the prismatic joint ``NAME.flow``, a first-order state: -T times it is the charge Q.

        Parameters
        ----------
        name : str
            What the names of its parts begin with.
        first, second : str or Body
            The two bodies.
        start, end : array-like, shape (3,)
            The point on ``first`` and the one on ``second`` [m], world axes.
        stiffness : float, above 0
            k with shorted electrodes [N/m].
        constant : float
            Force per voltage T of blocked ends [N/V]: k times the free stroke per voltage; negative: pulls.
        capacitance : float, above 0, optional
            C with free ends [F], as data sheets have it; above T^2 / k. A charge and a resistance need it.
        resistance : float, at least 0
            Of the amplifier, or of a shunt where the voltage stays 0 [Ohm].
        drive : str
            "voltage" or "charge".
        damping : float, at least 0
            Damping parallel to the stiffness [N s/m].

        Returns
        -------
        tuple of str
            The names of its parts, the input first.

        Raises
        ------
        ModelError
            If a name is taken, a body is unknown, the points coincide, or a number is refused.

        Source: as in ``mbsvib.api.add_actuators``.
        """
        who = f"piezo stack '{name}'"
        k = check.above_zero(stiffness, who, "stiffness", "a stiffness [N/m] above 0")
        T = check.not_zero(constant, who, "constant", "the force per voltage [N/V]")
        c = _least(damping, who, "damping", "a damping [N s/m] of 0 or more")
        R = _least(resistance, who, "resistance", "a resistance [Ohm] of 0 or more")
        one_of(drive, ("voltage", "charge"), who, "drive", ModelError)
        if drive == "charge" and R:
            raise check.refuse(who, "resistance", resistance, "none with drive = 'charge'")
        blocked = 0.0
        if drive == "charge" or R or capacitance is not None:
            least = T**2 / k
            expected = f"a capacitance of free ends [F] above constant^2 / stiffness = {least:.4g}"
            blocked = check.above_zero(capacitance, who, "capacitance", expected) - least
            if blocked <= 0.0:
                raise check.refuse(who, "capacitance", capacitance, expected, "Else its coupling exceeds 1.")
        ends = self._line(who, first, second, start, end)
        stiff = k + T**2 / blocked if drive == "charge" else k
        self._check_name(f"{name}.spring", f"{who}: part")
        words = ("flow", "capacitance", "resistance") if R else ()
        gain, unit = (T / blocked, "C") if drive == "charge" else (T, "V")
        names = self._driven(who, name, ends, drive, gain, unit, words, T**2 / blocked if R else None, R * T**2)
        self.add_spring(f"{name}.spring", *ends, stiff, c)
        return (*names, f"{name}.spring")

    def _line(self, who: str, first: Any, second: Any, start: Any, end: Any) -> tuple[str, str, Any, Any]:
        family, _, name = who.partition(" '")
        a, b = self._between(family, name[:-1], first, second)
        return a, b, *line_between(who, start, end, "Its line would have no direction.")[:2]

    def _driven(
        self, who: str, name: str, ends: tuple[str, str, Any, Any], word: str, gain: float, unit: str,
        words: tuple[str, ...] = (), stiffness: float | None = None, damping: float = 0.0,
    ) -> tuple[str, ...]:  # fmt: skip
        """Add an input that pushes both ends apart, across the damper of a spring and damper in series if it has some.

        ``words`` are those of joint, spring and damper; without a stiffness the damper is alone.
        """
        first, second, start, end = ends
        source = f"{name}.{word}"
        check_name(source, f"{who}: input", self._inputs)
        used = words if stiffness is not None else words[2:]
        names = [f"{name}.{each}" for each in used] + ([f"{name}.node"] if stiffness is not None else [])
        for each in names:
            self._check_name(each, f"{who}: part")
        line = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
        if stiffness is not None:
            node = f"{name}.node"
            self.add_body(node, 0.0, WEIGHTLESS, end)
            self.add_joint(names[0], "prismatic", second, node, end, axis=line)
            self.add_spring(names[1], first, node, start, end, stiffness)
            first = node
        if words:
            self.add_spring(f"{name}.{words[2]}", first, second, start, end, 0.0, damping)
        self.add_input(source, second, gain * line, end, first, per=unit)
        return (source, *names)


def _least(value: Any, who: str, field: str, expected: str) -> float:
    number = check.number(value, who, field, expected)
    if number < 0.0:
        raise check.refuse(who, field, value, expected)
    return number
