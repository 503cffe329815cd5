"""The mechanism: all of its parts by name, as data that models add to and that equations are made of."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from operator import attrgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, cast

from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements import BaseMotion, Body, ForceOutput, Input, Joint, Load, Output
from mbsvib.elements.beam import Beam
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.load import Gravity
from mbsvib.elements.part import Composed, Part
from mbsvib.elements.rolling import Rolling, Travel
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.shared_rows import Expansion
from mbsvib.elements.superelement import Superelement
from mbsvib.errors import ModelError, nearest
from mbsvib.mechanism.names import check_name, unknown_body

if TYPE_CHECKING:
    from mbsvib.mechanism.parameters import Parameters

GROUND = "ground"
# The groups of parts in the order of model files; those before the ports have parameters.
GROUPS = ("bodies", "composed", "joints", "springs", "couplers", "rotors", "rolling", "loads", "inputs", "outputs")
_with_parameters = attrgetter(*[f"_{key}" for key in GROUPS[:-2]])
_GRAVITY = "None, or the acceleration of free fall (x, y, z) [m/s^2], such as (0, 0, -9.81)"
_TRAVEL = "None, or the velocity of steady forward motion (x, y, z) [m/s], such as (5, 0, 0)"
_SAME: Any = object()

T = TypeVar("T")
P = TypeVar("P", bound="Part")


class Mechanism:
    """Bodies, joints, spring-dampers, loads, inputs and outputs by name; ``Model`` adds the calls that fill it.

    Parameters
    ----------
    name : str
        Name of the mechanism, used in titles and files.
    gravity : array-like, shape (3,), optional
        Acceleration of free fall [m/s^2], world axes; default: none.
    travel : array-like, shape (3,), optional
        Velocity of steady forward motion [m/s], world axes; default: none.

    Raises
    ------
    ModelError
        If the name is not a text, or gravity or travel is not a vector.
    """

    _engine = ("alignments composed declared_parts derived doubts expansion gravity_parts groups kind nodes "
               "with_changed with_doubts")

    kind: ClassVar[str] = "model"

    def __init__(self, name: str, gravity: ArrayLike | None = None, travel: ArrayLike | None = None) -> None:
        self.name = check.name(name, "model")
        self.gravity = gravity
        self.travel = travel
        self._bodies: dict[str, Body] = {}
        self._composed: dict[str, Composed] = {}  # beams and superelements
        self._joints: dict[str, Joint] = {}
        self._springs: dict[str, Any] = {}
        self._couplers: dict[str, Coupling] = {}
        self._rotors: dict[str, Rotor] = {}
        self._rolling: dict[str, Rolling] = {}
        self._loads: dict[str, Load] = {}
        self._inputs: dict[str, Input | BaseMotion] = {}
        self._outputs: dict[str, Any] = {}
        self._generated: dict[str, Part] = {}  # names that composed parts and Maxwell elements use, with these parts
        self._nodes: dict[str, Part] = {}  # those of them that are bodies
        self._elements: dict[str, Part] = {}  # and those that carry forces
        self._expansion: Expansion | None = None
        self._alignments: tuple[Any, ...] = ()
        self._doubts: tuple[str, ...] = ()
        self._derived: dict[tuple[Hashable, ...], Any] = {}

    @property
    def gravity(self) -> Vector | None:
        """Acceleration of free fall [m/s^2], world axes; None where there is none."""
        return self._gravity

    @gravity.setter
    def gravity(self, value: ArrayLike | None) -> None:
        self._gravity = None if value is None else check.vector(value, "model", "gravity", _GRAVITY)
        self._derived = {}

    @property
    def travel(self) -> Vector | None:
        """Velocity of steady forward motion [m/s], world axes; None where there is none."""
        return self._travel

    @travel.setter
    def travel(self, value: ArrayLike | None) -> None:
        self._travel = None if value is None else check.vector(value, "model", "travel", _TRAVEL)
        self._derived = {}

    @property
    def bodies(self) -> Mapping[str, Body]:
        """Bodies by name, in the order in which they were added, without the ground."""
        return MappingProxyType(self._bodies)

    @property
    def hubs(self) -> Mapping[str, Any]:
        """The bodies that turn steadily with all that is on them, by name."""
        return MappingProxyType({name: body for name, body in self._bodies.items() if body.turns_steadily})

    @property
    def composed(self) -> Mapping[str, Composed]:
        """Beams and superelements by name, in the order in which they were added."""
        return MappingProxyType(self._composed)

    @property
    def beams(self) -> Mapping[str, Beam]:
        """Beams by name, in the order in which they were added."""
        return MappingProxyType({name: part for name, part in self._composed.items() if isinstance(part, Beam)})

    @property
    def superelements(self) -> Mapping[str, Superelement]:
        """Superelements by name, in the order in which they were added."""
        return MappingProxyType({k: part for k, part in self._composed.items() if isinstance(part, Superelement)})

    @property
    def joints(self) -> Mapping[str, Joint]:
        """Joints by name, in the order in which they were added."""
        return MappingProxyType(self._joints)

    @property
    def springs(self) -> Mapping[str, Any]:
        """Springs, bushings and all other connections by name, in the order in which they were added."""
        return MappingProxyType(self._springs)

    @property
    def couplers(self) -> Mapping[str, Coupling]:
        """Couplers, gears, worms and racks by name, in the order in which they were added."""
        return MappingProxyType(self._couplers)

    @property
    def rotors(self) -> Mapping[str, Rotor]:
        """Rotors by name, in the order in which they were added."""
        return MappingProxyType(self._rotors)

    @property
    def rolling(self) -> Mapping[str, Rolling]:
        """Rolling wheels by name, in the order in which they were added."""
        return MappingProxyType(self._rolling)

    @property
    def loads(self) -> Mapping[str, Load]:
        """Forces and torques on bodies by name, in the order in which they were added."""
        return MappingProxyType(self._loads)

    @property
    def inputs(self) -> Mapping[str, Input | BaseMotion]:
        """Force inputs and base motions by name, in the order in which they were added."""
        return MappingProxyType(self._inputs)

    @property
    def outputs(self) -> Mapping[str, Output | ForceOutput]:
        """Outputs by name, in the order in which they were added."""
        return MappingProxyType(self._outputs)

    @property
    def nodes(self) -> Mapping[str, Part]:
        """The parts whose nodes are bodies, by the names of these."""
        return MappingProxyType(self._nodes)

    @property
    def expansion(self) -> Expansion | None:
        """Mass and stiffness between more than two bodies, where beams and superelements are expanded."""
        return self._expansion

    @property
    def alignments(self) -> tuple[Any, ...]:
        """Joints whose axes were aligned, with angle [rad] and shift [m], of a mechanism that ``aligned`` returned."""
        return self._alignments

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences on the displacements that led to this pose, if they are likely to be in wrong units."""
        return self._doubts

    def with_doubts(self, doubts: Sequence[str]) -> Self:
        """Return a copy that has further ``doubts``.

        Parameters
        ----------
        doubts : sequence of str
            One sentence each.

        Returns
        -------
        Mechanism
            The copy; this one does not change.
        """
        result = self.__copy__()
        result.__setstate__({"_doubts": tuple(dict.fromkeys((*self._doubts, *doubts)))})
        return result

    @property
    def gravity_parts(self) -> tuple[Gravity, ...]:
        """Gravity as a part with parameters, if there is gravity and no other part has its name."""
        taken = any("gravity" in group for group in _with_parameters(self))
        return () if self._gravity is None or taken else (Gravity("gravity", self._gravity),)

    @property
    def travel_parts(self) -> tuple[Travel, ...]:
        """Forward motion as a part with parameters, if the model has it and no other part has its name."""
        taken = any("travel" in group for group in _with_parameters(self))
        return () if self._travel is None or taken else (Travel("travel", self._travel),)

    @property
    def parameters(self) -> Parameters:
        """Every number of parts and of gravity by its name (``"leg1.k.stiffness"``, ``"gravity.z"``); read-only."""
        return self.derived(_parameters)

    @property
    def declared_parts(self) -> tuple[Part, ...]:
        """Gravity, travel and all parts but inputs and outputs, as the user knows them, in the order of parameters."""
        parts = (*self.gravity_parts, *self.travel_parts,
                 *[part for group in _with_parameters(self) for part in group.values()])  # fmt: skip
        return parts if self._expansion is None else self._expansion.declared(parts)

    def groups(self) -> dict[str, Mapping[str, Any]]:
        """Return all parts in their groups.

        Returns
        -------
        dict of str to mapping
            The parts by name, by the names of the groups: ``GROUPS``.
        """
        return {key: MappingProxyType(self._group(key)) for key in GROUPS}

    def with_parts(
        self, *, gravity: ArrayLike | None = _SAME, expansion: Expansion | None = _SAME, **groups: Mapping[str, Any]
    ) -> Self:
        """Return a mechanism in which some groups hold other parts; these are not checked again.

        Parameters
        ----------
        gravity : array-like, shape (3,), optional
            Acceleration of free fall [m/s^2]; None: no gravity. Default: unchanged.
        expansion : Expansion, optional
            Mass and stiffness between more than two bodies; default: unchanged.
        **groups : mapping of str to Part
            All parts of each of these groups (``joints={...}``) by name.

        Returns
        -------
        Mechanism
            The changed mechanism, of the same class; this one does not change.

        Raises
        ------
        ModelError
            If there is no such group.
        """
        for key in groups:
            if key not in GROUPS:
                raise ModelError(f"with_parts: there is no group {key!r}.{nearest(key, GROUPS)} There are "
                                 f"{', '.join(GROUPS)}; beams and superelements are 'composed'.")  # fmt: skip
        result = self.__copy__()
        result.__setstate__({f"_{key}": dict(parts) for key, parts in groups.items()})
        if gravity is not _SAME:
            result.gravity = gravity
        if expansion is not _SAME:
            result.__setstate__({"_expansion": expansion})
        return result

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return a new model in which some parameters have other values.

        Parameters
        ----------
        values : mapping of str to float
            New value of each parameter by its name, or by a pattern that picks several (``"leg*.k.stiffness"``).
            Orientations are components of one rotation vector from the axes of this model.

        Returns
        -------
        Model
            The changed model; this one stays as it is. Its orientation parameters are 0 again: they turn parts from
            where they are there, and so do sensitivities. ``studies.rates_at`` makes these slopes of the values given.

        Raises
        ------
        ModelError
            If a parameter is unknown or a value is refused.
        """
        from mbsvib.mechanism.changes import parts_with

        return self.with_changed(parts_with(self.parameters, values))

    def with_changed(self, changed: Mapping[str, Any]) -> Self:
        """Return a mechanism in which some parts are replaced by others of their names, which are not checked again.

        Parameters
        ----------
        changed : mapping of str to Part
            The new parts by name.

        Returns
        -------
        Mechanism
            The changed mechanism, of the same class; this one does not change.
        """
        gravity, travel = changed.get("gravity"), changed.get("travel")
        groups: Any = {key: {name: changed.get(name, part) for name, part in self._group(key).items()}
                  for key in GROUPS[:-2]}  # fmt: skip
        result = self.with_parts(gravity=gravity.acceleration if isinstance(gravity, Gravity) else _SAME, **groups)
        if isinstance(travel, Travel):
            result.travel = travel.velocity
        return result

    def derived(self, compute: Callable[..., T], *arguments: Hashable) -> T:
        """Return the result of a function of the mechanism, cached until a part is added.

        Parameters
        ----------
        compute : callable
            A function of the mechanism and of the arguments.
        *arguments : hashable
            What else it takes.

        Returns
        -------
        object
            Its result.
        """
        key = compute, *arguments
        if key not in self._derived:
            self._derived[key] = compute(self, *arguments)
        result: T = self._derived[key]
        return result

    def __copy__(self) -> Self:
        """Return a copy, which later additions do not change."""
        result = object.__new__(type(self))
        result.__dict__ = {name: item.copy() if type(item) is dict else item for name, item in vars(self).items()}
        return result

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_derived": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Set the parts of a state and clear cached results."""
        before = dict(self.__dict__.get("_composed", {}))
        self.__dict__.update(state)
        self._derived = {}
        if "_composed" in state and "_generated" not in state:
            self._nodes, self._elements = {}, {}
            self._generated = {name: part for name, part in self._generated.items() if part.name not in before}
            for part in self._composed.values():
                self._reserve_names(part)
        if "_springs" in state and "_generated" not in state:
            self._generated = {name: part for name, part in self._generated.items()
                          if part.name in self._composed or part.name in self._springs}  # fmt: skip

    def _group(self, key: str) -> dict[str, Any]:
        return cast("dict[str, Any]", getattr(self, f"_{key}"))

    def _keep(self, group: dict[str, Any], part: P) -> P:
        """Add a part to its group."""
        group[part.name] = part
        self._derived = {}
        return part

    def _reserve_names(self, part: Composed) -> None:
        """Register the names of the nodes and elements of a beam or superelement."""
        self._nodes |= dict.fromkeys(part.node_names, part)
        self._elements |= dict.fromkeys(part.element_names, part)
        self._generated |= dict.fromkeys(part.generated_names, part)

    def _check_name(self, name: str, family: str) -> None:
        check_name(name, family, self._bodies, self._joints, self._springs, self._composed, self._generated,
                   self._couplers, self._rotors, self._rolling, self._loads)  # fmt: skip
        if name == GROUND:
            raise ModelError("'ground' is there from the start and cannot be added.", element=GROUND, field="name")

    def _between(self, family: str, name: str, first: str | Body, second: str | Body) -> tuple[str, str]:
        """Check the name of a part between two bodies, and return the names of these."""
        self._check_name(name, family)
        return self._body_name(first, family, name, "first"), self._body_name(second, family, name, "second")

    def _body_name(self, body: str | Body, family: str, name: str, field: str) -> str:
        key = body if type(body) is str else getattr(body, "name", body)
        if isinstance(key, str) and (key in self._bodies or key == GROUND or key in self._nodes):
            return key
        raise unknown_body(key, (f"{family} '{name}'", field), self.name, [GROUND, *self._bodies, *self._nodes])


def _parameters(model: Mechanism) -> Parameters:
    from mbsvib.mechanism.parameters import Parameters

    return Parameters(model.declared_parts)
