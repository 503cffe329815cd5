"""Mutants of a source file: one changed expression or statement each.

Texts are left: messages, warnings, docstrings, functions that return a str; so are constants in capitals and what is
compared with them, which are tolerances.
"""

from __future__ import annotations

import ast
import copy
import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or, ast.Or: ast.And,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
# functions of which the order of arguments says nothing, or without which nothing runs
SYMMETRIC = {"maximum", "minimum", "max", "min", "isinstance", "zip", "cast", "getattr", "hasattr", "allclose", "add",
             "two_sum", "swapaxes"}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """Bytes ``start`` to ``stop`` of a file become ``text``; ``lines`` are those of the changed node."""

    file: Path
    lines: range
    start: int
    stop: int
    text: str
    what: str

    def source(self) -> bytes:
        before = self.file.read_bytes()
        return before[: self.start] + self.text.encode() + before[self.stop :]

    def diff(self) -> str:
        before, after = (text.decode().splitlines() for text in (self.file.read_bytes(), self.source()))
        return "\n".join([*difflib.unified_diff(before, after, n=1, lineterm="")][2:])


def variants(node: ast.AST) -> list[tuple[str, ast.AST | None]]:
    """What may become of a node: (name of the change, new node; None: no statement)."""
    result: list[tuple[str, ast.AST | None]] = []

    def changed(what, **fields):
        other = copy.deepcopy(node)
        for key, value in fields.items():
            setattr(other, key, value)
        result.append((what, other))

    match node:
        case ast.BinOp(left=left, op=op, right=right) if not any(map(_is_text, (left, right))):
            if type(op) in SWAPS:
                changed("operator", op=SWAPS[type(op)]())
            if isinstance(op, (ast.Add, ast.Sub, ast.Mult, ast.BitOr, ast.BitAnd)):
                result.extend([("dropped right", left), ("dropped left", right)])
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
            result.append(("sign", operand))
        case ast.Compare(ops=[op]):
            changed("comparison", ops=[SWAPS[type(op)]()])
        case ast.BoolOp(op=op, values=[first, *rest]):
            changed("and/or", op=SWAPS[type(op)]())
            result.extend([("dropped condition", first)] if len(rest) == 1 else [])
        case ast.Attribute(value=value, attr="T"):
            result.append(("transpose", value))
        case ast.Constant(value=float(number)) if number not in (0.0, 1.0, 1e-300):  # which guards divisions
            changed("factor", value=1.0 if number in (0.5, 2.0) else 2.0 * number)
        case ast.Subscript(slice=ast.Constant(value=int(index))):
            changed("index", slice=ast.Constant(1 - index if index in (0, 1) else index - 1))
        case ast.Subscript(slice=ast.Tuple(elts=[first, second, *rest])) if ast.dump(first) != ast.dump(second):
            changed("index order", slice=ast.Tuple([second, first, *rest], ast.Load()))
        case ast.Call(func=func, args=[first, second, *rest]) if ast.dump(first) != ast.dump(second):
            if ast.unparse(func).rpartition(".")[2] not in SYMMETRIC:
                changed("argument order", args=[second, first, *rest])
        case ast.IfExp(body=body, orelse=orelse):
            result.extend([("branch", body), ("branch", orelse)])
        case ast.If(body=[*_, last]):
            check = isinstance(last, ast.Raise) or "warn(" in ast.unparse(last)
            result.append(("removed check" if check else "branch", ast.Constant(False)))
            result.extend([] if check else [("branch", ast.Constant(True))])
        case ast.AugAssign(op=op):
            result.append(("dropped statement", None))
            if type(op) in SWAPS:
                changed("operator", op=SWAPS[type(op)]())
        case ast.Expr(value=ast.Call()):
            result.append(("dropped statement", None))
    return result


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, (ast.List, ast.Tuple, ast.JoinedStr)) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str))  # fmt: skip


def _mutable(tree: ast.Module):
    """All nodes that may change."""
    stack: list[ast.AST] = [tree]
    while stack:
        node = stack.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        yield node
        inside = list(ast.iter_child_nodes(node))
        match node:
            case ast.FunctionDef(name=name, body=body, returns=returns):
                text = name in ("__repr__", "__str__") or (returns is not None and ast.unparse(returns) == "str")
                inside = [] if text else [*body]
            case ast.ClassDef(body=body):
                inside = [item for item in body if isinstance(item, ast.FunctionDef)]
            case ast.AnnAssign(value=value):
                inside = [] if value is None else [value]
            case ast.Assign(targets=[target]) if ast.unparse(target).isupper():
                inside = []
            case ast.Compare() if any(isinstance(n, ast.Name) and n.id.isupper() and len(n.id) > 1
                                      for n in ast.walk(node)):  # fmt: skip
                inside = []
            case ast.Raise() | ast.JoinedStr():
                inside = []
            case ast.Expr(value=ast.Call(func=func)) if ast.unparse(func).endswith("warn"):
                inside = []
        stack.extend(inside)


def mutants(file: Path) -> list[Mutant]:
    """All mutants of a file."""
    source = file.read_bytes()
    begin = [0]
    for line in source.splitlines(keepends=True):
        begin.append(begin[-1] + len(line))
    result = []
    for node in _mutable(ast.parse(source)):
        for what, other in variants(node):
            at: Any = node.test if isinstance(node, ast.If) else node
            start, stop = begin[at.lineno - 1] + at.col_offset, begin[at.end_lineno - 1] + at.end_col_offset
            text = "pass" if other is None else ast.unparse(other)
            text = text if isinstance(at, ast.stmt) else f"({text})"
            result.append(Mutant(file, range(at.lineno, at.end_lineno + 1), start, stop, text, what))
    return result
