"""The pages of the reference that are made of the program itself: commands, and words of model files.

python docs/reference_pages.py writes them; tests hold them to the program.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from mbsvib.cli._app import DESCRIPTION
from mbsvib.cli._arguments import ALIGN
from mbsvib.cli._commands import HOMES, OPTIONS, command_of
from mbsvib.cli._lookup import ROBOTS
from mbsvib.files import schema

FOLDER = Path(__file__).parent / "pages" / "reference"
COMMANDS_START = f"""\
# Commands

{DESCRIPTION}
`mbsvib COMMAND --help` says the same as this page. MODEL is a model file (`.yaml`, `.json`, `.xml` of MuJoCo, `.urdf`)
or a name that `mbsvib models` lists.

Exit status: 0; 1 if a model is faulty or a check fails; 2 if the command line is wrong. Messages go to standard error,
so that `--json` leaves nothing but JSON on standard output.
"""
ROBOTS_START = """\
## Options of URDF and MJCF files

Commands that take a MODEL take these options too, as in
`mbsvib modes arm.urdf --stiffness 1e4 --stiffness lift=2e4 --pose lift=0.6`. They are arguments of
[`load_urdf` and `load_mjcf`](models.md). An option that a file does not take is refused.
"""
FILES_START = """\
# Model files

A model as YAML or JSON, read by `mv.load` and written by `mv.save`. The words are those of the Python calls: a section
for each kind of part, in it the parts by name. SI units and radians, positions and directions in world coordinates.
`mbsvib schema` prints the JSON schema, by which editors complete and check a file.

```yaml
name: slider
bodies:
  mass: {mass: 2.0, inertia: [0.01, 0.01, 0.01]}
joints:
  rail: {kind: prismatic, first: ground, second: mass, axis: [1, 0, 0]}
springs:
  k: {first: ground, second: mass, start: [-1, 0, 0], end: [0, 0, 0], stiffness: 5000, damping: 10}
inputs:
  F: {body: mass, direction: x}
outputs:
  x: {body: mass, direction: x}
```
"""


def commands_page() -> str:
    """Return the page of commands."""
    parts = [COMMANDS_START]
    for name in HOMES:
        command = command_of(name)
        places = [one for one in command.arguments if not one.optional]
        words = [f"[{one.settings['metavar']}]" if one.settings.get("nargs") == "?" else one.settings["metavar"]
                 for one in places]  # fmt: skip
        rows = [(one.settings["metavar"] if not one.optional else _option(one), one.settings["help"])
                for one in command.arguments]  # fmt: skip
        usage = " ".join(["mbsvib", name, *words])
        parts += [f"## {name}\n\n`{usage}`\n\n{command.summary}\n", _table("Argument", rows)]
    parts += ["## Option of all commands that take a MODEL\n",
              _table("Option", [(_option(ALIGN), ALIGN.settings["help"])])]
    rows = [(_option(one), one.settings["help"]) for one in ROBOTS]
    parts += [ROBOTS_START, _table("Option", rows)]
    parts += ["## Options of all commands\n", _table("Option", list(OPTIONS.items()))]
    return "\n".join(parts)


def _option(argument) -> str:
    names = argument.settings.get("metavar", ())
    words = [names] if isinstance(names, str) else list(names)
    return " ".join([", ".join(argument.names), *(words if argument.takes_value else [])])


def files_page() -> str:
    """Return the page of the words in model files."""
    document = schema()
    parts = [FILES_START, "## Document\n"]
    top = [(name, part.get("description", "")) for name, part in document["properties"].items()]
    parts.append(_table("Key", top))
    for section, part in document["properties"].items():
        names = list(dict.fromkeys(re.findall(r'#/\$defs/(\w+)"', json.dumps(part.get("additionalProperties", {})))))
        for name in names:
            definition = document["$defs"][name]
            heading = section if len(names) == 1 else f"{section}: {name}"
            parts += [f"## {heading}\n\n{definition.get('description', '')}\n", _fields(definition)]
    return "\n".join(parts)


def _fields(definition: dict) -> str:
    needed = set(definition.get("required", ()))
    rows = []
    for name, field in definition["properties"].items():
        words = field.get("description", "")
        if name in needed:
            words += " Required."
        elif field.get("default") is not None:
            words += f" Default: {json.dumps(field['default'])}."
        rows.append((name, words.strip()))
    return _table("Key", rows)


def _table(head: str, rows: list[tuple[str, str]]) -> str:
    lines = [f"| {head} | Meaning |", "|---|---|"]
    lines += [f"| `{name}` | {words.replace('|', chr(92) + '|')} |" for name, words in rows]
    return "\n".join(lines) + "\n"


PAGES = {"commands.md": commands_page, "files.md": files_page}

if __name__ == "__main__":
    for page, make in PAGES.items():
        (FOLDER / page).write_text(make(), encoding="utf-8")
