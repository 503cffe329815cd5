"""SLICOT by ctrlsys, where it is installed: H-infinity and H2 controllers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ExportError, ResponseError
from mbsvib.feedback.closing import closed_space
from mbsvib.linalg.balancing import scaled
from mbsvib.linalg.spectrum import spectrum
from mbsvib.responses.state_space import StateSpace

if TYPE_CHECKING:

    from mbsvib.common.arrays import Array

# Norms, in parts of the open loop's, at which the search for an H-infinity controller begins, the first at which there
# is one, and where it ends: a bisection to within NEAR, as poles of controllers go to infinity towards the least norm.
BEGIN, LEAST, NEAR = (1.0, 1e1, 1e3, 1e6, 1e10), 1e-12, 1e-2
# A controller whose loop has a larger norm than SLICOT says by more than this is none.
EXCEEDED = 1e-3
# Frequencies, in parts of the highest pole, at which the size of a plant is taken.
SAMPLES = np.concatenate(([0.0], np.geomspace(1e-4, 10.0, 60)))


@dataclass(frozen=True, slots=True)
class Synthesis:
    """A controller x' = A x + B y, u = C x + D y, the H-infinity ``norm`` of the loop (of H2 controllers None), and
    reciprocal condition numbers of the transformations of controls and measurements and of both Riccati equations.
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
    Towards the infimum, poles of controllers may go to infinity.

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
        best = _attempt(ctrlsys, normal.matrices, measurements, controls,
                        relaxation * float(best.norm or 0.0)) or best  # fmt: skip
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
    if not _is_stable(loop[0]):
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

    Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 14.5; SLICOT's SB10HD.
    """
    ctrlsys = need_ctrlsys(caller)
    normal = _normalized(plant, measurements, controls, caller)
    a, b, c, d = normal.matrices
    performance = c.shape[0] - measurements
    if d[:performance, : b.shape[1] - controls].any():
        raise ResponseError(f"{caller}: the plant has feedthrough from w to z, and its H2 norm is infinite; filter w "
                            f"or z, or take hinfsyn.")  # fmt: skip
    copies = [np.asfortranarray(matrix.copy()) for matrix in (a, b, c, d)]
    sizes = len(a), b.shape[1], len(c), controls, measurements
    ak, bk, ck, dk, conditions, failed = ctrlsys.sb10hd(*sizes, *copies, 0.0)
    if failed:
        raise ResponseError(f"{caller}: no controller was found (SLICOT's SB10HD ends with {failed}). Each control "
                            f"must cost and each measurement have noise, and all that is unstable be in reach of "
                            f"both.")  # fmt: skip
    if not _is_stable(closed_loop(normal.matrices, (ak, bk, ck, dk), measurements, controls)[0]):
        raise ResponseError(f"{caller}: the controller of SLICOT's SB10HD does not stabilise the plant, as its Riccati "
                            f"equations are ill-conditioned (reciprocal conditions down to {np.min(conditions):.1e}). "
                            f"Give controls more cost and measurements more noise, or leave out motions that neither "
                            f"reaches.")  # fmt: skip
    return Synthesis(*normal.controller((ak, bk, ck, dk)), None, np.asarray(conditions))


@dataclass(frozen=True, slots=True)
class _Normalized:
    """A plant in units of its own: ``matrices`` A, B, C, D; the units of time [1/s] ``rate``, of ``controls`` and
    ``measurements``, and of the ``performance`` per disturbance.

    Times of the highest pole; balanced states with |B1| = |C1|; controls of unit cost and measurements of unit noise;
    a response from w to z of size one. So a controller does not depend on the units of the plant.
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


def _normalized(
    plant: tuple[Array, Array, Array, Array], measurements: int, controls: int, caller: str
) -> _Normalized:  # fmt: skip
    a, b, c, d = (np.array(matrix, dtype=float) for matrix in plant)
    if not len(a):  # SLICOT returns at once, with any controller
        raise ResponseError(f"{caller}: the plant has no states; expected one with dynamics, its own or a filter's.")
    o, i = len(c) - measurements, b.shape[1] - controls
    rate = float(np.abs(np.linalg.eigvals(a)).max(initial=0.0)) or float(np.abs(a).max(initial=0.0)) or 1.0
    a, b, c = scaled(a / rate, b / rate, c)
    size = _size(a, b[:, :i], c[:o], d[:o, :i])
    c[:o], d[:o] = c[:o] / size, d[:o] / size
    cost, noise = np.linalg.norm(d[:o, i:], axis=0), np.linalg.norm(d[o:, :i], axis=1)
    cost, noise = (1.0 / np.where(norms > 0.0, norms, 1.0) for norms in (cost, noise))
    b[:, i:], d[:, i:] = b[:, i:] * cost, d[:, i:] * cost
    c[o:], d[o:] = c[o:] * noise[:, None], d[o:] * noise[:, None]
    sizes = float(np.linalg.norm(b[:, :i])), float(np.linalg.norm(c[:o]))
    unit = np.sqrt(sizes[0] / sizes[1]) if all(sizes) else 1.0
    return _Normalized((a, b / unit, c * unit, d), rate, cost, noise, size)


def _is_stable(a: Array) -> bool:
    """Tell whether all eigenvalues decay despite their errors."""
    return bool(spectrum(a).decaying.all())


def _size(a: Array, b: Array, c: Array, d: Array) -> float:
    """The largest gain of a plant at some frequencies, 1 if it is zero."""
    with np.errstate(all="ignore"):
        gains = [np.linalg.norm(d + c @ np.linalg.lstsq(1j * w * np.eye(len(a)) - a, b.astype(complex), rcond=None)[0])
                 for w in SAMPLES]  # fmt: skip
    size = max(gains, default=0.0)
    return float(size) if 0.0 < size < np.inf else 1.0
