"""Answers of a system that come by its states, compared with state equations in 300 bits."""

import re
from functools import cached_property

import numpy as np

import mbsvib as mv
import mbsvib_export as mx
from tests.hunt.answers import Mismatch
from tests.hunt.exact_states import ExactStates
from tests.hunt.reference import ALLOWED, matched
from tests.hunt.skip import Skip

# States of a scene; larger ones take long.
MOST = 40
# Accuracy that answers must have besides what rounding of the data does: of the largest of a signal, a norm, poles;
# of loops through modal and balanced states; and what is zero in SI units.
RTOL, OF_LOOPS, OF_STATES, NOTHING = 1e-9, 1e-7, 1e-6, 1e-24
# Poles that are 0 next to the fastest come as this share of it; others to OF_POLES of themselves.
OF_ZERO_POLES, OF_POLES, NO_POLE = 1e-6, 1e-8, 1e-9
# Damping below this share of an eigenvalue is none; samples end where motions have grown by exp(GROWTH).
UNDAMPED, GROWTH, SAMPLES = 1e-9, 5.0, 13
# Loops that the law may have, as a share of what the outputs see at a mean frequency.
GAIN, LAW_STATES = 0.3, 3
SEEN, FAINT = 1e-20, 1e-7
# Poles that do not decay are in a response from this share of it on, and are not below the other one.
SHOWN, HIDDEN, ASIDE = 1e-6, 1e-12, 1.03
# Exact zeros come as this share of what other outputs show, beside motions without mass and in norms.
OF_ZEROS = 1e-14
# Damping and eigenvalues below these shares of an eigenvalue, and of the mean one, are 0.
LASTING, STILL = 1e-13, 1e-12
# What reductions refuse by name: orders, and methods of forces that follow the motion.
NOT_REDUCED = re.compile("do not decay and are kept|expected a whole number up to|Ask for at least|does not project")


class States:
    """A subject with its exact state equations, and those of data that rounding changed."""

    def __init__(self, subject):
        self.system, self.question, self.rng = subject.system, subject.question, subject.rng
        if not (self.system.dof and self.system.inputs and self.system.outputs):
            raise Skip("no motion, or no ports")
        self.count = 2 * self.system.dof - self.system.massless
        if self.count > MOST:
            raise Skip("too many states")
        self.eigenvalues = subject.answers.eigenvalues
        self.exact, self.changed = ExactStates.of(self.system), ExactStates.of(self.system, self.rng)
        if not self.exact.response([mean(self.speeds)]).any():
            raise Skip("no output sees an input")

    @cached_property
    def speeds(self):
        """The sizes of eigenvalues that are not zero."""
        size = np.abs(self.eigenvalues)
        size = size[size > 1e-7 * size.max(initial=0.0)]
        return size if len(size) else np.ones(1)

    def duration(self, eigenvalues):
        """Three periods of the mean eigenvalue, and less where motions grow."""
        return min(3 * 2 * np.pi / mean(self.speeds), 20.0 / max(1e-9, eigenvalues.real.max(initial=0.0)))

    def lasts(self, value):
        """Whether an eigenvalue does not decay."""
        return abs(value.real) <= LASTING * abs(value) or abs(value) < STILL * mean(self.speeds)

    def damped(self, share=UNDAMPED):
        return len(self.eigenvalues) > 0 and bool(np.all(self.eigenvalues.real < -share * np.abs(self.eigenvalues)))


def mean(values):
    return float(np.exp(np.mean(np.log(values))))


def agree(answer, expected, changed, share, what, axis=None, besides=0.0):
    """Raise where an answer is off by more than rounding of the data and a share of the largest along ``axis``."""
    largest = np.abs(expected).max(axis=axis, keepdims=True, initial=0.0)
    rounding = np.abs(changed - expected).max(axis=axis, keepdims=True, initial=0.0)
    off = np.abs(answer - expected) / (ALLOWED * rounding + share * largest + NOTHING + besides)
    if not np.all(off <= 1.0):
        where = np.unravel_index(np.argmax(np.where(np.isnan(off), np.inf, off)), off.shape)
        raise Mismatch(f"{what} at {where}: {answer[where]!r}, not {expected[where]!r}: {off[where]:.1e} times allowed")


def time_responses(states):
    """Responses to random inputs from random starts, with both holds."""
    system, rng = states.system, states.rng
    t = np.linspace(0.0, states.duration(states.eigenvalues), 24)
    for hold in ("first", "zero"):
        u = rng.normal(size=(len(system.inputs), len(t)))
        start = 1e-3 * rng.normal(size=states.count) * (not system.massless)
        initial = None if system.massless else (start[: system.dof], start[system.dof :])
        answer = system.time_response(t, u, hold=hold, initial=initial)
        expected, changed = (s.time_response(t[1], u, hold, start) for s in (states.exact, states.changed))
        besides = OF_ZEROS * np.abs(expected).max() * bool(system.massless)
        agree(answer, expected, changed, RTOL, f"time response, hold {hold}", 1, besides)


def norms(states):
    """H2 norms and mean squares of random pairs; modes that last and that no response shows count for nothing."""
    values, feedthrough = states.eigenvalues, states.exact.doubles()[3]
    if np.any(values.real > UNDAMPED * np.abs(values)):
        raise Skip("grows")
    whole, compared = np.abs(states.system.frequency_response([mean(states.speeds)])).max(), 0
    for _ in range(3):
        i, j = (int(states.rng.integers(n)) for n in feedthrough.shape)
        ports = states.system.outputs[i], states.system.inputs[j]
        if feedthrough[i, j]:
            continue
        shown = is_shown(states, i, j)
        if shown is None:
            continue
        if shown:
            finite = [what for what, answer in both_norms(states.system, *ports).items() if answer < np.inf]
            if finite:
                raise Mismatch(f"the {' and '.join(finite)} of {ports} is finite, with {shown} in the response")
            compared += 1
            continue
        answers = both_norms(states.system, *ports)
        expected, changed = (np.array([s.h2_norm(i, k, states.lasts) for k in (j, *range(len(feedthrough.T)))])
                             for s in (states.exact, states.changed))  # fmt: skip
        for what, answer in answers.items():
            agree(np.array([answer]), expected[:1], changed[:1], OF_POLES, f"{what} of {ports}",
                  besides=1e-12 * expected.max() + OF_ZEROS * whole * np.sqrt(mean(states.speeds)))  # fmt: skip
        compared += 1
    if not compared:
        raise Skip("feedthrough")


def both_norms(system, output, entry):
    """The H2 norm, and the rms under noise of like intensity; infinite where it is refused as such."""
    try:
        norm = system.h2_norm(output, entry, parameters=[]).value
    except mv.ResponseError as error:
        if "not decay" not in str(error):
            raise
        norm = np.inf
    return {"H2 norm": norm, "rms": system.rms(output, {entry: 2.0})[output]}


def is_shown(states, i, j):
    """A pole in a response that does not decay, "" without any; None where rounding of the data leaves that open."""
    unit, open_ = mean(states.speeds), False
    size = np.abs(states.exact.response(ASIDE * states.speeds)[i, j]).max() + NOTHING
    for value in {complex(0.0, abs(v)) for v in states.eigenvalues if states.lasts(v)}:
        share = states.exact.growth(value.imag, value.imag or unit, i, j) / size
        if share > SHOWN:
            return f"{value:.6g} 1/s, {share:.1e},"
        open_ = open_ or share > HIDDEN
    return None if open_ else ""


def random_law(states):
    """A random controller that the mechanism feels, with its outputs and inputs as indices."""
    system, rng = states.system, states.rng
    outputs = rng.permutation(len(system.outputs))[: int(rng.integers(1, 3))]
    inputs = rng.permutation(len(system.inputs))[: int(rng.integers(1, 3))]
    z, w = int(rng.integers(LAW_STATES)), mean(states.speeds)
    all_pairs = np.abs(states.exact.response([w])[:, :, 0])
    size = all_pairs[np.ix_(outputs, inputs)].max()
    if size < SEEN or size < FAINT * all_pairs.max():
        raise Skip("outputs do not see inputs")
    gain = GAIN / size
    a = np.diag(-w * rng.uniform(0.3, 3.0, size=z))
    if z == 2:
        a[0, 1], a[1, 0] = w * rng.normal(), -w
    b, c = gain * w * rng.normal(size=(z, len(outputs))), rng.normal(size=(len(inputs), z))
    d = gain * rng.normal(size=(len(inputs), len(outputs))) * (not z or rng.random() < 0.7)
    return mv.StateSpace.from_arrays(a, b, c, d), outputs, inputs


def loops(states):
    """Closed loops with a random law: poles, responses, states of every kind, time responses."""
    system, rng, q = states.system, states.rng, states.question
    law, outputs, inputs = random_law(states)
    loop = system.feedback(law, sensors=[system.outputs[i] for i in outputs],
                           actuators=[system.inputs[i] for i in inputs])  # fmt: skip
    exact, changed = (s.closed(law, outputs, inputs) for s in (states.exact, states.changed))
    poles = exact.eigenvalues()
    _, rounding = matched(poles, changed.eigenvalues())
    answers, off = matched(poles, loop.poles())
    size = np.abs(poles)
    zero = np.where(size < NO_POLE * size.max(), OF_ZERO_POLES, 1e-13) * size.max()
    if np.any(off > ALLOWED * rounding + OF_POLES * size + zero):
        i = int(np.argmax(off))
        raise Mismatch(f"the pole {poles[i]:.9g} of a loop is {answers[i]:.9g}")
    if np.all(poles.real < -UNDAMPED * size) and not loop.stable:
        raise Mismatch("a loop that is stable is called unstable")
    omega = q.omega[q.omega > 0]
    expected, other = exact.response(omega), changed.response(omega)
    besides = ALLOWED * q.response_tolerance.max(axis=(1, 2), initial=0.0)[:, None, None]
    agree(loop.response(omega), expected, other, RTOL, "response of a loop", (1, 2), besides)
    for kind in ("physical", "modal", "balanced"):
        try:
            space = loop.state_space(kind)
        except mv.MbsvibError as error:
            if kind == "balanced" or "depend on each other" in str(error):
                continue  # balanced states exist of stable loops, modal ones where eigenvectors are independent
            raise
        agree(space.frequency_response(omega), expected, other, OF_STATES, f"{kind} states of a loop", (1, 2), besides)
    t = np.linspace(0.0, states.duration(poles), 16)
    u = rng.normal(size=(len(system.inputs), len(t)))
    expected, other = (s.time_response(t[1], u, "first", np.zeros(s.A.nrows())) for s in (exact, changed))
    agree(loop.time_response(t, u), expected, other, OF_LOOPS, "time response of a loop", 1)


def sampled(states):
    """Sampled systems of python-control by their responses to pulses."""
    step = 0.1 / states.speeds.max() * states.rng.uniform(0.3, 20.0)
    if states.eigenvalues.real.max() * step * SAMPLES > GROWTH:
        raise Skip("grows")
    for method in ("zoh", "foh", "tustin"):
        answer = pulses(mx.to_control(states.system, dt=step, method=method))
        expected, changed = (s.sampled_pulses(step, method, SAMPLES) for s in (states.exact, states.changed))
        besides = OF_ZEROS * np.abs(expected).max() * bool(states.system.massless)
        agree(answer, expected, changed, OF_STATES, f"sampling by {method}", (0, 2), besides)


def pulses(space):
    """D, C B, C A B, ..."""
    result, x = [space.D], space.B
    for _ in range(SAMPLES - 1):
        result.append(space.C @ x)
        x = space.A @ x
    return np.array(result)


def reduced(states):
    """The error of reduced models is within their bound."""
    system, values = states.system, states.eigenvalues
    if not states.damped(1e-6) or system.dof < 2:
        raise Skip("undamped, or one degree of freedom")
    order = int(states.rng.integers(1, states.count))
    size = np.abs(values)
    omega = np.concatenate([np.geomspace(0.01 * size.min(), 100 * size.max(), 300), size])
    full, compared = system.frequency_response(omega), 0
    for method in ("balanced", "modal", "static-corrected", "craig-bampton"):
        try:
            small = system.reduced(order, method=method)
        except mv.MbsvibError as error:
            if not NOT_REDUCED.search(str(error)):
                raise
            continue
        off, whole = largest(small.frequency_response(omega) - full), largest(full)
        if off > small.error_bound * (1 + 1e-6) + RTOL * whole:
            raise Mismatch(f"{method} of order {order}: the error {off} is above its bound {small.error_bound}")
        compared += 1
    if not compared:
        raise Skip("no order")


def largest(response):
    """The largest singular value over the frequencies."""
    return float(np.linalg.norm(np.moveaxis(response, 2, 0), 2, axis=(1, 2)).max())


CHECKS = (time_responses, norms, loops, sampled, reduced)
