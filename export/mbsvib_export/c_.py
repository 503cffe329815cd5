"""C: a discrete-time state space as source text for controllers' hardware, with test vectors of its own."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import IO, Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.display import Displayed
from mbsvib.common.expected import a_path, kind_of, one_of
from mbsvib.common.selection import Names
from mbsvib.errors import AccuracyWarning, ExportError
from mbsvib.feedback.closing import transfer
from mbsvib.feedback.controller import Controller
from mbsvib.responses.from_control import of_control, sample_time
from mbsvib.responses.state_space import StateSpace
from mbsvib.version import __version__
from mbsvib_export.fmu_.names import identifier, printable
from mbsvib_export.neutral import Source, SystemData, discrete_space_of, state_space_of
from mbsvib_export.responses import check_points, response_error
from mbsvib_export.sampling import discretised, doubt_step
from mbsvib_export.templates_ import check_companion, filled

# Samples in the test vectors: enough to see each state several times, few enough to read.
SAMPLES = 64
# Error of a frequency response by coefficients of 32 bits that is warned of, and share of its size by which the largest
# eigenvalue of a stable step is below 1, beyond all rounding of 64 bits.
SINGLE, DECAYING = 1e-2, 1e-12
_WORD = re.compile(r"\w+", re.ASCII)
_METHODS = {
    "zoh": "exact for inputs that are held over each step",
    "foh": "exact for inputs that are linear over each step",
    "tustin": "Tustin's rule",
    "given": "as given in discrete time",
}
WIDTH, INDENT = 100, "    "


@dataclass(frozen=True, slots=True, repr=False)
class CFiles(Displayed):
    """The files of an export to C: ``header``, ``source``, and the program ``test`` with test vectors."""

    header: Path
    source: Path
    test: Path


def to_c(
    system: Source, folder: str | os.PathLike[str],
    step: float | None = None, *, realization: str = "modal", method: str | None = None, precision: str = "double",
    name: str | None = None, outputs: Names = None, inputs: Names = None,
) -> CFiles:  # fmt: skip
    """Write a discrete-time state space as C source that depends on nothing: NAME.h, NAME.c and NAME_test.c.

    x(k+1) = A x(k) + B u(k),  y(k) = C x(k) + D u(k),  samples ``step`` apart

    ``NAME_reset`` sets the states to zero; ``NAME_step`` computes the outputs of a sample and goes on to the next;
    ``NAME_outputs`` and ``NAME_update`` do both apart, where outputs must be out early. States are a struct of the
    caller; no memory is allocated, nothing is read or written elsewhere, and each call takes the same number of
    operations, of which those with zeros of the matrices are left out. Inputs and outputs have named indices. The test
    program ends with 0 where the compiled code gives the outputs of its test vectors, which come from Python.

    Parameters
    ----------
    system : System, ClosedLoop, StateSpace, control.StateSpace, SystemData or Controller
        The equations of motion, a closed loop, a state space that is ready, or a controller. One of python-control in
        discrete time is written as it is.
    folder : str or path
        Where the files go; it is made if its parent exists.
    step : float, optional
        Time between samples [s]; default: that of a discrete system, which has no other one, else 1e-4.
    realization : str
        The states of a System: "modal" (few operations, most digits), "balanced" or "physical".
    method : str, optional
        "zoh": exact for inputs that are held over each step; "foh": exact for inputs that are linear over each step;
        "tustin". Default: "tustin" for a Controller, as ``loop.sampled`` has it, "zoh" for all others.
    precision : str
        "double", or "single" for processors that compute with 32 bits; the response of the rounded coefficients is
        compared with the exact one.
    name : str, optional
        Prefix of functions and files; default: the name of the system, as far as C allows it.
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    CFiles
        The paths of header, source and test program.

    Raises
    ------
    ExportError
        If the system has no inputs or no outputs, grows beyond numbers in the test vectors, or a value is refused; if
        its coefficients of 32 bits grow though it is stable; if a file of one of these names was not written by this
        export.
    ResponseError
        If the realization, or the name of an output or input, is unknown.

    Warns
    -----
    AccuracyWarning
        If coefficients of 32 bits change the frequency response by more than 1 %, or the step is many periods of all
        poles.
    """
    a_path(folder, "folder", ExportError)
    ready = kind_of(system) == "state space" or isinstance(system, SystemData)
    period = sample_time(system) if of_control(system) else None
    space = state_space_of(system, "physical" if ready and realization == "modal" else realization, "to_c", outputs,
                           inputs) if period is None else discrete_space_of(system, outputs, inputs)  # fmt: skip
    one_of(precision, ("double", "single"), "to_c", "precision", ExportError)
    if not space.inputs or not space.outputs:
        missing = "inputs (model.add_input)" if not space.inputs else "outputs (model.add_output)"
        raise ExportError(f"to_c: '{space.name}' has no {missing}; its code would compute nothing.")
    prefix = identifier(space.name) if name is None else name
    if not isinstance(prefix, str) or not _WORD.fullmatch(prefix) or prefix[0].isdigit():
        raise ExportError(f"to_c: name = {name!r}; expected letters, digits and _ of ASCII, no digit first.")
    if period is None:
        method = ("tustin" if isinstance(system, Controller) else "zoh") if method is None else method
        step = 1e-4 if step is None else step
        matrices = discretised(space, step, method, "to_c")
        doubt_step(space, step, "to_c")
    elif method is None and step in (None, period):
        method, step, matrices = "given", period, (space.A, space.B, space.C, space.D)
    else:
        raise ExportError(f"to_c: step = {step!r}, method = {method!r}; '{space.name}' is discrete, dt = {period:g} s, "
                          f"and written as it is; expected neither of them.")  # fmt: skip
    if precision == "single":
        matrices = _rounded(space, step, matrices)
    mark = f"Written by mbsvib for '{_ascii(space.name)}'"
    words = {"prefix": prefix, "upper": prefix.upper(), "banner": _banner(mark, space, step, method, precision),
             **_words(prefix.upper(), space, float(step), matrices, precision)}  # fmt: skip
    target = _folder(folder)
    texts = {target / f"{prefix}{end}": filled(f"system{end}", **words) for end in (".h", ".c", "_test.c")}
    for path in texts:
        check_companion(path, lambda file: mark in file.read_text("utf-8", "replace")[:400],
                        f"one that to_c has written for '{space.name}'", "Give another folder or another name.")
    return CFiles(*[write_atomic(path, partial(_write, text)) for path, text in texts.items()])


def _write(text: str, stream: IO[bytes]) -> None:
    stream.write(text.encode("ascii"))


def _folder(folder: str | os.PathLike[str]) -> Path:
    target = Path(folder)
    try:
        target.mkdir(exist_ok=True)
    except OSError as error:
        raise ExportError(f"to_c: folder = {str(target)!r}: {error.strerror or error}. Give a folder that exists, or "
                          f"a new one in a folder that exists.") from error  # fmt: skip
    return target


def _rounded(space: StateSpace, step: float, matrices: Any) -> Any:
    """The matrices as a processor of 32 bits has them, compared with those before."""
    with np.errstate(over="ignore", under="ignore"):
        single = tuple([matrix.astype(np.float32).astype(float) for matrix in matrices])
    if not all(np.isfinite(matrix).all() for matrix in single):
        raise ExportError("to_c: a coefficient is too large for precision = 'single'; take realization='balanced', "
                          "other units, or 'double'.")  # fmt: skip
    advice = "Take a longer step, other states (realization), or precision='double'."
    turns, rounded = (np.linalg.eigvals(each[0]) for each in (matrices, single))
    before, after = (np.abs(values).max(initial=0.0) for values in (turns, rounded))
    if before < 1.0 - DECAYING and after > 1.0:
        raise ExportError(f"to_c: precision = 'single': '{space.name}' is stable, and its coefficients of 32 bits "
                          f"grow, by {after - 1.0:.1g} in each step of {step:g} s. {advice}")  # fmt: skip
    omega = check_points(np.log(turns[turns != 0.0].astype(complex)) / step)
    omega = omega[omega * step < np.pi]
    z = np.exp(1j * omega * step)
    actual, truth = (np.moveaxis(transfer(each, z), 0, -1) for each in (single, matrices))
    error = response_error(actual, truth, space, omega) if len(omega) else 0.0
    if error > SINGLE:
        warnings.warn(f"to_c: precision = 'single': coefficients of 32 bits change the frequency response of "
                      f"'{space.name}' by up to {error:.1g} of its size. {advice}", AccuracyWarning, stacklevel=3)
    return single


def _test_vectors(name: str, matrices: Any, precision: str) -> tuple[Any, Any, Any]:
    """Inputs (samples, i), outputs (samples, o), and the error allowed for each output (o,).

    The rounding of each step goes on through the later ones by C A^j; it is bounded by the magnitudes of all products.
    """
    a, b, c, d = (matrix.astype(np.longdouble) for matrix in matrices)
    inputs = np.random.default_rng(1).integers(-8, 9, (SAMPLES, b.shape[1])) / 8.0  # exact in both precisions
    kind = np.finfo(np.float64 if precision == "double" else np.float32)
    x, unit = np.zeros(len(a), dtype=np.longdouble), (len(a) + b.shape[1] + 1) * float(kind.eps)
    outputs, allowed = np.empty((SAMPLES, len(c))), np.zeros(len(c))
    through, rounding = np.empty((SAMPLES, *c.shape)), np.empty((SAMPLES, len(a)))
    with np.errstate(over="ignore", invalid="ignore"):
        power = c
        for k, u in enumerate(inputs):
            outputs[k] = c @ x + d @ u
            through[k], power = np.abs(power), power @ a
            now = unit * (np.abs(c) @ np.abs(x) + np.abs(d) @ np.abs(u)).astype(float)
            allowed = np.maximum(allowed, now + np.einsum("jon,jn->o", through[:k], rounding[:k][::-1]))
            rounding[k] = unit * (np.abs(a) @ np.abs(x) + np.abs(b) @ np.abs(u))
            x = a @ x + b @ u
    if not ((np.abs(outputs) <= kind.max).all() and (allowed <= kind.max).all()):
        raise ExportError(f"to_c: '{name}' grows beyond all numbers within {SAMPLES} steps: it is unstable.")
    return inputs, outputs, allowed


def _banner(mark: str, space: StateSpace, step: float, method: str, precision: str) -> str:
    """The comment at the head of a file, without its end."""
    return (f"/* {mark}, version {__version__}.\n"
            f" * x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k)\n"
            f" * step {step:g} s, {_METHODS[method]}; {len(space.states)} states ({space.realization}), {precision} "
            f"precision. SI units and radians.")  # fmt: skip


def _words(upper: str, space: StateSpace, step: float, matrices: Any, precision: str) -> dict[str, object]:
    """What the templates leave open: sizes, indices, and the numbers of the matrices and of the test vectors."""
    real = "double" if precision == "double" else "float"

    def number(value: float) -> str:
        """A literal of that type, with all digits."""
        text = repr(float(value)) if real == "double" else str(np.float32(value))
        return text if real == "double" else f"{text if any(mark in text for mark in '.en') else text + '.0'}f"

    a, b, c, d = matrices
    inputs, expected, tolerance = _test_vectors(space.name, matrices, precision)
    constant = f"static const {real}"
    return {
        "real": real, "zero": number(0.0), "step": number(step), "states": len(space.states),
        "inputs": len(space.inputs), "outputs": len(space.outputs), "samples": SAMPLES,
        "indices": "\n".join((*_indices(f"{upper}_IN", space.inputs, space.input_units),
                              *_indices(f"{upper}_OUT", space.outputs, space.output_units))),
        "arrays": "\n".join((*_sparse("next", np.hstack((a, b)), real, number),
                             *_sparse("output", np.hstack((c, d)), real, number))),
        "test_inputs": _table(f"{constant} inputs[SAMPLES][{upper}_INPUTS]", inputs, number),
        "expected": _table(f"{constant} expected[SAMPLES][{upper}_OUTPUTS]", expected, number),
        "tolerance": _values(f"{constant} tolerance[{upper}_OUTPUTS]", [number(value) for value in tolerance]),
    }  # fmt: skip


def _ascii(text: str) -> str:
    """A text as a C comment can hold it."""
    plain = printable(text).encode("ascii", "backslashreplace").decode()
    return plain.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").replace("\\", "/")


def _indices(prefix: str, names: Sequence[str], units: Sequence[str]) -> Iterator[str]:
    """Named indices; names that become one word in C get their number, as often as makes them differ from all words."""
    words = [re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_").upper() for name in names]
    for i, (name, unit, word) in enumerate(zip(names, units, words, strict=True)):
        unique = word if words.count(word) == 1 else ""
        while not unique or (unique != word and unique in words):
            unique = f"{unique or word}_{i}".lstrip("_")
        yield f"#define {prefix}_{unique} {i} /* {_ascii(name)}{f' [{_ascii(unit)}]' if unit else ''} */"


def _sparse(name: str, matrix: Array, real: str, number: Callable[[float], str]) -> Iterator[str]:
    """The arrays of a matrix over states and inputs; C has no empty ones."""
    at, column = np.nonzero(matrix)
    start = np.searchsorted(at, np.arange(len(matrix) + 1))
    values = [number(value) for value in matrix[at, column]] or [number(0.0)]
    yield _values(f"static const {real} {name}_value[{len(values)}]", values)
    yield _values(f"static const int {name}_column[{len(values)}]", [str(k) for k in column] or ["0"])
    yield _values(f"static const int {name}_start[{len(start)}]", [str(k) for k in start])


def _values(declaration: str, values: Sequence[str]) -> str:
    return f"{declaration} = {{\n{_wrapped(', '.join(values))}\n}};"


def _table(declaration: str, rows: Array, number: Callable[[float], str]) -> str:
    lines = [_wrapped("{" + ", ".join([number(value) for value in row]) + "}", INDENT + " ") for row in rows.tolist()]
    return f"{declaration} = {{\n" + ",\n".join(lines) + "\n};"


def _wrapped(text: str, indent: str = INDENT) -> str:
    return fill(text, WIDTH, initial_indent=INDENT, subsequent_indent=indent)
