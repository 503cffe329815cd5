"""Messages of the library on the command line name commands, options and entries of files; else they say Python."""

import ast
import re
from pathlib import Path

import pytest

import mbsvib
import mbsvib_export
from mbsvib.cli._shell import in_commands

CALL = re.compile(r"\b(?:model|system|loop)\.(?:[a-z_]+\(|linearize|moved|with_values|simulate|explain|modes|feedback)"
                  r"|\b[a-z_]{5,}\(\)|\badd_\w+|\b[a-z_]+=(?:True|False)|\b(?:method|realization)='")  # fmt: skip
VALUE = re.compile(r"\{[^{}]*(?:\{[^{}]*\}[^{}]*)*\}")


def messages():
    """All texts of several words in the library that are no docstrings, with NAME for what they insert."""
    for package in (mbsvib, mbsvib_export):
        for path in sorted(Path(package.__file__).parent.rglob("*.py")):
            if "cli" in path.parts:
                continue
            tree = ast.parse(path.read_text(encoding="utf-8"))
            docs = {id(node.body[0].value) for node in ast.walk(tree) if hasattr(node, "body") and isinstance(
                node.body, list) and node.body and isinstance(node.body[0], ast.Expr)}  # fmt: skip
            inner = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)
                     if part is not node}  # fmt: skip
            for node in ast.walk(tree):
                if isinstance(node, ast.JoinedStr) and id(node) not in inner:
                    yield path.name, "".join(
                        part.value if isinstance(part, ast.Constant) else "NAME" for part in node.values)
                elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs | inner:
                    yield path.name, node.value


@pytest.mark.slow
def test_no_message_names_python_without_saying_so():
    unmarked = []
    for where, words in messages():
        if words.count(" ") < 3 or words.lstrip().startswith(("<", "self.")) or not CALL.search(words):
            continue
        told = in_commands(words)
        unmarked += [f"{where}: {told}" for call in CALL.finditer(told)
                     if " in Python" not in told[call.start() : call.end() + 90]]  # fmt: skip
    assert unmarked == []


@pytest.mark.parametrize(("call", "command"), [
    ("call linearize(align=1e-3).", "call --align 1e-3."),
    ("model.equilibrium().linearize()", "'mbsvib equilibrium MODEL -o FILE.yaml'"),
    ("equilibrium(preload='k*')", "'mbsvib equilibrium MODEL --preload 'k*' -o FILE.yaml'"),
    ("outputs=[...].", "--output NAME."), ("choose inputs=['Fx', 'Fy'].", "choose --input Fx --input Fy."),
    ("add some by add_input().", "add some by an entry of inputs in the model file."),
    ("an input (model.add_input)", "an input (an entry of inputs in the model file)"),
    ("add_body has no such word.", "an entry of bodies in the model file has no such word."),
    ("add one by model.add_bushing().", "add one by an entry of springs in the model file with 'type: bushing'."),
    ("Leave it out by leave=['door'] (--leave).", "Leave it out by --leave door."),
    ("pass floating=True (--floating)", "pass --floating"),
    ("load_urdf(..., inertia='repair'), or --inertia", "--inertia"),
    ("give the load as follower=True", "give the load as follower: true"),
    ("wanted, modes(10), or modes(10, near=f) around", "wanted, --count 10, or --count 10 --near HZ around"),
    ("compare with model.simulate().", "compare with model.simulate() in Python."),
    ("then inputs; both are keywords as well: outputs=..., inputs=....", "then inputs; their options are --output and "
     "--input."),
    ("use linearize(method='dense')", "use linearize(method='dense') in Python"),
    ("model.yaml, line 3: 'model.mass'", "model.yaml, line 3: 'model.mass'"),
    ("Bodies are: system.body, loop.arm", "Bodies are: system.body, loop.arm"),
])  # fmt: skip
def test_calls_have_their_commands(call, command):
    assert in_commands(call) == command
