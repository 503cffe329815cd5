"""HTML of models, systems and tables for notebooks, escaped, without scripts."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO

from matplotlib.figure import Figure

from mbsvib.common.tables import html
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.plots._curves import System
from mbsvib.plots.mechanism import mechanism

MOST_BODIES = 200  # in a picture
MOST_NAMES = 12


def of_model(model: Mechanism) -> str:
    """Return a picture of a model and a list of its parts."""
    groups = [("bodies", model.bodies), ("joints", model.joints), ("springs", model.springs),
              ("inputs", model.inputs), ("outputs", model.outputs)]  # fmt: skip
    rows = [(label, len(group), _few([*group])) for label, group in groups if group]
    text = html(model.name, (("", "left"), ("count", "right"), ("names", "left")), rows)
    return _with_picture(model, len(model.bodies), text)


def of_system(system: System) -> str:
    """Return a picture of a system, its coordinates, inputs and outputs."""
    groups = [("coordinates", _named(system.coordinates, system.coordinate_units)),
              ("inputs", _named(system.inputs, system.input_units)),
              ("outputs", _named(system.outputs, system.output_units)), ("cut joints", list(system.cut_joints)),
              ("redundant constraints", list(system.redundant))]  # fmt: skip
    rows = [(label, len(names), _few(names)) for label, names in groups if names]
    text = html(f"{system.name}: {system.dof} DOF", (("", "left"), ("count", "right"), ("names", "left")), rows)
    return _with_picture(system, len(system.bodies), text)


def _named(names: Sequence[str], units: Sequence[str]) -> list[str]:
    return [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST_NAMES]) + (", …" if len(names) > MOST_NAMES else "")


def _with_picture(source: Mechanism | System, bodies: int, text: str) -> str:
    if not 0 < bodies <= MOST_BODIES:
        return text
    picture = image(mechanism(source))
    return f'<div style="display:flex;flex-wrap:wrap;gap:16px;align-items:center">{picture}{text}</div>'


def image(figure: Figure) -> str:
    """Return a figure as an image inside of HTML."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=80)
    return f'<img alt="The mechanism" src="data:image/png;base64,{b64encode(stream.getvalue()).decode("ascii")}">'
