"""Models, systems, inputs, outputs and ranges of values from arguments, and options for URDF and MJCF files.

Each option is an argument of the same name of the files' readers, ``load_urdf`` and ``load_mjcf``.
"""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli._arguments import ModelFile, flag, number, option
from mbsvib.cli._controllers import holds_controller
from mbsvib.cli._shell import UsageProblem, complain
from mbsvib.common.number_text import integer, real
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mbsvib.api.model import Model
    from mbsvib.api.system import System
    from mbsvib.measurement.data import Measurement


# The reader of a file by what it is: module and function, and the format's name.
READERS = {".urdf": ("mbsvib.urdf", "load_urdf", "URDF"), ".xml": ("mbsvib.mjcf", "load_mjcf", "MJCF")}
ALL = "*"  # of a mapping by joint: all that are not named

Pair = tuple[str, float | list[float]]


def _values(text: str) -> float | list[float]:
    values = [number(word) for word in text.split(",")]
    return values if len(values) > 1 else values[0]


def _named(text: str) -> Pair:
    """NAME=VALUES."""
    name, _, values = text.rpartition("=")
    if not name:
        raise ArgumentTypeError(f"expected NAME=VALUE, such as elbow=0.5, and not '{text[:40]}'")
    return name, _values(values)


def _by_joint(text: str) -> Pair:
    """JOINT=VALUES, or VALUES of all joints."""
    try:
        return _named(text) if "=" in text else (ALL, _values(text))
    except ArgumentTypeError:
        raise ArgumentTypeError(f"expected a number, or six with commas between, of all joints or as JOINT=NUMBER, and "
                                f"not '{text[:40]}'") from None  # fmt: skip


def _vector(text: str) -> list[float]:
    values = _values(text)
    if not isinstance(values, list) or len(values) != 3:
        raise ArgumentTypeError(f"expected X,Y,Z without blanks, such as 0,0,-9.81, and not '{text[:40]}'")
    return values


ROBOTS = (
    option("--stiffness", to="stiffness", metavar="[JOINT=]K", action="append", type=_by_joint, completes="joint",
           words="Of all joints, or of one [N m/rad, N/m]: one number, or six, x,y,z,rx,ry,rz with z along the axis. "
                 "May be given several times; a URDF states none."),
    option("--damping", to="damping", metavar="[JOINT=]C", action="append", type=_by_joint, completes="joint",
           words="Likewise [N m s/rad, N s/m]. Default: the file's."),
    option("--pose", to="pose", metavar="JOINT=Q", action="append", type=_named, completes="joint",
           words="Position of a joint [rad, m]; may be given several times. Default: 0 (MJCF: the keyframe's)."),
    option("--gravity", to="gravity", metavar="X,Y,Z", type=_vector,
           words="Gravity [m/s^2], such as 0,0,-9.81; where X is negative, as --gravity=X,Y,Z. Default: none (MJCF: "
                 "the file's)."),
    flag("--floating", "floating", "URDF: the root link moves freely."),
    option("--tip", to="tip", metavar="LINK", action="append",
           words="URDF: a link with forces and displacements as inputs and outputs; may be given several times."),
    option("--loops", to="loops", metavar="FILE", completes="file",
           words="URDF: a YAML file of Extended URDF with closed loops; those in the URDF itself are always read."),
    option("--inertia", to="inertia", metavar="repair", choices=("repair",),
           words="URDF: replace an inertia that no body can have by the nearest possible one."),
    option("--keyframe", to="keyframe", metavar="NAME", words="MJCF: the keyframe with positions and controls."),
    option("--control", to="control", metavar="ACTUATOR=U", action="append", type=_named,
           words="MJCF: control of an actuator; may be given several times."),
    option("--leave", to="leave", metavar="NAME", action="append",
           words="MJCF: actuator, tendon or equality constraint that is left out; may be given several times."),
)  # fmt: skip
NAMES = {argument.settings["dest"]: argument.names[0] for argument in ROBOTS}
MAPPINGS = ("stiffness", "damping", "pose", "control")


def given(values: dict[str, Any]) -> dict[str, Any]:
    """Take the options of this file out of the values of a command line; return those that were given."""
    options = {name: values.pop(name) for name in NAMES}
    return {name: dict(value) if name in MAPPINGS else value for name, value in options.items()
            if value is not None and value is not False}  # fmt: skip


def read(path: str, kind: str, options: Mapping[str, Any]) -> Model:
    """Read a file by its reader in ``READERS`` with the options that it takes; others are refused."""
    reader = _reader(kind)
    refuse_others(path, READERS[kind][2], options, list(signature(reader).parameters))
    return reader(path, **options)


def refuse_others(path: str, kind: str, options: Mapping[str, Any], known: list[str]) -> None:
    """Refuse options that a kind of files does not take; ``known`` are those that it takes."""
    for name in options:
        if name not in known:
            takers = " and ".join(f"{title} ({suffix})" for suffix, (*_, title) in READERS.items()
                                  if name in signature(_reader(suffix)).parameters)  # fmt: skip
            raise UsageProblem(f"{NAMES[name]}: '{path}' is {kind}, which does not take it; it is for files of "
                               f"{takers}.")  # fmt: skip


def _reader(kind: str) -> Callable[..., Model]:
    module, function, _ = READERS[kind]
    reader: Callable[..., Model] = getattr(import_module(module), function)
    return reader


MEASURED = (".uff", ".unv", ".npz")
SUFFIXES = (".yaml", ".yml", ".json", ".xml", ".urdf")


def model_of(source: ModelFile) -> Model:
    """Return the model of a file or of a name in the library.

    ``source``: a path that ends in .yaml, .yml or .json, in .xml (MJCF or URDF) or .urdf, or a built-in name; and
    options of files that state less than a model, and the tolerance within which axes are aligned.
    """
    model = _model_of(source)
    if source.align is None:
        return model
    with as_misuse("linearize"):
        return model.aligned(source.align)


def _model_of(source: ModelFile) -> Model:
    word = source.word
    path = Path(word)
    if path.suffix.lower() in SUFFIXES or path.is_file():
        if not path.is_file():
            candidates = [str(path.parent / file.name) for file in _models_in_folder(path)]
            raise UsageProblem(f"there is no file '{word}'.{nearest(word, candidates)}")
        return _read(path, source.options)
    from mbsvib import library

    refuse_others(word, "a built-in model", source.options, [])
    try:
        return library.build(word)
    except ModelError as error:
        if error.element != word:
            raise
        files = [str(path.parent / file.name) for file in _models_in_folder(path) if file.stem == path.name]
        hint = f" Did you mean '{files[0]}'?" if files else nearest(word, library.models())
        raise UsageProblem(
            f"there is no model '{word}': it is not a file that ends in {', '.join(SUFFIXES)}, nor a built-in name."
            f"{hint} Built in: {', '.join(library.models())}."
        ) from error


def model_or_measurement(source: ModelFile) -> Model | Measurement:
    """Return what was measured if a file ends in .uff, .unv or .npz, else a model."""
    suffix = Path(source.word).suffix.lower()
    if suffix not in MEASURED:
        return model_of(source)
    if not Path(source.word).is_file():
        raise UsageProblem(f"there is no file '{source.word}'.")
    refuse_others(source.word, "measured data", source.options, [])
    if source.align is not None:
        raise UsageProblem(f"--align: '{source.word}' is measured data, which have no axes.")
    if suffix == ".npz":
        from mbsvib.measurement.data import Measurement

        return Measurement.from_npz(source.word)
    from mbsvib_export import from_uff

    return from_uff(source.word)


def _read(path: Path, options: Mapping[str, Any]) -> Model:
    """Read a file by its suffix; the root element of XML determines whether it is MJCF or URDF."""
    suffix = path.suffix.lower()
    if suffix == ".xml":
        from mbsvib.mjcf.kind import root_of

        suffix = ".urdf" if root_of(path) == "robot" else ".xml"
    if suffix in READERS:
        with as_misuse(*_names_in(options)):
            return read(str(path), suffix, options)
    from mbsvib.files import load

    refuse_others(str(path), "a model file", options, [])
    try:
        return load(path)
    except ModelError as error:
        if not holds_controller(path):
            raise
        raise UsageProblem(f"{path} holds a controller or another state space, and no model. Close its loop by "
                           f"'mbsvib loop MODEL {path}', with the model of the mechanism as MODEL.") from error


def _names_in(options: Mapping[str, Any]) -> list[str]:
    """The names of joints, links and others that options contain."""
    values = [value if isinstance(value, (list, dict)) else [value] for value in options.values()]
    return [name for names in values for name in names if isinstance(name, str)]


def system_of(source: ModelFile) -> System:
    """Return the linear system of a model; raises as ``model_of`` does, and if it cannot be linearized.

    A robot whose joints nothing holds is remarked.
    """
    model = model_of(source)
    if source.word.lower().endswith(tuple(READERS)) and model.joints and model.gravity is None and not any(
            any(part.stiffness) if isinstance(part.stiffness, tuple) else part.stiffness
            for part in model.springs.values()):  # fmt: skip
        complain(f"remark: no joint of {source.word} has stiffness; --stiffness gives it, --pose where the joints are.")
    return model.linearize()


@contextmanager
def as_misuse(*words: str) -> Iterator[None]:
    """Turn the refusal of a name that is one of the words of the command line into a UsageProblem."""
    try:
        yield
    except ModelError as error:
        if error.element not in words:
            raise
        raise UsageProblem(str(error)) from error


def ports(system: System, inputs: list[str] | None, outputs: list[str] | None) -> tuple[list[str], list[str], str]:
    """Return the inputs and outputs to draw, and a remark on those that were left out, or an empty one.

    If none are requested, all are drawn if they fit into one figure, and otherwise the first of each.
    """
    from mbsvib.plots._curves import MOST_PANELS, pick

    sources, results = pick(system, "input", inputs or None), pick(system, "output", outputs or None)
    if len(sources) * len(results) <= MOST_PANELS or (inputs and outputs):
        return sources, results, ""
    remark = (f"Drawn: {sources[0]} to {results[0]}. Others by --input and --output; inputs: "
              f"{', '.join(system.inputs)}; outputs: {', '.join(system.outputs)}.")  # fmt: skip
    return sources[:1], results[:1], remark


def range_of(text: str, option: str, example: str, log: bool = False) -> tuple[str, NDArray[np.float64]]:
    """Return the name and the values (COUNT,) of NAME=FROM:TO[:COUNT]; 11 of them by default."""
    import numpy as np

    expected = f"'{text}': expected {option}=FROM:TO or {option}=FROM:TO:COUNT, such as {example}."
    name, _, words = text.partition("=")
    try:
        first, last, *more = words.split(":")
        start, end, count = real(first), real(last), integer(more[0]) if more else 11
    except ValueError:
        raise UsageProblem(expected) from None
    if len(more) > 1 or count < 2 or not name:
        raise UsageProblem(expected)
    if log and min(start, end) <= 0.0:
        raise UsageProblem(f"'{text}': --log needs positive ends; leave --log out, or give others.")
    return name, np.geomspace(start, end, count) if log else np.linspace(start, end, count)


def _models_in_folder(path: Path) -> list[Path]:
    if not path.parent.is_dir():
        return []
    return [file for file in sorted(path.parent.iterdir()) if file.suffix.lower() in SUFFIXES]
