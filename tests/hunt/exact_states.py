"""State equations in 300 bits from the factors of a system, whose data are exact doubles, and what follows from them.

All is computed within ``flint.ctx.workprec(BITS)``.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import flint
import mpmath as mp
import numpy as np

from tests.hunt.reference import CHANGE
from tests.support.unsymmetric import matrices

BITS = 300
BESIDE = 1e-13  # distance from a pole, which is known to some roundings


@dataclass(frozen=True)
class ExactStates:
    """x' = A x + B u, y = C x + D u with matrices of FLINT, for states (q, q')."""

    A: Any
    B: Any
    C: Any
    D: Any

    @classmethod
    def of(cls, system, rng=None):
        """The state equations of a system; ``rng`` changes every entry by a rounding of its own.

        Where motions N have no mass, q = E a + N p with coordinates a of the others, and their dampers give p':
        the states are (a, p, a').
        """
        with mp.workprec(BITS):
            mass, damping, stiffness = (changed(unrounded(m), rng) for m in matrices(system))
        b, cq, cv, ca, d = (changed(number_matrix(np.asarray(m)), rng)
                            for m in (system.B, system.Cq, system.Cv, system.Ca, system.D))  # fmt: skip
        null = np.zeros((system.dof, 0)) if system.null_inertia is None else np.array(system.null_inertia)
        others = dependent_of(null)
        e, n = number_matrix(np.eye(system.dof)[:, others]), number_matrix(null)
        turn, k, p, inputs = blocks([[e, n]]), len(others), null.shape[1], b.ncols()
        # (a', p') = R x + S u
        if p:
            at_once = (n.transpose() * damping * n).inv()
            left = [-1 * (at_once * (n.transpose() * part)) for part in (stiffness * turn, damping * e, -1 * b)]
        else:
            left = [zero(0, k), zero(0, k), zero(0, inputs)]
        rates = blocks([[zero(k, k + p), identity(k)], [left[0], left[1]]])
        pushed = blocks([[zero(k, inputs)], [left[2]]])
        place = blocks([[turn, zero(system.dof, k)]])
        rate, push = turn * rates, turn * pushed
        inverse = (e.transpose() * mass * e).inv() * e.transpose()
        a_motion = -1 * (inverse * (stiffness * place + damping * rate))
        b_motion = inverse * (b - damping * push)
        a, b = blocks([[rates], [a_motion]]), blocks([[pushed], [b_motion]])
        # q'' = R x' + S u', of which outputs see no u'
        return cls(a, b, cq * place + cv * rate + ca * (rate * a), d + cv * push + ca * (rate * b))

    def doubles(self):
        """A, B, C, D rounded once."""
        return tuple(rounded(m) for m in (self.A, self.B, self.C, self.D))

    def eigenvalues(self):
        values = flint.acb_mat(self.A).eig(algorithm="approx")
        return np.array([complex(v.real.mid(), v.imag.mid()) for v in values])

    def response(self, omega):
        """G(j omega) of shape (outputs, inputs, frequencies)."""
        n, result = self.A.nrows(), []
        for w in omega:
            left = flint.acb_mat(-1 * self.A) + flint.acb_mat(identity(n)) * flint.acb(0, float(w))
            g = flint.acb_mat(self.C) * left.solve(flint.acb_mat(self.B)) + flint.acb_mat(self.D)
            result.append([[complex(v.real.mid(), v.imag.mid()) for v in row] for row in g.tolist()])
        return np.moveaxis(np.array(result).reshape(len(omega), self.C.nrows(), self.B.ncols()), 0, 2)

    def time_response(self, step, inputs, hold, start):
        """Outputs (outputs, samples) for inputs (inputs, samples) that a hold of order zero or one connects."""
        n, p, h = self.A.nrows(), self.B.ncols(), flint.arb(float(step))
        exponential = blocks([
            [self.A * h, self.B * h, zero(n, p)],
            [zero(p, n), zero(p, p), identity(p)],
            [zero(p, n), zero(p, p), zero(p, p)],
        ]).exp()  # fmt: skip
        columns = np.cumsum([0, n, p, p])
        by_state, by_input, by_change = (picked(exponential, range(n), range(a, b))
                                         for a, b in pairwise(columns))  # fmt: skip
        x, result = number_matrix(start[:, None]), []
        for i, now in enumerate(inputs.T):
            now = number_matrix(now[:, None])
            result.append(rounded(self.C * x + self.D * now)[:, 0])
            if i + 1 < inputs.shape[1]:
                change = number_matrix(inputs[:, [i + 1]]) - now
                x = by_state * x + by_input * now + (by_change * change if hold == "first" else zero(n, 1))
                x = flint.arb_mat([[v.mid()] for [v] in x.tolist()])
        return np.array(result).T

    def sampled_pulses(self, step, method, count):
        """Outputs (samples, outputs, inputs) of the sampled system for a pulse of each input at the first sample."""
        if method != "tustin":
            hold, p = {"zoh": "zero", "foh": "first"}[method], self.B.ncols()
            pulse = np.zeros((p, p, count + 1))
            pulse[np.arange(p), np.arange(p), 1] = 1.0  # one sample late, so that a hold of order one rises to it
            start = np.zeros(self.A.nrows())
            return np.stack([self.time_response(step, u, hold, start)[:, 1:].T for u in pulse], axis=2)
        half = flint.arb(float(step)) / 2
        inverse = (identity(self.A.nrows()) - self.A * half).inv()
        a, b, c = inverse * (identity(self.A.nrows()) + self.A * half), inverse * self.B * (2 * half), self.C * inverse
        result = [rounded(self.D + self.C * b * flint.arb(0.5))]
        for _ in range(count - 1):
            result.append(rounded(c * b))
            b = a * b
        return np.array(result)

    def h2_norm(self, output, entry, lasts):
        """The H2 norm of one pair by the sum over pairs of eigenvalues but those that last, without its feedthrough."""
        n, noise = range(self.A.nrows()), np.random.default_rng(0).uniform(1, 2, size=(self.A.nrows(), 1))
        # chains of the eigenvalue 0 have too few vectors: far below rounding of the data they are torn
        torn = number_matrix(noise) * number_matrix(noise).transpose() * (self.size() * flint.arb(2) ** -160)
        values, vectors = flint.acb_mat(self.A + torn).eig(right=True, algorithm="approx")
        b = vectors.inv() * flint.acb_mat(picked(self.B, n, [entry]))
        c = flint.acb_mat(picked(self.C, [output], n)) * vectors
        kept = [i for i in n if not lasts(complex(values[i].real.mid(), values[i].imag.mid()))]
        residues = {i: c[0, i] * b[i, 0] for i in kept}
        square = sum((residues[i] * residues[j] / -(values[i] + values[j]) for i in kept for j in kept), flint.acb(0))
        return float(max(square.real.mid(), 0)) ** 0.5

    def size(self):
        """The largest entry of A."""
        return flint.arb(float(np.abs(rounded(self.A)).max()))

    def growth(self, omega, unit, output, entry):
        """How strongly a response has a pole at j omega: its size beside it times the distance [unit]."""
        return abs(self.response([omega + unit * BESIDE])[output, entry, 0]) * BESIDE

    def closed(self, law, outputs, inputs):
        """The loop u = law(y) of these outputs and inputs (indices), with all inputs and outputs kept."""
        a, b, c, d = (number_matrix(m) for m in (law.A, law.B, law.C, law.D))
        n, z = range(self.A.nrows()), a.nrows()
        b_loop, c_loop = picked(self.B, n, inputs), picked(self.C, outputs, n)
        through = picked(self.D, outputs, inputs)
        d_in = picked(self.D, outputs, range(self.B.ncols()))
        d_out = picked(self.D, range(self.C.nrows()), inputs)
        left = (identity(len(outputs)) - through * d).inv()
        # y = of_plant x + of_law z + of_input w, u = d y + c z
        of_plant, of_law, of_input = left * c_loop, left * through * c, left * d_in
        u_plant, u_law, u_input = d * of_plant, d * of_law + c, d * of_input
        return ExactStates(
            blocks([[self.A + b_loop * u_plant, b_loop * u_law], [b * of_plant, a + b * of_law]]),
            blocks([[self.B + b_loop * u_input], [b * of_input]]) if z else self.B + b_loop * u_input,
            blocks([[self.C + d_out * u_plant, d_out * u_law]]),
            self.D + d_out * u_input,
        )


def dependent_of(null):
    """Coordinates that say the motions which have mass: all but one of each motion without."""
    independent, rest = [], list(range(len(null)))
    for motion in null.T:
        alone = [i for i in rest if motion[i] == 1.0 and np.count_nonzero(null[i]) == 1]
        independent.append(alone[0])
        rest.remove(alone[0])
    return rest


def unrounded(matrix):
    """A matrix of mpmath's numbers."""
    return flint.arb_mat(matrix.rows, matrix.cols, [flint.arb(v) for v in matrix])


def number_matrix(array):
    """A matrix of doubles, unrounded."""
    return flint.arb_mat(*array.shape, [flint.arb(float(v)) for v in array.ravel()])


def rounded(matrix):
    values = [float(v.mid()) for row in matrix.tolist() for v in row]
    return np.array(values).reshape(matrix.nrows(), matrix.ncols())


def zero(height, width):
    return flint.arb_mat(height, width)


def identity(n):
    return number_matrix(np.eye(n))


def picked(matrix, rows, columns):
    return flint.arb_mat(len(rows), len(columns), [matrix[int(i), int(j)] for i in rows for j in columns])


def blocks(rows):
    """One matrix of rows of blocks."""
    lists = [[block.tolist() for block in row] for row in rows]
    values = [v for row in lists for lines in zip(*row, strict=True) for line in lines for v in line]
    return flint.arb_mat(sum(row[0].nrows() for row in rows), sum(block.ncols() for block in rows[0]), values)


def changed(matrix, rng):
    """The matrix, or one with every entry changed by a share of up to ``CHANGE``."""
    if rng is None:
        return matrix
    shares = iter(1 + CHANGE * rng.uniform(-1, 1, size=matrix.nrows() * matrix.ncols()))
    values = [v * flint.arb(float(next(shares))) for row in matrix.tolist() for v in row]
    return flint.arb_mat(matrix.nrows(), matrix.ncols(), values)
