"""The text of exports to C: header, source and test program of a discrete-time state space."""

from __future__ import annotations

import re
from dataclasses import dataclass
from string import Template
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.responses.state_space import StateSpace

MARK = "Written by mbsvib for '{name}'"
_METHODS = {
    "zoh": "exact for inputs that are held over each step",
    "foh": "exact for inputs that are linear over each step",
    "tustin": "Tustin's rule",
}
WIDTH, INDENT = 100, "    "

_HEADER = Template("""\
$banner

#ifndef ${upper}_H
#define ${upper}_H

#ifdef __cplusplus
extern "C" {
#endif

#define ${upper}_STATES $states
#define ${upper}_INPUTS $inputs
#define ${upper}_OUTPUTS $outputs
#define ${upper}_STEP $step /* [s] */

/* Indices of inputs and outputs. */
$indices

typedef struct {
    $real x[${upper}_STATES ? ${upper}_STATES : 1];
} ${prefix}_state;

/* Set all states to zero. */
void ${prefix}_reset(${prefix}_state *state);

/* Outputs of this sample. */
void ${prefix}_outputs(const ${prefix}_state *state, const $real u[], $real y[]);

/* Go on to the next sample. */
void ${prefix}_update(${prefix}_state *state, const $real u[]);

/* Both: the outputs of this sample, then on to the next; u and y do not overlap. */
void ${prefix}_step(${prefix}_state *state, const $real u[], $real y[]);

#ifdef __cplusplus
}
#endif

#endif /* ${upper}_H */
""")
_SOURCE = Template("""\
$banner

#include "${prefix}.h"

#define COLUMNS (${upper}_STATES + ${upper}_INPUTS)

/* Nonzero entries of [A B] and [C D]; those of row r stand at start[r] ... start[r + 1] - 1. */
$arrays

/* States, then inputs. */
static void join(const ${prefix}_state *state, const $real u[], $real all[])
{
    int i;

    for (i = 0; i < ${upper}_STATES; i++) {
        all[i] = state->x[i];
    }
    for (i = 0; i < ${upper}_INPUTS; i++) {
        all[${upper}_STATES + i] = u[i];
    }
}

static void multiply(int rows, const int start[], const int column[], const $real value[], const $real all[],
                     $real result[])
{
    $real sum;
    int r, k;

    for (r = 0; r < rows; r++) {
        sum = $zero;
        for (k = start[r]; k < start[r + 1]; k++) {
            sum += value[k] * all[column[k]];
        }
        result[r] = sum;
    }
}

void ${prefix}_reset(${prefix}_state *state)
{
    int i;

    for (i = 0; i < ${upper}_STATES; i++) {
        state->x[i] = $zero;
    }
}

void ${prefix}_outputs(const ${prefix}_state *state, const $real u[], $real y[])
{
    $real all[COLUMNS];

    join(state, u, all);
    multiply(${upper}_OUTPUTS, output_start, output_column, output_value, all, y);
}

void ${prefix}_update(${prefix}_state *state, const $real u[])
{
    $real all[COLUMNS];

    join(state, u, all);
    multiply(${upper}_STATES, next_start, next_column, next_value, all, state->x);
}

void ${prefix}_step(${prefix}_state *state, const $real u[], $real y[])
{
    $real all[COLUMNS];

    join(state, u, all);
    multiply(${upper}_OUTPUTS, output_start, output_column, output_value, all, y);
    multiply(${upper}_STATES, next_start, next_column, next_value, all, state->x);
}
""")
_TEST = Template("""\
$banner

#include <stdio.h>

#include "${prefix}.h"

#define SAMPLES $samples

$inputs

$expected

/* Bound of the rounding of each output. */
$tolerance

int main(void)
{
    ${prefix}_state state;
    $real y[${upper}_OUTPUTS], error;
    int wrong = 0, k, i;

    ${prefix}_reset(&state);
    for (k = 0; k < SAMPLES; k++) {
        ${prefix}_step(&state, inputs[k], y);
        for (i = 0; i < ${upper}_OUTPUTS; i++) {
            error = y[i] - expected[k][i];
            if (!(error <= tolerance[i] && -error <= tolerance[i])) {
                printf("sample %d, output %d: %.17g, expected %.17g\\n", k, i, (double)y[i], (double)expected[k][i]);
                wrong++;
            }
        }
    }
    printf("%s: %d of %d values differ\\n", wrong ? "FAILED" : "passed", wrong, SAMPLES * ${upper}_OUTPUTS);
    return wrong != 0;
}
""")


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What is written: the ``prefix`` of names, the continuous ``space``, the discrete ``matrices`` A, B, C, D, and the
    test vectors.
    """

    prefix: str
    space: StateSpace
    step: float
    method: str
    matrices: tuple[Array, Array, Array, Array]
    precision: str
    inputs: Array
    expected: Array
    tolerance: Array

    @property
    def words(self) -> dict[str, str]:
        """What all three files share."""
        return {"prefix": self.prefix, "upper": self.prefix.upper(), "real": self.real}

    @property
    def real(self) -> str:
        """The type of numbers."""
        return "double" if self.precision == "double" else "float"

    def number(self, value: float) -> str:
        """A literal of that type, with all digits."""
        if self.precision == "double":
            return repr(float(value))
        text = str(np.float32(value))
        return f"{text if any(mark in text for mark in '.en') else text + '.0'}f"

def header(plan: Plan) -> str:
    """Return the text of the header."""
    space, upper = plan.space, plan.prefix.upper()
    return _HEADER.substitute(
        plan.words, banner=_banner(plan), states=len(space.states), inputs=len(space.inputs),
        outputs=len(space.outputs), step=plan.number(plan.step),
        indices="\n".join((*_indices(f"{upper}_IN", space.inputs, space.input_units),
                           *_indices(f"{upper}_OUT", space.outputs, space.output_units))),
    )  # fmt: skip


def source(plan: Plan) -> str:
    """Return the text of the source."""
    a, b, c, d = plan.matrices
    arrays = _sparse(plan, "next", np.hstack((a, b))) + _sparse(plan, "output", np.hstack((c, d)))
    return _SOURCE.substitute(plan.words, banner=_banner(plan), arrays="\n".join(arrays), zero=plan.number(0.0))


def test_program(plan: Plan) -> str:
    """Return the text of the program that compares the compiled code with test vectors."""
    prefix, upper, real = plan.prefix, plan.prefix.upper(), plan.real
    return _TEST.substitute(
        plan.words, banner=_banner(plan, f"cc -std=c99 {prefix}.c {prefix}_test.c -o {prefix}_test"),
        samples=len(plan.inputs),
        inputs=_table(plan, f"static const {real} inputs[SAMPLES][{upper}_INPUTS]", plan.inputs),
        expected=_table(plan, f"static const {real} expected[SAMPLES][{upper}_OUTPUTS]", plan.expected),
        tolerance=_values(f"static const {real} tolerance[{upper}_OUTPUTS]", [plan.number(v) for v in plan.tolerance]),
    )  # fmt: skip


def _banner(plan: Plan, compile_with: str | None = None) -> str:
    """The comment at the head of a file."""
    space = plan.space
    lines = [
        f"/* {MARK.format(name=ascii_text(space.name))}, version {__version__}.",
        " * x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k)",
        f" * step {plan.step:g} s, {_METHODS[plan.method]}; {len(space.states)} states ({space.realization}), "
        f"{plan.precision} precision. SI units and radians.",
    ]  # fmt: skip
    return "\n".join([*lines, *([f" * Compile: {compile_with}"] if compile_with else []), " */"])


def ascii_text(text: str) -> str:
    """Return a text as a C comment can hold it."""
    plain = text.encode("ascii", "backslashreplace").decode()
    return plain.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").replace("\n", " ").replace("\\", "/")


def _indices(prefix: str, names: Sequence[str], units: Sequence[str]) -> Iterator[str]:
    """Named indices; names that become one word in C get their number."""
    words = [re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_").upper() for name in names]
    for i, (name, unit, word) in enumerate(zip(names, units, words, strict=True)):
        unique = word if word and words.count(word) == 1 else f"{word}_{i}".lstrip("_")
        yield f"#define {prefix}_{unique} {i} /* {ascii_text(name)}{f' [{ascii_text(unit)}]' if unit else ''} */"


def _sparse(plan: Plan, name: str, matrix: Array) -> list[str]:
    """The arrays of a matrix over states and inputs; C has no empty ones."""
    at, column = np.nonzero(matrix)
    start = np.searchsorted(at, np.arange(len(matrix) + 1))
    values = [plan.number(value) for value in matrix[at, column]] or [plan.number(0.0)]
    columns = [str(k) for k in column] or ["0"]
    return [
        _values(f"static const {plan.real} {name}_value[{len(values)}]", values),
        _values(f"static const int {name}_column[{len(columns)}]", columns),
        _values(f"static const int {name}_start[{len(start)}]", [str(k) for k in start]),
    ]


def _values(declaration: str, values: Sequence[str]) -> str:
    return f"{declaration} = {{\n{fill(', '.join(values), WIDTH, initial_indent=INDENT, subsequent_indent=INDENT)}\n}};"


def _table(plan: Plan, declaration: str, rows: Array) -> str:
    lines = ["{" + ", ".join([plan.number(value) for value in row]) + "}" for row in rows.tolist()]
    wrapped = [fill(line, WIDTH, initial_indent=INDENT, subsequent_indent=INDENT + " ") for line in lines]
    return f"{declaration} = {{\n" + ",\n".join(wrapped) + "\n};"
