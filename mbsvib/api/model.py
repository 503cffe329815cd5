"""The model: the description of a mechanism with its inputs and outputs, and its linearization."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from inspect import signature
from typing import TYPE_CHECKING, Any, Literal, Self, overload

from numpy.typing import ArrayLike

from mbsvib.api.add_actuators import ActuatedMechanism
from mbsvib.api.add_drives import DrivenMechanism
from mbsvib.api.add_flexible import FlexibleMechanism
from mbsvib.api.add_loads import LoadedMechanism
from mbsvib.api.add_models import NestedMechanism
from mbsvib.api.add_ports import PortedMechanism
from mbsvib.api.elsewhere import OF_MODELS, tell_functions, tell_where
from mbsvib.api.pose import Posed
from mbsvib.api.run import Simulated
from mbsvib.api.running import Running
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.elements.families import FAMILIES
from mbsvib.errors import counted

if TYPE_CHECKING:
    from mbsvib.api.batch import Batch
    from mbsvib.api.family import Family
    from mbsvib.api.plant import Plant
    from mbsvib.api.sparse_system import SparseSystem
    from mbsvib.common.progress import Progress
    from mbsvib.fitting.result import Fit


class Model(
    DrivenMechanism, ActuatedMechanism, FlexibleMechanism, LoadedMechanism, PortedMechanism, NestedMechanism, Posed,
    Running, Simulated,
):
    """A mechanism: bodies, joints, spring-dampers, and the named inputs and outputs one is interested in.

    SI units and radians; positions and axes in world coordinates. To refer to a body, its name or the
    object that ``add_body`` returned will do; ``"ground"`` exists from the start. The pose given is the one about
    which the mechanism vibrates; where gravity, loads or preloads act, it must be in balance.

    Parameters
    ----------
    name : str
        Name of the model, used in titles and files.
    gravity : array-like, shape (3,), optional
        Acceleration of free fall [m/s^2], world axes, such as (0, 0, -9.81); default: none.
    travel : array-like, shape (3,), optional
        Velocity of the steady forward motion of rolling wheels and all that they carry [m/s], world axes; default: they
        stand. See ``add_rolling``.

    Raises
    ------
    ModelError
        If the name is no text, or gravity or travel no vector.
    """

    def __init__(self, name: str = "model", gravity: ArrayLike | None = None, travel: ArrayLike | None = None) -> None:
        super().__init__(name, gravity, travel)

    @overload
    def linearize(
        self, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., values: None = ...,
        method: Literal["dense"] | None = ..., align: float | None = ...,
    ) -> System: ...  # fmt: skip

    @overload
    def linearize(
        self, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., values: None = ..., *,
        method: Literal["sparse"], align: float | None = ...,
    ) -> SparseSystem: ...  # fmt: skip

    @overload
    def linearize(
        self, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., *,
        values: Mapping[str, ArrayLike], method: Literal["dense"] | None = ..., align: float | None = ...,
    ) -> Batch: ...  # fmt: skip

    def linearize(
        self, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None,
        values: Mapping[str, ArrayLike] | None = None, method: str | None = None, align: float | None = None,
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
        align : float, optional
            Axes of joints within this angle [rad] of parallel, and within this share of the size of loops of a common
            line or point, are taken as meant so, only in loops that gain freedom by it (``aligned``); ``explain()``
            names them. Default: axes are as given.

        Returns
        -------
        System, Batch or SparseSystem
            Matrices, names and the way back to the bodies; of all variants where ``values`` is given; a sparse system,
            which answers to the same names (``modes(10)``, ``frequency_response``), where there are many bodies. Of a
            model on rolling wheels a ``RollingSystem``, first-order equations about its steady forward motion.

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
        from mbsvib.api.linearize import linearize

        kwargs: dict[str, Any] = {"independent": independent, "cut": cut, "values": values, "method": method,
                                  "align": align}  # fmt: skip
        result: System | Batch | SparseSystem = linearize(self, **kwargs)
        return result

    def compile(
        self, parameters: str | Sequence[str] | None = None, cut: Sequence[str] | None = None,
        independent: Sequence[str] | None = None, *, pose: str | Sequence[str] | None = None, relaxed: bool = False,
        align: float | None = None,
    ) -> Plant:  # fmt: skip
        """Return the equations as a function of some parameters, for sweeps, fits and optimisers that ask often.

        M(x) q'' + C(x) q' + K(x) q = B(x) u

        Parameters
        ----------
        parameters : str or sequence of str, optional
            Names or patterns (``"leg*.k.stiffness"``): a value for each name that a pattern matches, in the order of
            ``parameters``, then of the model. Default: all parameters of the model.
        cut, independent : sequence of str, optional
            As of ``linearize``.
        pose : str or sequence of str, optional
            Names or patterns of joint coordinates (``"leg*.slide.z"``): behind those of the parameters, values are then
            their displacements from the described pose [m, rad], as of ``moved``.
        relaxed : bool
            As of ``moved``: whether springs and bushings keep the forces of the described pose.
        align : float, optional
            As of ``linearize``.

        Returns
        -------
        Plant
            ``plant(values)`` returns the matrices for values (p,) or of n variants (n, p), always in the minimal
            coordinates of the model.

        Raises
        ------
        ModelError
            If a name is unknown, or none is left, or loops tie the pose coordinates to each other.
        SingularPoseError, EquilibriumError
            As of ``linearize``.
        """
        from mbsvib.api.plant import compiled

        model = self if align is None else self.aligned(align)
        return compiled(model, parameters, cut, independent, pose, relaxed)

    def family(
        self, values: Mapping[str, ArrayLike], grid: bool = False, independent: Sequence[str] | None = None,
        relaxed: bool = True,
    ) -> Family:  # fmt: skip
        """Return the linear equations in many poses, all in one set of minimal coordinates.

        M_i q'' + C_i q' + K_i q = B_i u

        Parameters
        ----------
        values : dict of str to array-like, shape (n,) or ()
            Displacements of joint coordinates from the described pose [m, rad], by name, one for each pose; of a
            pattern (``"leg*.slide.z"``) those of all that it matches. Other coordinates stay at 0, but for those that
            loops tie to these.
        grid : bool
            True: the poses are all combinations of the values, the last coordinate changing fastest.
        independent : sequence of str, optional
            Minimal coordinates; default: the given ones where they are as many as the degrees of freedom, else as of
            ``linearize``.
        relaxed : bool
            True: springs and bushings keep the forces of the described pose, without tension there they have none in
            any pose. False: they get the tension that the motion gives them, and each pose must be in balance.

        Returns
        -------
        Family
            ``M``, ``C``, ``K``, ``B`` and ``frequencies`` with an axis of poses in front; ``family[i]`` is a System,
            ``worst`` finds the pose where a quantity is worst, ``interpolated`` makes a function of the pose.

        Raises
        ------
        ModelError
            If a coordinate is unknown or tied to the others, or the numbers of values differ.
        SingularPoseError
            If a pose is singular, or beyond a singular one, by its number and displacements.
        EquilibriumError
            If a pose is off balance, likewise.
        """
        from mbsvib.api.family import family

        return family(self, values, grid, independent, relaxed)

    def fit(
        self, data: Any, free: str | Sequence[str] = (), tied: str | Sequence[str] = (),
        prior: Mapping[str, tuple[float, float]] | None = None,
        bounds: Mapping[str, tuple[float | None, float | None]] | None = None, channels: str | Sequence[str] = (),
        starts: int = 1, seed: int = 0, progress: Progress = None,
    ) -> Fit:  # fmt: skip
        """Return the model that measured data tell, with the confidence of each value.

        min over p of sum |W (G(p) - Y)|^2 + sum ((p - p_0) / s)^2

        Parameters
        ----------
        data : Measurement, Records, MeasuredModes, or list of these
            What was measured. Data of another payload or pose are pairs of values and measured object,
            ``({"payload.mass": 12.0, "leg1.slide.z": 0.02}, measurement)``; springs of a moved pose are relaxed there.
        free : str or sequence of str
            Parameters to be fitted, by name or pattern: a value for each name; may be left out beside ``tied``.
        tied : str or sequence of str
            Names or patterns with one value for all parameters that each matches.
        prior : dict of str to (value, standard deviation), optional
            What is known of values before, in their own units; also of channels, {"x.delay": (1e-3, 1e-4)}.
        bounds : dict of str to (lowest, highest), optional
            Limits of values; None: no limit. Positive values, such as masses and stiffnesses, stay within a factor of a
            million of the model's.
        channels : str or sequence of str
            What each measured channel may have: "gain" (the first input's is held), "delay" [s], "lag" [s], a
            first-order low-pass 1 / (1 + s T), "lowpass" and "highpass" of second order, 1 / d and (s / w)^2 / d with
            d = 1 + 2 zeta s / w + (s / w)^2, of the outputs. They are values "NAME.gain", "NAME.delay", "NAME.lag",
            "NAME.lowpass.frequency" [Hz], "NAME.lowpass.damping_ratio" and alike.
        starts : int
            How many searches begin, the first at the model, the others around it.
        seed : int
            Of the random numbers of these.
        progress : bool or callable, optional
            A bar, or a function of steps done and the most there may be; default: a bar on a terminal.

        Returns
        -------
        Fit
            ``model``, ``values``, ``intervals``, ``covariance``, ``residual_test``, ``unidentified``, ``next_sensor``.

        Raises
        ------
        ModelError
            If a parameter or value is unknown or refused, or there are fewer numbers than values.
        ResponseError
            If a channel has no partner in the model, or a unit of unknown scale and no gain, or a line is at a pole.
        EquilibriumError, SingularPoseError
            If a value at the start is no mechanism.

        Warns
        -----
        AccuracyWarning
            If the data are modes alone, and one without a shape is so far from those of the model that it may be any;
            if the phases of responses turn against those of the model, as those of complex conjugates do, or if
            they have no imaginary part.

        Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012), section 9.
        """
        from mbsvib.api.fitting import fitted

        return fitted(self, data, free, tied, prior, bounds, channels, starts, seed, progress)

    def replace(self, element: str, /, **changes: Any) -> Self:
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
        parts = [part for group in self.groups().values() for part in group.values()]
        known = [part.name for part in parts]
        check.known(element, known, f"replace: there is no element '{element}' in model '{self.name}'", told="")
        result = type(self)(self.name, self.gravity, self.travel)
        for part in parts:
            add = getattr(result, ADDERS[type(part)])
            kwargs = part.constructor_kwargs()
            if part.name == element:
                allowed = signature(add).parameters
                for word in changes:
                    check.known(word, allowed, f"replace: '{element}' has no '{word}'", word, element=element)
                kwargs |= changes
            add(**kwargs)
        return result

    def _repr_html_(self) -> str:
        from mbsvib.plots import notebook

        return notebook.of_model(self)

    def __repr__(self) -> str:
        counts = ((self._bodies, "body"), (self._joints, "joint"), (self._springs, "spring"),
                  (self._inputs, "input"), (self._outputs, "output"))  # fmt: skip
        return f"Model({self.name!r}: {', '.join(counted(len(group), noun) for group, noun in counts)})"


tell_functions(Model, OF_MODELS)
tell_where(Model, System, "systems have it: model.linearize().{name}.")
ADDERS: dict[type, str] = {family.part: f"add_{family.word}" for family in FAMILIES}
