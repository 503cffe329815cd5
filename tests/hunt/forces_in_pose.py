"""Constraints of a scene and forces in its pose, and their derivatives in absolute coordinates.

x are six displacements of each body and node, the ground's last; V is the potential of springs and gravity.
"""

from dataclasses import dataclass

import numpy as np

from tests.hunt.joints import coupler_terms, joint_view
from tests.hunt.pairs import load, pair


@dataclass
class Sum:
    """Gradient and tangent that add up over elements, and the sizes of what adds up to the gradient."""

    gradient: np.ndarray
    tangent: np.ndarray
    size: np.ndarray

    def add(self, index, gradient, tangent):
        self.gradient[index] += gradient
        self.size[index] += np.abs(gradient)
        self.tangent[np.ix_(index, index)] += tangent


class ForcesInPose:
    """What elements do about the pose; ``number`` gives the first coordinate of each body, ``origins`` its centre."""

    def __init__(self, scene, origins, number, elements=(), weights=()):
        self.scene, self.origins, self.number = scene, origins | {"ground": np.zeros(3)}, number
        self.size = 6 * len(number)
        self.elements = elements
        self.views = {call.name: joint_view(call, self.origins) for call in scene.of("joint")}
        self.couplers = [coupler_terms(call, self.views) for call in scene.of("coupler", "gear", "worm", "rack")]
        self.weights = weights
        self._rows()
        self._free_forces()

    def _local(self, first, second, axes):
        """Coordinates of two bodies, and the rotation of all their vectors into axes."""
        index = np.concatenate([np.arange(6) + self.number[name] for name in (first, second)])
        return index, np.kron(np.eye(4), axes.T)

    def _evaluate(self, function, view, multipliers=None):
        arms = [view.axes.T @ (view.point - self.origins[view.first]) - view.gap,
                view.axes.T @ (view.point - self.origins[view.second])]  # fmt: skip
        return function(multipliers, *arms, view.gap, view.other)

    def _function(self, view):
        return pair("line") if view.kind == "distance" else pair("joint", view.kind, tuple(view.free))

    def _rows(self):
        """The Jacobian of all constraints; ``start[joint]`` is the first row of each."""
        rows, self.start = [], {}
        for view in self.views.values():
            self.start[view.name] = len(rows)
            index, turn = self._local(view.first, view.second, view.axes)
            for row in self._evaluate(self._function(view), view)[1] @ turn:
                rows.append(np.zeros(self.size))
                rows[-1][index] = row
        self.own = len(rows)
        for terms in self.couplers:
            rows.append(sum(factor * self.coordinate_row(joint, direction) for joint, direction, factor in terms))
        self.jacobian = np.array(rows).reshape(-1, self.size)

    def _free_forces(self):
        """Gradient of the potential less the loads, and tangent, of all but joints and beam elements."""
        self.sum = Sum(np.zeros(self.size), np.zeros((self.size, self.size)), np.zeros(self.size))
        for call in self.scene.of("spring"):
            self._line(call.arguments)
        for call in self.scene.of("bushing"):
            a = call.arguments
            self._bushing(a["first"], a["second"], a["position"], a.get("orientation", np.eye(3)),
                          a.get("stiffness"), a.get("preload"))  # fmt: skip
        for call in self.scene.of("torsion_spring"):
            a = call.arguments
            self._torsion(a["first"], a["second"], a["axis"], a.get("stiffness", 0.0), a.get("preload") or 0.0)
        dead = load(False)
        if self.scene.gravity is not None:
            for call in self.scene.of("body"):
                self.sum.gradient[np.arange(3) + self.number[call.name]] -= call.arguments["mass"] * np.array(
                    self.scene.gravity)  # fmt: skip
        for body, point, force in self.weights:
            self._load(dead, body, point, force, np.zeros(3))
        for call in self.scene.of("load"):
            a = call.arguments
            point = a["position"] if a.get("position") is not None else self.origins[a["body"]]
            self._load(load(bool(a.get("follower"))), a["body"], point, a.get("force", np.zeros(3)),
                       a.get("torque", np.zeros(3)))  # fmt: skip

    def _load(self, function, body, point, force, torque):
        value, derivative = function(force, torque, np.subtract(point, self.origins[body]))
        self.sum.add(np.arange(6) + self.number[body], -value[:, 0], -derivative)

    def _line(self, a):
        start, end = np.array(a["start"], dtype=float), np.array(a["end"], dtype=float)
        length, k = float(np.linalg.norm(end - start)), a.get("stiffness", 0.0)
        tension = a.get("preload") or 0.0
        if a.get("free_length") is not None:
            tension = k * (length - a["free_length"])
        index, _ = self._local(a["first"], a["second"], np.eye(3))
        _, jacobian, hessian, *_ = pair("line")([tension], start - self.origins[a["first"]],
                                                end - self.origins[a["second"]], end - start)  # fmt: skip
        self.sum.add(index, tension * jacobian[0], hessian + k * np.outer(jacobian[0], jacobian[0]))

    def _bushing(self, first, second, point, axes, stiffness, preload):
        axes = np.array(axes, dtype=float)
        index, turn = self._local(first, second, axes)
        multipliers = np.zeros(6) if preload is None else -np.array(preload, dtype=float)
        arms = [axes.T @ np.subtract(point, self.origins[name]) for name in (first, second)]
        _, jacobian, hessian, *_ = pair("bushing")(multipliers, *arms)
        k = np.zeros((6, 6)) if stiffness is None else np.array(stiffness, dtype=float)
        k = np.diag(k) if k.ndim == 1 else k
        self.sum.add(index, turn.T @ jacobian.T @ multipliers, turn.T @ (hessian + jacobian.T @ k @ jacobian) @ turn)

    def _torsion(self, first, second, axis, stiffness, preload):
        z = np.array(axis) / np.linalg.norm(axis)
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        index, turn = self._local(first, second, np.column_stack((x, np.cross(z, x), z)))
        _, jacobian, hessian, *_ = pair("twist")([-preload], np.zeros(3), np.zeros(3))
        self.sum.add(index, turn.T @ jacobian[0] * -preload,
                     turn.T @ (hessian + stiffness * np.outer(jacobian[0], jacobian[0])) @ turn)  # fmt: skip

    def coordinate_row(self, joint, direction):
        """A joint's coordinate as couplers know it, (n,) per displacements of the bodies."""
        view, row = self.views[joint], np.zeros(self.size)
        index, turn = self._local(view.first, view.second, view.axes)
        function = pair("coordinate", view.kind, tuple(view.free), direction)
        row[index] = (self._evaluate(function, view)[1] @ turn)[0]
        return row

    def stretches(self):
        """Rows (6 elements, n) of what beam elements see between their rigid halves."""
        rows = np.zeros((6 * len(self.elements), self.size))
        for k, (first, second, point, axes) in enumerate(self.elements):
            index, turn = self._local(first, second, axes)
            arms = [axes.T @ np.subtract(point, self.origins[name]) for name in (first, second)]
            rows[6 * k : 6 * k + 6, index] = pair("bushing")(None, *arms)[1] @ turn
        return rows

    def under(self, multipliers, preloads):
        """Tangent of all, wrenches in joints by name, and the derivatives of their components by x and multipliers."""
        total = Sum(self.sum.gradient.copy(), self.sum.tangent.copy(), self.sum.size.copy())
        rows = len(self.jacobian)
        world, by_x, by_l = ({name: np.zeros(shape) for name in self.views} for shape in (6, (6, self.size), (6, rows)))
        ends = [*self.start.values(), self.own][1:]
        for view, end in zip(self.views.values(), ends, strict=True):
            own = slice(self.start[view.name], end)
            self._of_joint(view, self._function(view), multipliers[own], (total, world, by_x, by_l), own, 1.0)
        for k, terms in enumerate(self.couplers, self.own):
            for joint, direction, factor in terms:
                view = self.views[joint]
                function = pair("coordinate", view.kind, tuple(view.free), direction)
                self._of_joint(view, function, [factor * multipliers[k]], (total, world, by_x, by_l),
                               slice(k, k + 1), factor)  # fmt: skip
        for k, (first, second, point, axes) in enumerate(self.elements):
            index, turn = self._local(first, second, axes)
            arms = [axes.T @ np.subtract(point, self.origins[name]) for name in (first, second)]
            total.add(index, 0.0, turn.T @ pair("bushing")(-preloads[6 * k : 6 * k + 6], *arms)[2] @ turn)
        return total.tangent, world, by_x, by_l

    def _of_joint(self, view, function, multipliers, result, own, factor):
        total, world, by_x, by_l = result
        index, turn = self._local(view.first, view.second, view.axes)
        _, _, hessian, wrench, parts_x, parts_l = self._evaluate(function, view, multipliers)
        total.add(index, 0.0, turn.T @ hessian @ turn)
        world[view.name] += np.kron(np.eye(2), view.axes) @ wrench[:, 0]
        by_x[view.name][:, index] += parts_x @ turn
        by_l[view.name][:, own] += factor * parts_l
