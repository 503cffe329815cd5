"""Flexible mechanisms: the calls that add beams and reduced models, and what these become."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mbsvib.elements import beam as _beam
from mbsvib.elements.beam import Beam
from mbsvib.elements.refusal import refuse_composed
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model
    from mbsvib.elements import Body
    from mbsvib.elements.material import Material
    from mbsvib.elements.sections import Circle, Rectangle, Section, Tube
    from mbsvib.elements.superelement import Superelement


class FlexibleMechanism(Mechanism):
    """A mechanism whose bodies may bend."""

    @property
    def beams(self) -> Mapping[str, Beam]:
        """Beams by name, in the order in which they were added."""
        return MappingProxyType({name: part for name, part in self._composed.items() if isinstance(part, Beam)})

    def add_beam(
        self, name: str, a: str | Body | None, b: str | Body | None,
        section: Tube | Circle | Rectangle | Section | Mapping[str, Any],
        material: Material | Mapping[str, Any], start: ArrayLike | None = None, end: ArrayLike | None = None,
        axis: ArrayLike | None = None, length: float | None = None, nodes: ArrayLike | None = None,
        elements: int | None = None, shear: bool = False,
        y_axis: ArrayLike | None = None, alpha: float = 0.0, beta: float = 0.0, damping_ratio: float = 0.0,
    ) -> Beam:  # fmt: skip
        """Add a beam: straight elements that stretch, twist and bend in two planes, with consistent mass.

        Its nodes are called ``"NAME.0"``, ``"NAME.1"``, ...; they are bodies, which joints, springs, inputs and outputs
        may name, but for an end that a body holds. Its elements ``"NAME.e1"``, ... have deformations as coordinates.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        a, b : str, Body or None
            The bodies that hold its ends clamped, wherever their centres of mass are; None: a free end.
        section : Tube, Circle, Rectangle, Section or mapping
            The cross section, or its words: ``{"type": "tube", "radius": 0.1, "wall": 0.01}``.
        material : Material or mapping
            The material, or its words: ``{"E": 2.1e11, "nu": 0.3, "rho": 7800}``.
        start, end : array-like, shape (3,), optional
            Its ends [m], world axes, with ``elements`` equal elements between them.
        axis : array-like, shape (3,), optional
            Together with ``length`` instead of ``end``: the direction from ``start`` on.
        length : float, optional
            Length [m].
        nodes : array-like, shape (n, 3), optional
            Instead of these: its nodes [m], world axes, with a straight element from each to the next.
        elements : int, optional
            How many elements; default: 8.
        shear : bool
            False: Euler-Bernoulli. True: Timoshenko, with shear deformation and rotary inertia.
        y_axis : array-like, shape (3,), optional
            Direction towards which the section's y axis points; default: horizontal, of a vertical beam world y.
        alpha, beta : float
            Rayleigh damping, C = alpha M + beta K of the beam [1/s, s].
        damping_ratio : float
            Damping ratio of every elastic mode of the beam left to itself, C = sum of 2 zeta omega M phi phi^T M.

        Returns
        -------
        Beam
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, a length is zero, or a number of section or material is refused.
        """
        self._check_name(name, "beam")
        first = None if a is None else self._body_name(a, "beam", name, "a")
        second = None if b is None else self._body_name(b, "beam", name, "b")
        part = _beam.make(name, first, second, section, material, start, end, axis, length, nodes, elements, shear,
                          y_axis, alpha, beta, damping_ratio)  # fmt: skip
        self._compose(part)
        return part

    def _compose(self, part: Beam | Superelement) -> None:
        nodes, elements = part.node_names, part.element_names
        for name in part.made:
            self._check_name(name, f"{type(part).__name__.lower()} '{part.name}': part")
        self._composed[part.name] = part
        self._nodes |= dict.fromkeys(nodes, part)
        self._elements |= dict.fromkeys(elements, part)
        self._made |= dict.fromkeys(part.made, part)
        self._topology = None

    def _expanded(self) -> Model:
        """Return the same mechanism in plain parts: nodes as bodies, elements as free joints and bushings."""
        from mbsvib.elements import superelement_expansion as _reduced
        from mbsvib.elements.beam_expansion import dampers, elements, masses, node_bodies
        from mbsvib.elements.shared_rows import Pieces
        from mbsvib.elements.superelement import Superelement
        from mbsvib.equations.wrenches import is_loaded

        plain: Any = copy(self)
        plain._bodies, plain._joints, plain._springs = dict(self._bodies), dict(self._joints), dict(self._springs)
        plain._composed, plain._topology = {}, None
        mass, elastic = [], []
        for part in self._composed.values():
            if isinstance(part, Superelement):
                plain._bodies |= {body.name: body for body in _reduced.node_bodies(part)}
                plain._joints |= dict(_reduced.links(part))
                mass += _reduced.masses(part)
                elastic += _reduced.elastic(part)
        for beam in self.beams.values():
            plain._bodies |= {body.name: body for body in node_bodies(beam)}
            for joint, spring in elements(beam):
                plain._joints[joint.name], plain._springs[spring.name] = joint, spring
            mass += masses(beam)
            elastic += dampers(beam)
        nodes = frozenset(plain._bodies) - frozenset(self._bodies)
        plain._pieces = Pieces(tuple(mass), tuple(elastic), nodes, tuple(self._composed.values()))
        return self._loaded(plain) if is_loaded(plain) else plain

    def _loaded(self, plain: Model) -> Model:
        """Return the plain model with what its elements carry in the loaded pose."""
        from mbsvib.equations.beam_prestress import bent_lines, carried, weights

        for name in self._composed.keys() - self.beams.keys():
            raise ModelError(f"superelement '{name}': a model under load does not support superelements yet; leave the "
                             f"load out, or model it by beams.", element=name)  # fmt: skip
        plain._loads = dict(plain._loads)
        if plain.gravity is not None:
            for beam in self.beams.values():
                plain._loads |= {load.name: load for load in weights(beam, plain.gravity)}
        elements = carried(plain, tuple(self.beams.values()))
        plain._springs |= elements
        assert plain._pieces is not None
        bent = [piece for beam in self.beams.values() for piece in bent_lines(beam, elements)]
        plain._pieces = replace(plain._pieces, elastic=(*plain._pieces.elastic, *bent))
        return plain

    def _refuse_composed(self, what: str, hint: str) -> None:
        """Refuse what beams and reduced models are not made for, naming the first of them."""
        refuse_composed(self._composed.values(), what, hint)
