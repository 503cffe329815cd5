"""The model: what the user said about a mechanism and what is asked of it, and the way to its equations."""

from __future__ import annotations

from collections.abc import Mapping
from inspect import signature
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, overload

from mbsvib.api.add_couplers import CoupledMechanism
from mbsvib.api.add_loads import LoadedMechanism
from mbsvib.api.add_maxwell import RelaxingMechanism
from mbsvib.api.add_rotors import SpinningMechanism
from mbsvib.api.add_superelements import ReducedMechanism
from mbsvib.api.pose import Posed
from mbsvib.common import arguments as check
from mbsvib.elements import BaseMotion, Body, Bushing, ForceOutput, Input, Joint, Load, Maxwell, Output, Spring
from mbsvib.elements import ports as _ports
from mbsvib.elements.beam import Beam
from mbsvib.elements.coupler import Coupler, Gear, Rack, Worm
from mbsvib.elements.load import Gravity
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.superelement import Superelement
from mbsvib.errors import ModelError, counted, nearest
from mbsvib.mechanism.mechanism import GROUND, check_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.api.batch import Batch
    from mbsvib.api.sparse_system import SparseSystem
    from mbsvib.api.system import System
    from mbsvib.mechanism.parameters import Parameters

class Model(LoadedMechanism, ReducedMechanism, CoupledMechanism, RelaxingMechanism, SpinningMechanism, Posed):
    """A mechanism: bodies, joints, spring-dampers, and the named inputs and outputs one is interested in.

    SI units and radians; positions and axes in world coordinates. Where a body is asked for, its name or the
    object that ``add_body`` returned will do; ``"ground"`` exists from the start. The pose given is the one about
    which the mechanism vibrates; where gravity, loads or preloads act, it must be in balance.

    Parameters
    ----------
    name : str
        Name of the model, used in titles and files.
    gravity : array-like, shape (3,), optional
        Acceleration of free fall [m/s^2], world axes, such as (0, 0, -9.81); default: none.

    Raises
    ------
    ModelError
        If the name is no text or gravity no vector.
    """

    def __init__(self, name: str = "model", gravity: ArrayLike | None = None) -> None:
        super().__init__(name, gravity)
        self._inputs: dict[str, Input | BaseMotion] = {}
        self._outputs: dict[str, Output | ForceOutput] = {}

    @property
    def inputs(self) -> Mapping[str, Input | BaseMotion]:
        """Force inputs and base motions by name, in the order in which they were added."""
        return MappingProxyType(self._inputs)

    @property
    def outputs(self) -> Mapping[str, Output | ForceOutput]:
        """Outputs by name, in the order in which they were added."""
        return MappingProxyType(self._outputs)

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
        check_name(name, "input", self._inputs)
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
        check_name(name, "output", self._outputs)
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
            If the name is taken or the direction unknown. Where the ground turns, linearize refuses gravity, loads
            and rotors of other directions than its axis: they do not turn with it.
        """
        check_name(name, "input", self._inputs)
        part = _ports.make_base_motion(name, direction, position)
        self._inputs[name] = part
        return part

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
            x y z (N), rx ry rz (N m) in the bushing's axes, or in the joint's as its first body carries them, moments
            about its point; a line spring has its line along z. What couplers transmit in a joint is part of it.

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
        if isinstance(part, (Spring, Maxwell)) and any(w for i, w in enumerate(output.wrench) if i != 2):
            raise check.refuse(who, "direction", direction, "'z', the line of a spring")
        self._outputs[name] = output
        return output

    @property
    def parameters(self) -> Parameters:
        """Every number of parts and of gravity by its name (``"leg1.k.stiffness"``, ``"gravity.z"``); read-only."""
        from mbsvib.mechanism.parameters import Parameters

        parts = (self._bodies, self._composed, self._joints, self._springs, self._couplers, self._rotors,
                 self._loads)  # fmt: skip
        return Parameters([*self._falling, *(part for group in parts for part in group.values())])

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
        from mbsvib.mechanism.changes import parts_with

        changed: dict[str, Any] = parts_with(self.parameters, values)
        falls = changed.get("gravity")
        model = Model(self.name, falls.acceleration if isinstance(falls, Gravity) else self.gravity)
        for kind in ("_bodies", "_joints", "_springs", "_couplers", "_rotors", "_loads"):
            setattr(model, kind, {name: changed.get(name, part) for name, part in getattr(self, kind).items()})
        for name, part in self._composed.items():
            model._compose(changed.get(name, part))
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

        Warns
        -----
        UndeterminedForceWarning
            If an output is a force in joints that redundant constraints leave open: it is one of many that would do.
        """
        from mbsvib.equations.assembly import linearize

        words: dict[str, Any] = {"independent": independent, "cut": cut, "values": values, "method": method}
        result: System | Batch | SparseSystem = linearize(self, **words)
        return result

    def replace(self, element: str, /, **changes: Any) -> Model:
        """Return a new model in which one part has other values; all words of its ``add_...`` call are allowed.

        Parameters
        ----------
        element : str
            Name of a body, joint, bushing, spring, load, input or output.
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
        from mbsvib.mechanism.rebuilding import rebuilt

        known = {name: part for _, group in self._groups() for name, part in group.items()}
        if element not in known:
            raise ModelError(f"replace: there is no element '{element}' in model '{self.name}'."
                             f"{nearest(element, known)}", element=element)  # fmt: skip
        for part in (group[element] for _, group in self._groups() if element in group):
            allowed = signature(getattr(self, ADDERS[type(part)])).parameters
            for word in changes:
                if word not in allowed:
                    raise ModelError(f"replace: '{element}' has no '{word}'.{nearest(word, allowed)} It has "
                                     f"{', '.join(allowed)}.", element=element, field=word)  # fmt: skip
        return rebuilt(self, {element: changes})

    def _snapshot(self) -> Model:
        """The model as it is now; parts that are added later are not in it."""
        result = object.__new__(Model)
        result.__dict__ = {name: dict(item) if type(item) is dict else item for name, item in vars(self).items()}
        return result

    __copy__ = _snapshot  # what is added to a copy is not added to this one

    def _groups(self) -> tuple[tuple[str, Mapping[str, Any]], ...]:
        return (("add_body", self._bodies), ("", self._composed), ("add_joint", self._joints), ("", self._springs),
                ("", self._couplers), ("add_rotor", self._rotors), ("add_load", self._loads), ("", self._inputs),
                ("", self._outputs))  # fmt: skip

    def _repr_html_(self) -> str:
        from mbsvib.plots import notebook

        return notebook.of_model(self)

    def __repr__(self) -> str:
        counts = ((self._bodies, "body"), (self._joints, "joint"), (self._springs, "spring"),
                  (self._inputs, "input"), (self._outputs, "output"))  # fmt: skip
        return f"Model({self.name!r}: {', '.join(counted(len(group), what) for group, what in counts)})"


ADDERS: dict[type, str] = {
    Body: "add_body",
    Beam: "add_beam",
    Superelement: "add_superelement",
    Joint: "add_joint",
    Bushing: "add_bushing",
    Spring: "add_spring",
    Maxwell: "add_maxwell",
    Coupler: "add_coupler",
    Gear: "add_gear",
    Worm: "add_worm",
    Rack: "add_rack",
    Rotor: "add_rotor",
    Load: "add_load",
    Input: "add_input",
    BaseMotion: "add_base_motion",
    Output: "add_output",
    ForceOutput: "add_force_output",
}
