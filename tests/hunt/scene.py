"""A scene as data: the calls that build a model, so that it can be stated in other ways, made smaller and printed."""

import json
import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mbsvib as mv

SECTIONS = {
    "bodies": "body", "beams": "beam", "superelements": "superelement", "joints": "joint", "springs": "spring",
    "couplers": "coupler", "rotors": "rotor", "loads": "load", "inputs": "input", "outputs": "output",
}  # fmt: skip
# arguments whose value is the name of a body, joint or element
REFERENCES = ("first", "second", "a", "b", "body", "relative_to", "element", "worm", "wheel", "pinion", "rack")


@dataclass(frozen=True, eq=False)
class Call:
    """One call ``model.add_KIND(NAME, **arguments)``."""

    kind: str
    name: str
    arguments: dict[str, Any] = field(default_factory=dict)

    def but(self, **changes):
        """The same call with other arguments; None takes one away."""
        arguments = {**self.arguments, **changes}
        return replace(self, arguments={k: v for k, v in arguments.items() if v is not None or k not in changes})

    @property
    def references(self):
        """Names of the elements that it refers to, without what follows a dot."""
        names = [self.arguments[word] for word in REFERENCES if self.arguments.get(word) is not None]
        names += list(self.arguments.get("coefficients", ())) + list(self.arguments.get("bodies", {}).values())
        return {name.partition(".")[0] for name in names} - {"ground"}


@dataclass(frozen=True, eq=False)
class Scene:
    """A mechanism as calls, the seed that it was made from, and the features that it has."""

    seed: int
    calls: tuple[Any, ...]
    gravity: tuple[Any, ...] | None = None
    features: frozenset[str] = frozenset()

    def of(self, *kinds):
        """The calls of some kinds, in order."""
        return [call for call in self.calls if call.kind in kinds]

    def names(self, *kinds):
        return [call.name for call in self.of(*kinds)]

    @property
    def inputs(self):
        return self.names("input", "base_motion")

    @property
    def outputs(self):
        return self.names("output", "force_output", "strain_output")

    @property
    def loaded(self):
        """Whether anything loads the mechanism in its pose."""
        return bool(self.gravity is not None or self.of("load") or any(
            "preload" in call.arguments or "free_length" in call.arguments for call in self.calls))  # fmt: skip

    def model(self):
        """The model that the calls build."""
        result = mv.Model(f"hunt{self.seed}", gravity=self.gravity)
        for call in self.calls:
            getattr(result, f"add_{call.kind}")(call.name, **call.arguments)
        return result

    def with_calls(self, calls):
        return replace(self, calls=tuple(calls))

    def text(self):
        """The scene as a model file in YAML."""
        with tempfile.TemporaryDirectory() as folder:
            return Path(mv.save(self.model(), Path(folder) / "scene.yaml")).read_text(encoding="utf-8")


def read_back(model, like):
    """A scene from a model, such as one in a pose of equilibrium; seed and features are those of another scene."""
    with tempfile.TemporaryDirectory() as folder:
        data = json.loads(Path(mv.save(model, Path(folder) / "scene.json")).read_text(encoding="utf-8"))
    calls = []
    for section, kind in SECTIONS.items():
        for name, arguments in data.get(section, {}).items():
            calls.append(Call(arguments.pop("type", kind), name, arguments))
            if calls[-1].kind == "force_output":
                arguments.setdefault("direction", "z")
    gravity = data.get("gravity")
    return replace(like, calls=tuple(calls), gravity=None if gravity is None else tuple(gravity))
