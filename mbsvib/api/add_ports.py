"""The calls that add inputs and outputs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.elements import BaseMotion, Body, Bushing, ForceOutput, Input, Joint, Maxwell, Output, Spring
from mbsvib.elements import motion_input as _motion
from mbsvib.elements import ports as _ports
from mbsvib.elements import strain_output as _strain
from mbsvib.elements.motion_input import MotionInput
from mbsvib.elements.strain_output import StrainOutput
from mbsvib.errors import nearest
from mbsvib.mechanism.mechanism import GROUND, Mechanism
from mbsvib.mechanism.names import check_name


class PortedMechanism(Mechanism):
    """A mechanism with named inputs and outputs."""

    def add_input(
        self, name: str, body: str | Body, direction: str | ArrayLike, position: ArrayLike | None = None,
        relative_to: str | Body = GROUND, per: str | None = None,
    ) -> Input:  # fmt: skip
        """Add a force or torque input.

        Parameters
        ----------
        name : str
            Name, unique among inputs.
        body : str or Body
            The body it acts on.
        direction : str or array-like, shape (3,) or (6,)
            x y z (force, N), rx ry rz (torque, N m), or a vector that is applied as given, its length included;
            world axes.
        position : array-like, shape (3,), optional
            The point it acts at [m], world axes; default: the body's centre of mass.
        relative_to : str or Body
            The body that takes the equal and opposite reaction, at the same point; where it moves far, the direction
            turns with it.
        per : str, optional
            Unit of the signal where it is no force, such as "V": the length of the direction is then the force per
            volt.

        Returns
        -------
        Input
            The part.

        Raises
        ------
        ModelError
            If a body or the direction is unknown.
        """
        check_name(name, "input", self._inputs)
        a = self._body_name(body, "input", name, "body")
        b = self._body_name(relative_to, "input", name, "relative_to")
        part = _ports.make_input(name, a, direction, position, b, per)
        return self._keep(self._inputs, part)

    def add_output(
        self, name: str, body: str | Body, direction: str | ArrayLike, position: ArrayLike | None = None,
        relative_to: str | Body = GROUND, quantity: str = "displacement", absolute: bool | None = None,
    ) -> Output:  # fmt: skip
        """Add a displacement, velocity or acceleration output.

        Parameters
        ----------
        name : str
            Name, unique among outputs.
        body : str or Body
            The body whose motion is measured.
        direction : str or array-like, shape (3,) or (6,)
            x y z (m, m/s, m/s^2), rx ry rz (rad, ...), or a vector that is applied as given, its length
            included; world axes.
        position : array-like, shape (3,), optional
            The point on the body [m], world axes; default: its centre of mass.
        relative_to : str or Body
            The body against which it is measured, at the same point; where it moves far, the direction turns with it.
        quantity : str
            displacement, velocity or acceleration.
        absolute : bool, optional
            Matters only with base motion. True: against inertial space, as an accelerometer measures (the default
            of accelerations relative to ground). False: against the ground as it moves (the default, and for
            displacements and velocities the only choice: the input is an acceleration and is never integrated).

        Returns
        -------
        Output
            The part.

        Raises
        ------
        ModelError
            If a body, the direction or the quantity is unknown.
        """
        check_name(name, "output", self._outputs)
        a = self._body_name(body, "output", name, "body")
        b = self._body_name(relative_to, "output", name, "relative_to")
        part = _ports.make_output(name, a, direction, position, b, quantity, absolute)
        return self._keep(self._outputs, part)

    def add_port(
        self, name: str, body: str | Body, position: ArrayLike | None = None, orientation: ArrayLike | None = None
    ) -> tuple[str, ...]:
        """Add six collocated inputs and outputs at one point: where ``mv.assemble`` joins this part to others.

        Parameters
        ----------
        name : str
            Name P of the port; inputs and outputs are P.x, P.y, P.z, P.rx, P.ry and P.rz.
        body : str or Body
            The body that carries it.
        position : array-like, shape (3,), optional
            The point [m], world axes; default: the body's centre of mass.
        orientation : array-like, shape (3, 3), optional
            Axes of the port as columns, world axes; default: those of the world.

        Returns
        -------
        tuple of str
            The six names.

        Raises
        ------
        ModelError
            If the body is unknown, a name is taken, or the axes are no rotation.
        """
        axes = np.eye(3) if orientation is None else np.array(check.orientation(orientation, f"port '{name}'"))
        names = tuple([f"{name}.{direction}" for direction in check.DIRECTIONS])
        for each in names:
            check_name(each, "input", self._inputs)
            check_name(each, "output", self._outputs)
        sixes = np.kron(np.eye(2), axes).T
        for each, direction, six in zip(names, check.DIRECTIONS, sixes, strict=True):
            along = direction if orientation is None else six
            self.add_input(each, body, along, position)
            self.add_output(each, body, along, position)
        return names

    def add_base_motion(
        self, name: str, direction: str | ArrayLike, position: ArrayLike = (0.0, 0.0, 0.0)
    ) -> BaseMotion:
        """Add an acceleration of the ground as an input.

        The coordinates are then relative to the moving ground, and on every body acts the inertia force of
        -1 times the acceleration.

        Parameters
        ----------
        name : str
            Name, unique among inputs.
        direction : str or array-like, shape (3,) or (6,)
            x y z (m/s^2), rx ry rz (rad/s^2), or a vector applied as given; world axes.
        position : array-like, shape (3,)
            The point [m] through which the axes of rotation go; default: the origin.

        Returns
        -------
        BaseMotion
            The part.

        Raises
        ------
        ModelError
            If the name is taken or the direction unknown. Where the ground turns, linearize refuses gravity, loads
            and rotors of other directions than its axis: they do not turn with it.
        """
        check_name(name, "input", self._inputs)
        part = _ports.make_base_motion(name, direction, position)
        return self._keep(self._inputs, part)

    def add_motion_input(
        self, name: str, element: str | Bushing | Spring | Maxwell | Joint, quantity: str = "displacement",
        direction: str | ArrayLike = "z",
    ) -> MotionInput:
        """Add the motion of the ground's end of a spring, bushing or Maxwell element, or of a joint, as an input.

        M q'' + C q' + K q = B0 u + B1 u' + B2 u'' for a displacement u. Of an end, its stiffness is in B0, its damping
        in B1, and B2 = 0; of the coordinate of a joint, these are columns of -K, -C and -M of the mechanism with this
        joint free. M, C, K and modes are those with the end or joint at rest; the drive holds its joint in the given
        pose under loads, too, and its force is that along this direction in the joint (``add_force_output``).

        Parameters
        ----------
        name : str
            Name, unique among inputs.
        element : str, Spring, Bushing, Maxwell or Joint
            The element, one end of which is on ground; or a joint, or its coordinate, ``"hinge.rz"``.
        quantity : str
            "displacement" [m, rad], "velocity" or "acceleration"; the latter have the states ``NAME.displacement`` and
            ``NAME.velocity``.
        direction : str or array-like, shape (3,) or (6,)
            Of a bushing: x y z rx ry rz or a vector in its own axes. Positive along the line towards the other end; of
            a bushing, along its axis. Of a joint with several coordinates, which one.

        Returns
        -------
        MotionInput
            The part.

        Raises
        ------
        ModelError
            If the name is taken, the element has no end on ground, or none that can be moved, or the joint is driven.
        """
        key = element if isinstance(element, str) else getattr(element, "name", repr(element))
        part = _motion.make(name, key, quantity, direction)
        for each in (name, *(f"{name}.{word}" for word in _ports.QUANTITIES)):
            check_name(each, "input", self._inputs)
        driven = None if key in self._springs else _motion.of_coordinate(part, self._joints)
        if driven is None:
            _motion.check_element(part, self._springs.get(key))
            return self._keep(self._inputs, part)
        for other in self._inputs.values():
            if other.element == driven.element:
                raise check.refuse(f"motion input '{name}'", "element", key,
                                   f"a coordinate that input '{other.name}' does not drive")  # fmt: skip
        return self._keep(self._inputs, driven)

    def add_force_output(
        self, name: str, element: str | Joint | Bushing | Spring | Maxwell | Body, direction: str | ArrayLike = "z"
    ) -> ForceOutput:
        """Add the force or moment in a joint, bushing or spring as an output, or the sum of those on a body or ground.

        Positive where it pulls the two bodies together. Sums are of all forces, also the reactions of inputs, as they
        act on the body, world axes; moments about its centre of mass, on the ground about the origin. Outputs are
        changes against the given pose.

        Where constraints are redundant the model does not determine all forces in joints (``linearize`` warns of
        outputs that depend on it). They are then those of least norm in each pose, see ``System.reactions``.

        Parameters
        ----------
        name : str
            Name, unique among outputs.
        element : str, Joint, Bushing, Spring, Maxwell or Body
            The element, or one of a beam (``"tube.e1"``: at its midpoint), or what all forces act on.
        direction : str or array-like, shape (3,) or (6,)
            x y z (N), rx ry rz (N m) in the bushing's axes, or in the joint's as its first body carries them
            (``model.joints["hinge"].axes``, z being the axis of the hinge), moments about its point; a line spring has
            its line along z. What couplers transmit in a joint is part of it.

        Returns
        -------
        ForceOutput
            The part.

        Raises
        ------
        ModelError
            If the element is unknown or has no such force.
        """
        check_name(name, "output", self._outputs)
        who = f"force output '{name}'"
        key = element if isinstance(element, str) else getattr(element, "name", repr(element))
        part = self._springs.get(key) or self._elements.get(key)
        if part is None and key not in self._joints and key not in self._bodies and key != GROUND:
            hint = nearest(key, [*self._springs, *self._elements, *self._joints, *self._bodies, GROUND]).strip()
            raise check.refuse(who, "element", key, "a joint, bushing, spring or body of this model", hint)
        output = _ports.make_force_output(name, key, direction)
        spring = self._springs.get(key)
        if spring is not None and spring.acts_along_line and any(w for i, w in enumerate(output.wrench) if i != 2):
            raise check.refuse(who, "direction", direction, "'z', the line of a spring")
        return self._keep(self._outputs, output)

    def add_strain_output(
        self, name: str, element: str, at: str = "start", side: str = "z", distance: float | None = None
    ) -> StrainOutput:
        """Add the axial strain on the surface of a beam as an output [m/m], as a strain gauge measures it.

        It is the strain of stretching and of bending in one plane, positive in tension, as a change against the given
        pose.

        Parameters
        ----------
        name : str
            Name, unique among outputs.
        element : str
            An element of a beam, ``"tube.e1"`` being the one at its start.
        at : str
            ``"start"``, ``"middle"`` or ``"end"`` of the element.
        side : str
            ``"y"``, ``"-y"``, ``"z"`` or ``"-z"``: on which side of the centre line, in the axes of the element.
        distance : float, at least 0, optional
            Distance from the centre line [m]; default: the surface of the section, which one that is given by its
            properties does not tell.

        Returns
        -------
        StrainOutput
            The part.

        Raises
        ------
        ModelError
            If there is no such element of a beam, or a word is refused.
        """
        check_name(name, "output", self._outputs)
        part = _strain.make(name, element, at, side, distance)
        beams = [key for beam in self.beams.values() for key in beam.element_names]
        if element not in beams:
            raise check.refuse(f"strain output '{name}'", "element", element, "an element of a beam, such as 'tube.e1'",
                               nearest(str(element), beams).strip())  # fmt: skip
        return self._keep(self._outputs, part)
