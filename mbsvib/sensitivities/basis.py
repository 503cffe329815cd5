"""Everything that the sensitivities of one system share and that is kept for repeated questions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import ClassVar

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.equations.equations import Equations
from mbsvib.equations.matrices import MATRICES
from mbsvib.modes import Modes
from mbsvib.modes.result import modes
from mbsvib.responses.basis import RESPONSE_RTOL, Basis
from mbsvib.sensitivities.forms import have_rules
from mbsvib.sensitivities.loaded_network import LoadedNetwork, loaded_network
from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives, matrix_derivatives
from mbsvib.sensitivities.network import Network
from mbsvib.sensitivities.network_assembly import bare_network, complete_network
from mbsvib.sensitivities.parameter_groups import ParameterGroups, grouped_by_rule, grouped_under_loads
from mbsvib.sensitivities.ports import Loads, checked_loads, no_loads
from mbsvib.sensitivities.pose_motion import ReferencePose, reference_pose
from mbsvib.sensitivities.spectrum import Pairs, Spectrum, spectrum
from mbsvib.sensitivities.variables import Direction, Requested, Variables, variables
from mbsvib.sensitivities.variants import Variants, not_held


class SensitivityBasis:
    """The network, the spectrum and the groups of parameters of one set of equations, each kept once it is known.

    ``network``, ``known`` modes and ``groups`` of all parameters are computed where they are not given. If
    ``pose_moves``, loaded mechanisms follow their equilibrium as parameters change.
    """

    pose_moves: ClassVar[bool] = True

    def __init__(
        self, responses: Basis, network: Network | None = None, known: Modes | None = None,
        groups: ParameterGroups | None = None,
    ) -> None:  # fmt: skip
        self.responses = responses
        self._network, self._known = network, known
        self._groups_of_all = {} if groups is None else {groups.network.bare: groups}

    def __getstate__(self) -> dict[str, object]:
        """Return what the rest is computed of: rules of parameters are functions, which pickle cannot hold."""
        return {"responses": self.responses, "_network": self._network, "_known": self._known, "_groups_of_all": {}}

    @staticmethod
    def of(equations: Equations) -> SensitivityBasis:
        """Return the basis of some equations of which nothing is known yet."""
        return SensitivityBasis(Basis(equations))

    @property
    def equations(self) -> Equations:
        """The equations of motion."""
        return self.responses.equations

    @cached_property
    def network(self) -> Network:
        """Bodies and connections, without any parts where these do not make up all forces."""
        return complete_network(self.equations) if self._network is None else self._network

    @cached_property
    def bare_network(self) -> Network:
        """The same network without any parts."""
        return self.network if self.network.bare else bare_network(self.equations)

    @cached_property
    def modes(self) -> Modes:
        """All modes, as accurate as responses need them, without modes of the default accuracy before.

        Those will not do, even where their errors are small: vectors of coupled modes that are as close as 1e-5 then
        have ten times the residual, and derivatives ten times the error.
        """
        if self._known is not None:
            return self._known
        if self.responses.computed & {"modes", "response_modes"}:
            return self.responses.response_modes
        return modes(self.equations, RESPONSE_RTOL, form=self.responses.form)

    @cached_property
    def spectrum(self) -> tuple[Spectrum, Pairs]:
        """Eigenvalues with their vectors, and the pairs of those that coincide."""
        known = spectrum(self.modes)
        return known, known.pairs()

    @cached_property
    def loaded(self) -> LoadedNetwork | None:
        """The network under its forces, where derivatives through the equilibrium are known of all its parts."""
        return None if self.network.forces is None else loaded_network(self.network, self.equations)

    @cached_property
    def reference_pose(self) -> ReferencePose | None:
        """What parameters as described do, where the equilibrium was found in another pose."""
        loaded, provenance = self.loaded, self.equations.provenance
        if loaded is None or not provenance.moved_to_equilibrium or provenance.origin is None:
            return None
        return reference_pose(self.network, loaded.forces, loaded.changes, provenance.origin)

    @cached_property
    def variants(self) -> Variants:
        """The equations with other values of the parameters."""
        return Variants(self.equations, self.pose_moves)

    @cached_property
    def unreduced(self) -> SensitivityBasis | None:
        """The basis of the system that ``reachable`` took this one out of; None where this one is whole."""
        equations = self.variants.unreduced
        return None if equations is None else SensitivityBasis.of(equations)

    def ported(self, inputs: list[int], outputs: list[int]) -> tuple[Network, Loads, Loads]:
        """Return the network with some of the ports as loads; the bare one where ports are more than that.

        Ports at motions that statics condensed are: their rows depend on the stiffness that holds these motions.
        """
        separation, system = self.equations.provenance.separation, self.equations
        condensed = separation is not None and not (
            {system.inputs[k] for k in inputs}.isdisjoint(separation.inputs)
            and {system.outputs[k] for k in outputs}.isdisjoint(separation.outputs))  # fmt: skip
        if not self.network.bare and not condensed:
            known = checked_loads(self.equations, self.network, inputs, outputs)
            if known is not None:
                return self.network, *known
        return self._without_ports(inputs, outputs)

    def _without_ports(self, inputs: list[int], outputs: list[int]) -> tuple[Network, Loads, Loads]:
        """The bare network, whose ports are no loads."""
        network = self.bare_network
        return network, no_loads(network, len(inputs)), no_loads(network, len(outputs))

    def groups(self, parameters: Requested = None, network: Network | None = None) -> ParameterGroups:
        """Return the groups of parameters that some variables move; those of all parameters are kept.

        ``parameters``: names, patterns or linear maps of parameters; None: every parameter of the system. Raises an
        error if a parameter is unknown, the equations do not change smoothly with it, or it loads a motion that nothing
        holds.
        """
        network = self.network if network is None else network
        if parameters is not None:
            return self._grouped(network, variables(self.equations.parameters, parameters), every=False)
        if network.bare not in self._groups_of_all:
            requested = variables(self.equations.parameters, None)
            self._groups_of_all[network.bare] = self._grouped(network, requested, every=True)
        return self._groups_of_all[network.bare]

    def _grouped(self, network: Network, requested: Variables, *, every: bool) -> ParameterGroups:
        ruled = have_rules(network, requested.layout)
        loaded = None if ruled.all() or network.bare else self.loaded
        reference = None if loaded is None else self.reference_pose
        if loaded is None or not (reference is None or all(map(reference.covers, requested.parameters))):
            result = grouped_by_rule(network, requested, ruled, self.matrix_slopes, every)
        else:
            result = grouped_under_loads(loaded, reference, requested, self.matrix_slopes, every, self.pose_moves)
        if result.unresisted is not None and result.unresisted.any() and not every:
            raise not_held(requested.names[int(np.argmax(result.unresisted))], self.equations.name)
        return replace(result, again=partial(self._grouped, network, requested, every=every))

    def matrix_slopes(self, directions: Sequence[Direction], every: bool = False) -> Mapping[str, Array]:
        """Return the derivatives of whole matrices along some directions: differences, or rows of the whole system.

        ``every``: whether these are all parameters there are, so that what is refused is not a number instead. Returns
        derivatives of M, C, K, B, Cq, Cv, Ca and D along k directions, (k, ...) each; not a number where a direction
        takes degrees of freedom away. Raises an error if the matrices do not change smoothly, or a parameter loads a
        motion that nothing holds.
        """
        if self.unreduced is None:
            return self.variants.slopes(directions, every)
        equations, unreduced = self.equations, self.unreduced.equations
        requested = {str(k): dict(direction.rates) for k, direction in enumerate(directions)}
        known = self.unreduced.matrix_derivatives(None if every else requested)
        row = {name: k for k, name in enumerate(known.variables)}
        rows = [row[next(iter(rates))] if every else row[k] for k, rates in requested.items()]
        q, i, o = ([all_names.index(name) for name in names] for names, all_names in (
            (equations.coordinates, unreduced.coordinates), (equations.inputs, unreduced.inputs),
            (equations.outputs, unreduced.outputs),
        ))  # fmt: skip
        ends = {"B": (q, i), "D": (o, i)} | dict.fromkeys(("M", "C", "K"), (q, q)) | dict.fromkeys(
            ("Cq", "Cv", "Ca"), (o, q))  # fmt: skip
        return {key: getattr(known, key)[np.ix_(rows, *ends[key])] for key in MATRICES}

    def matrix_derivatives(self, parameters: Requested = None) -> MatrixDerivatives:
        """Return the derivatives of all matrices to parameters.

        ``parameters``: names, patterns or linear maps of parameters; None: every parameter of the system. Returns whole
        matrices, and factors of low rank. Raises an error if a parameter is unknown, or the system does not change
        smoothly with it.
        """
        system = self.equations
        inputs, outputs = list(range(len(system.inputs))), list(range(len(system.outputs)))
        separation = system.provenance.separation
        # rules know no coordinates that change with the parameters
        mixed = separation is not None and separation.mixed
        network, actuation, sensing = (self._without_ports if mixed else self.ported)(inputs, outputs)
        return matrix_derivatives(system, self.groups(parameters, network), actuation, sensing)

    def matrix_derivatives_in_parts(
        self, parameters: Requested, count: int
    ) -> Iterator[tuple[slice, MatrixDerivatives]]:  # fmt: skip
        """Return derivatives of matrices for some variables at a time, so that they never fill the memory.

        ``parameters``: names, patterns or linear maps of parameters; None: every parameter of the system; ``count``:
        how many variables at a time.
        """
        requested = self.equations.parameters if parameters is None else parameters
        names = [requested] if isinstance(requested, str) else list(requested)
        if parameters is None and len(names) <= count:  # the groups of all of them are kept
            yield slice(0, len(names)), self.matrix_derivatives()
            return
        for start in range(0, len(names), count):
            chunk = names[start : start + count]
            part = {name: parameters[name] for name in chunk} if isinstance(parameters, Mapping) else chunk
            yield slice(start, start + len(chunk)), self.matrix_derivatives(part)
