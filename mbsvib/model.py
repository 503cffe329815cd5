"""The model: what the user said about a mechanism, part by part, each checked when it is added."""

from __future__ import annotations

from collections.abc import Mapping
from inspect import signature
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, overload

from mbsvib import _checks as check
from mbsvib.errors import ModelError, nearest
from mbsvib.parts import BaseMotion, Body, Bushing, ForceOutput, Input, Joint, Output, Spring
from mbsvib.parts import body as _body
from mbsvib.parts import bushing as _bushing
from mbsvib.parts import joint as _joint
from mbsvib.parts import ports as _ports
from mbsvib.parts import spring as _spring

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.batch import Batch
    from mbsvib.parameters import Parameters
    from mbsvib.sparse import SparseSystem
    from mbsvib.system import System
    from mbsvib.topology import Topology

GROUND = "ground"


class Model:
    """A mechanism: bodies, joints, spring-dampers, and the named inputs and outputs one is interested in.

    SI units and radians; positions and axes in world coordinates. Where a body is asked for, its name or the
    object that ``add_body`` returned will do; ``"ground"`` exists from the start. The pose given is the one about
    which the mechanism vibrates, and it carries no load: gravity and preloads are refused for now.

    Parameters
    ----------
    name : str
        Name of the model, used in titles and files.
    gravity : None
        Not supported yet; any value but None raises.

    Raises
    ------
    ModelError
        If the name is no text or gravity is asked for.
    """

    def __init__(self, name: str = "model", gravity: ArrayLike | None = None) -> None:
        self.name = check.name(name, "model")
        if gravity is not None:
            _later("model", "gravity", gravity, "Gravity")
        self._bodies: dict[str, Body] = {}
        self._joints: dict[str, Joint] = {}
        self._springs: dict[str, Bushing | Spring] = {}
        self._inputs: dict[str, Input | BaseMotion] = {}
        self._outputs: dict[str, Output | ForceOutput] = {}
        self._topology: Topology | None = None  # what bodies and joints imply, until one more is added

    @property
    def bodies(self) -> Mapping[str, Body]:
        """Bodies by name, in the order in which they were added, without the ground."""
        return MappingProxyType(self._bodies)

    @property
    def joints(self) -> Mapping[str, Joint]:
        """Joints by name, in the order in which they were added."""
        return MappingProxyType(self._joints)

    @property
    def springs(self) -> Mapping[str, Bushing | Spring]:
        """Bushings and line springs by name, in the order in which they were added."""
        return MappingProxyType(self._springs)

    @property
    def inputs(self) -> Mapping[str, Input | BaseMotion]:
        """Force inputs and base motions by name, in the order in which they were added."""
        return MappingProxyType(self._inputs)

    @property
    def outputs(self) -> Mapping[str, Output | ForceOutput]:
        """Outputs by name, in the order in which they were added."""
        return MappingProxyType(self._outputs)

    def add_body(
        self, name: str, mass: float, inertia: ArrayLike, position: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike | None = None,
    ) -> Body:  # fmt: skip
        """Add a rigid body.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        mass : float
            Mass [kg], positive.
        inertia : array-like, shape (3,), (6,) or (3, 3)
            Inertia about the centre of mass in body axes [kg m^2]: principal moments, the tensor's entries
            xx yy zz xy xz yz (xy = -integral of x y dm), or the tensor.
        position : array-like, shape (3,)
            Centre of mass [m], world axes.
        orientation : array-like, shape (3, 3) or (3,), optional
            Body axes as columns, or a rotation vector [rad]; default: world axes.

        Returns
        -------
        Body
            The part, to be used wherever a body is asked for.

        Raises
        ------
        ModelError
            If the name is taken, the mass is not positive, or no body can have this inertia.
        """
        self._check_name(name, "body")
        part = _body.make(name, mass, inertia, position, orientation)
        self._bodies[name] = part
        self._topology = None
        return part

    def add_joint(
        self, name: str, kind: str | None, first: str | Body, second: str | Body,
        position: ArrayLike | None = None, orientation: ArrayLike | None = None,
        axis: ArrayLike | None = None, axis2: ArrayLike | None = None,
        pitch: float | None = None, free: Sequence[str] | None = None,
    ) -> Joint:  # fmt: skip
        """Add an ideal joint; its coordinates are the free displacements of ``second`` relative to ``first``.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        kind : str or None
            revolute, prismatic, cylindrical, screw, universal, spherical, planar, fixed or free (axis: local z);
            None together with ``free``.
        first, second : str or Body
            The two bodies.
        position : array-like, shape (3,)
            The joint's point [m], world axes; not needed for prismatic and fixed joints.
        orientation : array-like, shape (3, 3) or (3,), optional
            Joint axes as columns, or a rotation vector [rad]; default: world axes.
        axis : array-like, shape (3,), optional
            Instead of ``orientation``: the joint's axis, world. Universal: the axis that stays in ``first``.
        axis2 : array-like, shape (3,), optional
            Universal only: the axis that stays in ``second``, world.
        pitch : float, optional
            Screw only: advance per radian [m/rad].
        free : sequence of str, optional
            For any other joint: the free directions out of x y z rx ry rz, in the joint's axes.

        Returns
        -------
        Joint
            The part.

        Raises
        ------
        ModelError
            If a body is unknown or joined with itself, the kind is unknown, or an axis is zero.
        """
        self._check_name(name, "joint")
        a = self._body_name(first, "joint", name, "first")
        b = self._body_name(second, "joint", name, "second")
        part = _joint.make(name, kind, a, b, position, orientation, axis, axis2, pitch, free)
        self._joints[name] = part
        self._topology = None
        return part

    def add_bushing(
        self, name: str, first: str | Body, second: str | Body, position: ArrayLike,
        stiffness: ArrayLike = _bushing.ZERO, damping: ArrayLike = _bushing.ZERO,
        orientation: ArrayLike | None = None, preload: ArrayLike | None = None,
    ) -> Bushing:  # fmt: skip
        """Add a spatial spring-damper that acts at a point.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        first, second : str or Body
            The two bodies.
        position : array-like, shape (3,)
            The point [m], world axes.
        stiffness, damping : array-like, shape (6,) or (6, 6)
            Along and about the bushing's axes, x y z rx ry rz: N/m and N m/rad; N s/m and N m s/rad.
        orientation : array-like, shape (3, 3) or (3,), optional
            Axes as columns, or a rotation vector [rad]; default: world axes.
        preload : None
            Not supported yet; any value but None raises.

        Returns
        -------
        Bushing
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, the shape is wrong, or neither stiffness nor damping is given.
        """
        self._check_name(name, "bushing")
        a = self._body_name(first, "bushing", name, "first")
        b = self._body_name(second, "bushing", name, "second")
        if preload is not None:
            _later(f"bushing '{name}'", "preload", preload, "Preload")
        part = _bushing.make(name, a, b, position, stiffness, damping, orientation)
        self._springs[name] = part
        return part

    def add_spring(
        self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike,
        stiffness: float = 0.0, damping: float = 0.0, preload: float | None = None,
        free_length: float | None = None,
    ) -> Spring:  # fmt: skip
        """Add a spring-damper along the line between two points.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        first, second : str or Body
            The two bodies.
        start, end : array-like, shape (3,)
            The point on ``first`` and the one on ``second`` [m], world axes.
        stiffness, damping : float
            N/m and N s/m.
        preload, free_length : None
            Not supported yet; any value but None raises.

        Returns
        -------
        Spring
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, the points coincide, or neither stiffness nor damping is given.
        """
        self._check_name(name, "spring")
        a = self._body_name(first, "spring", name, "first")
        b = self._body_name(second, "spring", name, "second")
        if preload is not None:
            _later(f"spring '{name}'", "preload", preload, "Preload")
        if free_length is not None:
            _later(f"spring '{name}'", "free_length", free_length, "A free length")
        part = _spring.make(name, a, b, start, end, stiffness, damping)
        self._springs[name] = part
        return part

    def add_input(
        self, name: str, body: str | Body, direction: str | ArrayLike, position: ArrayLike | None = None,
        relative_to: str | Body = GROUND,
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
            The body that takes the equal and opposite reaction, at the same point.

        Returns
        -------
        Input
            The part.

        Raises
        ------
        ModelError
            If a body or the direction is unknown.
        """
        self._check_name(name, "input")
        a = self._body_name(body, "input", name, "body")
        b = self._body_name(relative_to, "input", name, "relative_to")
        part = _ports.make_input(name, a, direction, position, b)
        self._inputs[name] = part
        return part

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
            The body against which it is measured, at the same point.
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
        self._check_name(name, "output")
        a = self._body_name(body, "output", name, "body")
        b = self._body_name(relative_to, "output", name, "relative_to")
        part = _ports.make_output(name, a, direction, position, b, quantity, absolute)
        self._outputs[name] = part
        return part

    def add_base_motion(
        self, name: str, direction: str | ArrayLike, position: ArrayLike = (0.0, 0.0, 0.0)
    ) -> BaseMotion:
        """Add an acceleration of the ground as an input.

        The coordinates are then relative to the moving ground, and every body feels the inertia force of
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
            If the name is taken or the direction unknown.
        """
        self._check_name(name, "input")
        part = _ports.make_base_motion(name, direction, position)
        self._inputs[name] = part
        return part

    def add_force_output(
        self, name: str, element: str | Bushing | Spring, direction: str | ArrayLike = "z"
    ) -> ForceOutput:
        """Add the force or moment in a bushing or spring as an output, positive where it pulls the bodies together.

        Parameters
        ----------
        name : str
            Name, unique among outputs.
        element : str, Bushing or Spring
            The element; joints are not supported yet.
        direction : str or array-like, shape (3,) or (6,)
            x y z (N), rx ry rz (N m) in the bushing's axes; a line spring has its line along z.

        Returns
        -------
        ForceOutput
            The part.

        Raises
        ------
        ModelError
            If the element is unknown or has no such force.
        """
        self._check_name(name, "output")
        key = element if isinstance(element, str) else element.name
        who = f"force output '{name}'"
        part = self._springs.get(key)
        if part is None:
            hint = nearest(key, self._springs).strip()
            if key in self._joints:
                hint = "Forces in joints are not supported yet."
            raise check.refuse(who, "element", key, "a bushing or spring of this model", hint)
        output = _ports.make_force_output(name, key, direction)
        if isinstance(part, Spring) and any(w for i, w in enumerate(output.wrench) if i != 2):
            raise check.refuse(who, "direction", direction, "'z', the line of a spring")
        self._outputs[name] = output
        return output

    @property
    def parameters(self) -> Parameters:
        """Every number of bodies, joints, bushings and springs by its name (``"leg1.k.stiffness"``); read-only."""
        from mbsvib.parameters import Parameters

        return Parameters([*self._bodies.values(), *self._joints.values(), *self._springs.values()])

    def with_values(self, values: Mapping[str, float]) -> Model:
        """Return a new model in which some parameters have other values.

        Parameters
        ----------
        values : mapping of str to float
            New value of each parameter by its name, or by a pattern that picks several (``"leg*.k.stiffness"``).

        Returns
        -------
        Model
            The changed model; this one stays as it is.

        Raises
        ------
        ModelError
            If a parameter is unknown or a value is refused.
        """
        from mbsvib.parameters import parts_with

        changed: dict[str, Any] = parts_with(self.parameters, values)
        model = Model(self.name)
        model._bodies = {name: changed.get(name, part) for name, part in self._bodies.items()}
        model._joints = {name: changed.get(name, part) for name, part in self._joints.items()}
        model._springs = {name: changed.get(name, part) for name, part in self._springs.items()}
        model._inputs, model._outputs = dict(self._inputs), dict(self._outputs)
        return model

    @overload
    def linearize(
        self, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., values: None = ...,
        method: Literal["dense"] | None = ...,
    ) -> System: ...  # fmt: skip

    @overload
    def linearize(
        self, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., values: None = ..., *,
        method: Literal["sparse"],
    ) -> SparseSystem: ...  # fmt: skip

    @overload
    def linearize(
        self, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., *,
        values: Mapping[str, ArrayLike], method: Literal["dense"] | None = ...,
    ) -> Batch: ...  # fmt: skip

    def linearize(
        self, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None,
        values: Mapping[str, ArrayLike] | None = None, method: str | None = None,
    ) -> System | Batch | SparseSystem:  # fmt: skip
        """Return the minimal linear equations of motion, M q'' + C q' + K q = B u.

        Parameters
        ----------
        independent : sequence of str, optional
            Joint coordinates (``"hip1.rx"``) that are to be among the minimal ones.
        cut : sequence of str, optional
            Joints at which loops are to be cut; default: chosen by the smallest cumulative degree of freedom.
        values : mapping of str to array-like, shape (n,) or (), optional
            Values of parameters, by name or by a pattern that picks several (``"leg*.k.stiffness"``): n variants of
            the model in one pass, all in the minimal coordinates of the pose as it is.
        method : str, optional
            "dense" or "sparse". Default: dense up to 600 coordinates; beyond that (unless ``independent`` or
            ``values`` are given) sparse, in time and memory proportional to the number of bodies.

        Returns
        -------
        System, Batch or SparseSystem
            Matrices, names and the way back to the bodies; of all variants where ``values`` is given; a sparse system,
            which answers to the same names (``modes(10)``, ``frequency_response``), where there are many bodies.

        Raises
        ------
        ModelError
            If a name is unknown, a cut leaves bodies hanging, a coordinate cannot be independent, or a variant has a
            value that is refused.
        SingularPoseError
            If the number of degrees of freedom is not defined in this pose, or is another one in a variant.
        """
        from mbsvib.assembly import linearize

        words: dict[str, Any] = {"independent": independent, "cut": cut, "values": values, "method": method}
        result: System | Batch | SparseSystem = linearize(self, **words)
        return result

    def replace(self, element: str, /, **changes: Any) -> Model:
        """Return a new model in which one part has other values; all words of its ``add_...`` call are allowed.

        Parameters
        ----------
        element : str
            Name of a body, joint, bushing, spring, input or output.
        **changes
            The new values, as in the call that adds such a part.

        Returns
        -------
        Model
            The changed model; this one stays as it is.

        Raises
        ------
        ModelError
            If the element or a word is unknown, or a value is refused.
        """
        if not any(element in group for _, group in self._groups()):
            known = [name for _, group in self._groups() for name in group]
            raise ModelError(f"replace: there is no element '{element}' in model '{self.name}'."
                             f"{nearest(element, known)}", element=element)  # fmt: skip
        model = Model(self.name)
        for adder, group in self._groups():
            for part in group.values():
                add = getattr(model, adder or ADDERS[type(part)])
                if part.name != element:
                    add(**part.words())
                    continue
                allowed = signature(add).parameters
                for word in changes:
                    if word not in allowed:
                        raise ModelError(f"replace: '{element}' has no '{word}'.{nearest(word, allowed)} It has "
                                         f"{', '.join(allowed)}.", element=element, field=word)  # fmt: skip
                add(**(part.words() | changes))
        return model

    def _groups(self) -> tuple[tuple[str, Mapping[str, Any]], ...]:
        return (("add_body", self._bodies), ("add_joint", self._joints), ("", self._springs),
                ("", self._inputs), ("", self._outputs))  # fmt: skip

    def _check_name(self, name: str, what: str) -> None:
        if type(name) is not str or not name.isidentifier():
            check.name(name, what)
        if what == "input":
            taken: Any = self._inputs.get(name)
        elif what == "output":
            taken = self._outputs.get(name)
        elif name == GROUND:
            raise ModelError("'ground' is there from the start and cannot be added.", element=GROUND, field="name")
        else:
            taken = self._bodies.get(name) or self._joints.get(name) or self._springs.get(name)
        if taken is not None:
            raise ModelError(
                f"{what} '{name}': the name is taken by a {type(taken).__name__.lower()}; choose another.",
                element=name, field="name",
            )  # fmt: skip

    def _body_name(self, body: str | Body, what: str, name: str, field: str) -> str:
        key = body if type(body) is str else getattr(body, "name", body)
        if key in self._bodies or key == GROUND:
            return key
        who = f"{what} '{name}'"
        hint = nearest(str(key), [*self._bodies, GROUND])
        raise ModelError(f"{who}: {field} = {key!r} is no body of model '{self.name}'.{hint} "
                         f"Add bodies before what refers to them.", element=who, field=field)  # fmt: skip

    def __repr__(self) -> str:
        counts = ((self._bodies, "bodies"), (self._joints, "joints"), (self._springs, "springs"),
                  (self._inputs, "inputs"), (self._outputs, "outputs"))  # fmt: skip
        return f"Model({self.name!r}: {', '.join(f'{len(group)} {what}' for group, what in counts)})"


ADDERS: dict[type, str] = {
    Body: "add_body",
    Joint: "add_joint",
    Bushing: "add_bushing",
    Spring: "add_spring",
    Input: "add_input",
    BaseMotion: "add_base_motion",
    Output: "add_output",
    ForceOutput: "add_force_output",
}


def _later(who: str, field: str, value: Any, what: str) -> None:
    raise ModelError(
        f"{who}: {field} = {check.shown(value)}; {what} is not supported yet, and leaving its stiffness out would "
        f"give wrong frequencies in silence. Leave it out only if the load is negligible.",
        element=who, field=field,
    )  # fmt: skip
