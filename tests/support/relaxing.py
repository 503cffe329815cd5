"""An independent reference for mechanisms with Maxwell elements, in 50 digits.

What each damper yields is a coordinate z of its own: with r the lengthening of the element, k1 acts on r - z, c on z.
"""

from types import SimpleNamespace

from tests.support.digits import combination, dot, exact, mp, null_space, product, solve, unit_vector
from tests.support.exact import Exact


class Relaxing(Exact):
    """The linear equations of a model, the inner coordinates of its Maxwell elements last."""

    def __init__(self, model):
        plain = {name: part for name, part in model.springs.items() if not hasattr(part, "static_stiffness")}
        self.inner = [part for part in model.springs.values() if hasattr(part, "static_stiffness")]
        parts = ("bodies", "joints", "couplers", "inputs", "outputs")
        super().__init__(SimpleNamespace(springs=plain, **{name: getattr(model, name) for name in parts}))

    def _project(self):
        super()._project()
        m, n = self.dof, len(self.inner)
        grow = lambda rows: [[*row, *[mp.mpf(0)] * n] for row in rows]  # noqa: E731
        square = lambda a: grow(a) + [[mp.mpf(0)] * (m + n) for _ in range(n)]  # noqa: E731
        self.M, self.C, self.K = map(square, (self.M, self.C, self.K))
        self.B = self.B + [[mp.mpf(0)] * len(self.model.inputs) for _ in range(n)]
        self.Cq, self.Cv, self.Ca = map(grow, (self.Cq, self.Cv, self.Ca))
        for i, part in enumerate(self.inner):
            start, end = exact(part.start), exact(part.end)
            along = unit_vector([b - a for a, b in zip(start, end, strict=True)]) + [mp.mpf(0)] * 3
            ends = self.row(part.first, start, along), self.row(part.second, end, along)
            longer = product([[b - a for a, b in zip(*ends, strict=True)]], self.basis)[0] + [mp.mpf(0)] * n
            inner = [mp.mpf(j == m + i) for j in range(m + n)]
            spring = [a - b for a, b in zip(longer, inner, strict=True)]
            for row, weight, name in ((spring, part.stiffness, "K"), (longer, part.static_stiffness, "K"),
                                      (inner, part.damping, "C")):  # fmt: skip
                outer = [[mp.mpf(weight) * a * b for b in row] for a in row]
                setattr(self, name, combination((getattr(self, name), 1), (outer, 1)))
        self.dof = m + n

    @property
    def still(self):
        """How many eigenvalues are 0: motions that no spring holds, and once more those that no damper holds either."""
        both = [len(null_space(rows, self.dof)[0][0]) for rows in (self.K, [*self.K, *self.C])]
        return sum(both)

    def distance(self, value):
        """Relative distance from a number to the nearest eigenvalue, by one step of inverse iteration."""
        s = mp.mpc(value)
        load = [[mp.mpf(1 + (7 * i) % 5)] for i in range(self.dof)]
        shape = solve(combination((self.M, s * s), (self.C, s), (self.K, 1)), load)
        slope = product(combination((self.M, 2 * s), (self.C, 1)), shape)
        left, right = ((dot(*zip(*shape, strict=True), [v for (v,) in part])) for part in (load, slope))
        return float(abs(left / right / s))
