"""Controllers by synthesis: linear quadratic Gaussian and H2; H-infinity where ctrlsys (SLICOT) is installed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from mbsvib.common.arrays import Array
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError, ResponseError
from mbsvib.feedback.closing import closed_space
from mbsvib.feedback.controller import Controller
from mbsvib.isolation.actuated import Active, check_plant
from mbsvib.isolation.riccati import riccati
from mbsvib.isolation.study_scene import ACCELERATIONS
from mbsvib.linalg.balancing import scaled
from mbsvib.linalg.spectrum import spectrum
from mbsvib.responses.state_space import StateSpace
from mbsvib.responses.transmission_zeros import numbers

# Norms, in parts of the open loop's, at which the search for an H-infinity controller begins, the first at which there
# is one, and where it ends: a bisection to within NEAR, as poles of controllers go to infinity towards the least norm.
# The open loop's own may be the least norm, at which rounding decides.
BEGIN, LEAST, NEAR = (1.5, 1e1, 1e3, 1e6, 1e10), 1e-12, 1e-2
# A controller whose loop has a larger norm than SLICOT says by more than this is none.
EXCEEDED = 1e-3
DEPENDENT = 1e-12  # least singular value of columns of size one that are not independent
# Frequencies, in parts of the highest pole, at which the size of a plant is taken.
SAMPLES = np.concatenate(([0.0], np.geomspace(1e-4, 10.0, 60)))


@dataclass(frozen=True, slots=True)
class Synthesis:
    """A controller x' = A x + B y, u = C x + D y, the H-infinity ``norm`` of the loop (of H2 controllers None), and
    reciprocal condition numbers of the transformations of controls and measurements and of both Riccati equations (of
    H2 controllers none).
    """

    A: Array
    B: Array
    C: Array
    D: Array
    norm: float | None
    reciprocal_conditions: Array


def need_ctrlsys(caller: str, without: str = "") -> Any:
    """Return the package ctrlsys."""
    try:
        import ctrlsys
    except ImportError as error:
        raise ExportError(f"{caller}: needs ctrlsys, SLICOT in C; install it by  pip install \"mbsvib[ctrlsys]\""
                          f"{without}.") from error  # fmt: skip
    return ctrlsys


def hinf_synthesis(
    plant: tuple[Array, Array, Array, Array], measurements: int, controls: int, caller: str, relaxation: float = 1.0
) -> Synthesis:
    """Return the controller u = K y that minimises the H-infinity norm from w to z.

    (z, y) = P (w, u):  minimise over stabilising K the norm of P11 + P12 K (1 - P22 K)^-1 P21

    ``plant``: A, B, C, D of P, in continuous time. ``measurements``, ``controls``: number of outputs y and of inputs u,
    the last ones of P. ``relaxation``: allowed norm, in parts of the smallest, 1 or more. The controller has as many
    states as the plant. The norm of its loop, which is checked, is within 1 % of the smallest that rounding permits.
    Towards the infimum, poles of controllers may go to infinity, and controllers are known to fewer digits: another
    unit changes them by rounding times the reciprocal conditions.

    Source: Glover & Doyle, State-space formulae for all stabilizing controllers that satisfy an H-infinity norm bound,
    Systems & Control Letters 11 (1988); SLICOT's SB10FD, in a bisection, as that of SLICOT's SB10AD ends early.
    """
    ctrlsys = need_ctrlsys(caller)
    normal = _normalized(plant, measurements, controls, caller)
    best, low = None, LEAST
    for norm in BEGIN:
        best = _attempt(ctrlsys, normal.matrices, measurements, controls, norm)
        if best is not None:
            break
        low = norm
    if best is None:
        raise ResponseError(f"{caller}: no controller was found by SLICOT's SB10FD. Effort or noise may be too small "
                            f"against the rest or missing for a control or measurement, or a mode without damping out "
                            f"of reach of controls or measurements.")  # fmt: skip
    while float(best.norm or 0.0) > (1.0 + NEAR) * low:
        middle = float(np.sqrt(low * float(best.norm or 0.0)))
        tried = _attempt(ctrlsys, normal.matrices, measurements, controls, middle)
        best, low = (best, middle) if tried is None else (tried, low)
    if relaxation > 1.0:
        best = _attempt(ctrlsys, normal.matrices, measurements, controls, relaxation * float(best.norm or 0.0)) or best
    law = normal.controller((best.A, best.B, best.C, best.D))
    return Synthesis(*law, float(best.norm or 0.0) * normal.performance, best.reciprocal_conditions)


def _attempt(
    ctrlsys: Any, plant: tuple[Array, Array, Array, Array], measurements: int, controls: int, norm: float
) -> Synthesis | None:
    """A controller whose loop is stable and has no larger norm, and that norm, if SLICOT finds one."""
    a, b, c, _ = plant
    sizes = len(a), b.shape[1], len(c), controls, measurements
    copies = [np.asfortranarray(matrix.copy()) for matrix in plant]
    ak, bk, ck, dk, conditions, failed = ctrlsys.sb10fd(*sizes, norm, *copies, 0.0)
    if failed or not all(np.isfinite(matrix).all() for matrix in (ak, bk, ck, dk)):
        return None
    loop = closed_loop(plant, (ak, bk, ck, dk), measurements, controls)
    if not spectrum(loop[0]).decaying.all():
        return None
    reached = StateSpace.from_arrays(*loop).hinf_norm().value
    if not reached <= (1.0 + EXCEEDED) * norm:
        return None
    return Synthesis(ak, bk, ck, dk, reached, np.asarray(conditions))


def closed_loop(
    plant: tuple[Array, Array, Array, Array], controller: tuple[Array, Array, Array, Array], measurements: int,
    controls: int,
) -> tuple[Array, Array, Array, Array]:  # fmt: skip
    """Return A, B, C, D from w to z of a plant with a controller; the states of the plant come first.

    ``plant``, ``controller``: A, B, C, D of (z, y) = P (w, u) and of u = K y. ``measurements``, ``controls``: number of
    outputs y and of inputs u, the last ones of P.
    """
    o, i = len(plant[2]) - measurements, plant[1].shape[1] - controls
    closed = closed_space(plant, controller, list(range(o, o + measurements)), list(range(i, i + controls)))
    return closed.a, closed.b[:, :i], closed.c[:o], closed.d[:o, :i]


def h2_synthesis(plant: tuple[Array, Array, Array, Array], measurements: int, controls: int, caller: str) -> Synthesis:
    """Return the controller u = K y that minimises the H2 norm from w to z.

    ``plant``: A, B, C, D of (z, y) = P (w, u), in continuous time, without feedthrough from w to z. ``measurements``,
    ``controls``: number of outputs y and of inputs u, the last ones of P.

    Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 14.5.
    """
    a, b, c, d = (np.array(matrix, dtype=float) for matrix in plant)
    _need_states(a, caller)
    o, i = len(c) - measurements, b.shape[1] - controls
    if d[:o, :i].any():
        raise ResponseError(f"{caller}: the plant has feedthrough from w to z, and its H2 norm is infinite; filter w "
                            f"or z, or take hinfsyn.")  # fmt: skip
    cost, noise = d[:o, i:], d[o:, :i].T
    if not (_independent(cost) and _independent(noise)):
        raise ResponseError(f"{caller}: no controller was found. Each control must cost, and each measurement have "
                            f"noise of its own.")  # fmt: skip
    back = riccati(a, b[:, i:], (c[:o], cost), np.zeros(controls), caller)[1]
    inject = riccati(a.T, c[o:].T, (b[:, :i].T, noise), np.zeros(measurements), caller)[1].T
    law = a - b[:, i:] @ back - inject @ c[o:] + inject @ d[o:, i:] @ back
    return Synthesis(law, inject, -back, np.zeros((controls, measurements)), None, np.zeros(0))


def _independent(columns: Array) -> bool:
    """Tell whether columns, of whatever units, are linearly independent."""
    sizes = np.linalg.norm(columns, axis=0)
    if columns.shape[0] < columns.shape[1] or not sizes.all():
        return False
    return bool(np.linalg.svd(columns / sizes, compute_uv=False).min(initial=1.0) > DEPENDENT)


def _need_states(a: Array, caller: str) -> None:
    if not len(a):  # SLICOT returns at once, with any controller
        raise ResponseError(f"{caller}: the plant has no states; expected one with dynamics, its own or a filter's.")


@dataclass(frozen=True, slots=True)
class _Normalized:
    """A plant in units of its own: ``matrices`` A, B, C, D; the units of time [1/s] ``rate``, of ``controls`` and
    ``measurements``, and of the ``performance`` per disturbance.

    Times of the highest pole; states that are moved as much as they are seen, with |B1| = |C1|; controls of unit cost
    and measurements of unit noise; a response from w to z of size one. So a controller does not depend on the units of
    the plant.
    """

    matrices: tuple[Array, Array, Array, Array]
    rate: float
    controls: Array
    measurements: Array
    performance: float

    def controller(self, matrices: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
        """Return A, B, C, D of a controller of the plant in its first units."""
        a, b, c, d = matrices
        b, d = b * self.measurements, d * self.measurements
        return a * self.rate, b * self.rate, self.controls[:, None] * c, self.controls[:, None] * d


def _normalized(plant: tuple[Array, Array, Array, Array], measurements: int, controls: int, caller: str) -> _Normalized:
    a, b, c, d = (np.array(matrix, dtype=float) for matrix in plant)
    _need_states(a, caller)
    o, i = len(c) - measurements, b.shape[1] - controls
    rate = float(np.abs(np.linalg.eigvals(a)).max(initial=0.0)) or float(np.abs(a).max(initial=0.0)) or 1.0
    a, b, c = scaled(a / rate, b / rate, c)
    size = _size(a, b[:, :i], c[:o], d[:o, :i])
    c[:o], d[:o] = c[:o] / size, d[:o] / size
    cost, noise = np.linalg.norm(d[:o, i:], axis=0), np.linalg.norm(d[o:, :i], axis=1)
    cost, noise = (1.0 / np.where(norms > 0.0, norms, 1.0) for norms in (cost, noise))
    b[:, i:], d[:, i:] = b[:, i:] * cost, d[:, i:] * cost
    c[o:], d[o:] = c[o:] * noise[:, None], d[o:] * noise[:, None]
    own = _own_units(a, b, c)
    a, b, c = scaled(a * own / own[:, None], b / own[:, None], c * own)
    sizes = float(np.linalg.norm(b[:, :i])), float(np.linalg.norm(c[:o]))
    unit = np.sqrt(sizes[0] / sizes[1]) if all(sizes) else 1.0
    return _Normalized((a, b / unit, c * unit, d), rate, cost, noise, size)


def _own_units(a: Array, b: Array, c: Array) -> Array:
    """Units (n,) of states in which inputs move each state as much as outputs see it, of equations made to decay.

    They do not depend on the units in which the states come, as powers of two that even out A do.
    """
    decaying = a - (1.0 + max(0.0, float(np.linalg.eigvals(a).real.max()))) * np.eye(len(a))
    pairs = (decaying, b), (decaying.T, c.T)
    moved, seen = (np.abs(solve_continuous_lyapunov(m, -f @ f.T).diagonal()) for m, f in pairs)
    known = (moved > 0.0) & (seen > 0.0)
    return np.where(known, np.where(known, moved, 1.0) / np.where(known, seen, 1.0), 1.0) ** 0.25


def _size(a: Array, b: Array, c: Array, d: Array) -> float:
    """The largest gain of a plant at some frequencies, 1 if it is zero."""
    with np.errstate(all="ignore"):
        gains = [np.linalg.norm(d + c @ np.linalg.lstsq(1j * w * np.eye(len(a)) - a, b.astype(complex), rcond=None)[0])
                 for w in SAMPLES]  # fmt: skip
    size = max(gains, default=0.0)
    return float(size) if 0.0 < size < np.inf else 1.0


def lqg(
    plant: Active, sensors: Names, effort: float, base: float = 1.0, noise: float = 1e-6,
    performance: Names = ACCELERATIONS,
) -> Controller:  # fmt: skip
    """Return the controller that minimises the mean square of the body's acceleration plus that of forces.

    minimise E[z^T z + effort u^T u] under white acceleration of the base in all directions and white noise of sensors

    Parameters
    ----------
    plant : Active
        The mechanism.
    sensors : str or sequence of str
        What is measured: names or patterns of outputs of the plant.
    effort : float
        Weight of actuator forces [performance^2/N^2], positive: the smaller, the harder the actuators work.
    base : float
        Density of the base's acceleration [(m/s^2)^2/Hz], of rotations at the characteristic length.
    noise : float
        Density of the sensors' noise in their units, positive.
    performance : sequence of str
        Outputs z to keep small; default: the body's accelerations, rotations times the characteristic length.

    Returns
    -------
    Controller
        The controller, of as many states as the mechanism.

    Raises
    ------
    ResponseError
        If a weight is not positive, a name unknown, or no stabilising controller exists.
    """
    _check_positive("lqg", effort=effort, base=base, noise=noise)
    a, b, bw, c, d, dw, z, zd, _, rate = _weighted(plant, sensors, performance, "lqg")
    m, n = b.shape[1], len(c)
    back = riccati(a, b, (z, zd), np.full(m, effort))[1]
    inject = riccati(a.T, c.T, (np.sqrt(base) * bw.T, np.sqrt(base) * dw.T), np.full(n, noise))[1].T
    law = a - b @ back - inject @ c + inject @ d @ back
    return Controller("LQG", law * rate, inject * rate, -back, np.zeros((m, n)),
                      _names(plant, sensors), plant.names("actuator")).for_plant(plant.system)  # fmt: skip


def hinf(
    plant: Active, sensors: Names, effort: float, noise: float = 1e-3,
    performance: Names = ACCELERATIONS, relaxation: float = 1.0,
) -> tuple[Controller, float]:  # fmt: skip
    """Return the controller that minimises the largest response to base and sensor noise.

    minimise the H-infinity norm from (base acceleration, noise n) to (z, effort u)

    Parameters
    ----------
    plant : Active
        The mechanism.
    sensors : str or sequence of str
        What is measured: names or patterns of outputs of the plant.
    effort : float
        Weight of actuator forces [performance/N], positive.
    noise : float
        Amplitude of the sensors' noise in their units, positive.
    performance : sequence of str
        Outputs z to keep small.
    relaxation : float
        Norm that is allowed, in parts of the smallest, from 1 on: a controller of 1.2 times the smallest norm has
        slower poles and often much wider stability margins.

    Returns
    -------
    controller, norm : Controller, float
        The controller and the norm that it reaches, within 1 % of the smallest but for ``relaxation``.

    Raises
    ------
    ExportError
        If ctrlsys is not installed.
    ResponseError
        If a weight is not positive, or no controller is found.

    Source: Glover & Doyle, State-space formulae for all stabilizing controllers that satisfy an H-infinity norm bound,
    Systems & Control Letters 11 (1988); SLICOT's SB10FD.
    """
    need_ctrlsys("hinf", ", or use lqg, which does without")
    _check_positive("hinf", effort=effort, noise=noise)
    if not 1.0 <= relaxation < np.inf:
        raise ResponseError(f"hinf: relaxation = {relaxation!r}; expected a number from 1 on.")
    a, b, bw, c, d, dw, z, zd, zw, rate = _weighted(plant, sensors, performance, "hinf")
    m, n, k = b.shape[1], len(c), bw.shape[1]
    generalized_plant = (
        a, np.hstack((bw, np.zeros((len(a), n)), b)), np.vstack((z, np.zeros((m, len(a))), c)),
        np.block([[zw, np.zeros((len(z), n)), zd], [np.zeros((m, k + n)), effort * np.eye(m)],
                  [dw, noise * np.eye(n), d]]),
    )  # fmt: skip
    synthesis = hinf_synthesis(generalized_plant, n, m, "hinf", relaxation)
    law = Controller("Hinf", synthesis.A * rate, synthesis.B * rate, synthesis.C, synthesis.D,
                     _names(plant, sensors), plant.names("actuator")).for_plant(plant.system)  # fmt: skip
    return law, float(synthesis.norm or 0.0)


def _names(plant: Active, sensors: Names) -> tuple[str, ...]:
    return tuple([plant.system.outputs[k] for k in numbers(plant.system, "output", sensors)])


def _check_positive(who: str, **weights: float) -> None:
    for name, value in weights.items():
        if not 0.0 < value < np.inf:
            raise ResponseError(f"{who}: {name} = {value!r}; expected a positive number.")


def _weighted(
    plant: Active, sensors: Names, performance: Names, who: str
) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array, Array, float]:
    """The plant in time units of its highest frequency, balanced, rotations times the length.

    x' = a x + b u + bw w,  y = c x + d u + dw w,  z = e x + f u + g w, and the ``rate`` [1/s], the unit of time.
    """
    space, scene = check_plant(plant, who).space, plant.scene
    u, w = ([space.inputs.index(name) for name in names] for names in (plant.names("actuator"), scene.inputs))
    y, z = numbers(plant.system, "output", sensors), numbers(plant.system, "output", performance)
    units = [plant.system.output_units[k] for k in z]
    size = np.array([scene.length if unit.startswith("rad") else 1.0 for unit in units])[:, None]
    weights = 1.0 / scene.scale(scene.base_directions)
    rate = float(np.abs(plant.system.poles()).max(initial=0.0)) or 1.0  # free masses have no frequency
    a, b, c = scaled(space.A / rate, space.B / rate, space.C)
    through = space.D
    # noise and cost are densities over time too: a change of its unit scales all of them equally
    return (
        a, b[:, u], b[:, w] * weights, c[y], through[np.ix_(y, u)], through[np.ix_(y, w)] * weights,
        size * c[z], size * through[np.ix_(z, u)], size * through[np.ix_(z, w)] * weights, rate,
    )  # fmt: skip
