"""Completion of words in the shell: scripts for bash, zsh and fish, and the words that may come next."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import ALIGN, Argument, ModelFile, Named
from mbsvib.cli._commands import HOMES, OPTIONS, command_of
from mbsvib.cli._lookup import READERS, ROBOTS, SUFFIXES, model_of
from mbsvib.errors import MbsvibError, nearest

if TYPE_CHECKING:
    from mbsvib.api.model import Model

# Each asks "mbsvib --complete WORDS", the last of which is being typed. Bash, which splits at = and :, sends its line.
SCRIPTS = {
    "bash": """\
_mbsvib() {
    local word
    COMPREPLY=()
    while IFS= read -r word; do
        [[ -n $word ]] && COMPREPLY+=("$word")
    done < <(mbsvib --complete-line "${COMP_LINE:0:COMP_POINT}" "$COMP_WORDBREAKS" 2>/dev/null)
    [[ ${#COMPREPLY[@]} -eq 1 && ${COMPREPLY[0]} == *= ]] && compopt -o nospace
}
complete -o filenames -F _mbsvib mbsvib
""",
    "zsh": """\
#compdef mbsvib
_mbsvib() {
    local -a candidates
    [[ $PREFIX == \\~* ]] && _files && return
    candidates=(${(f)"$(mbsvib --complete "${(@Q)words[2,CURRENT-1]}" "${(Q)PREFIX}" 2>/dev/null)"})
    compadd -- ${candidates:#*[/=]}
    compadd -S '' -- ${(M)candidates:#*[/=]}
}
if [[ $funcstack[1] == _mbsvib ]]; then  # zsh looks for this file when the first word is completed
    _mbsvib "$@"
else
    compdef _mbsvib mbsvib
fi
""",
    "fish": """\
function __mbsvib
    set -l typed (commandline -ct | string replace -r '^["\\']' '' | string unescape)
    mbsvib --complete (commandline -opc)[2..-1] "$typed"
end
complete -c mbsvib -f -a '(__mbsvib)'
""",
}
NEXT = {
    "bash": "It works in new shells where the package bash-completion is installed; elsewhere add to ~/.bashrc:\n"
            "  source '{path}'",
    "zsh": "Add to ~/.zshrc, before a line with compinit if there is one:\n"
           "  fpath+=('{folder}'); autoload -Uz compinit; compinit",
    "fish": "It works in new shells.",
}  # fmt: skip


def show(name: str | None = None) -> None:
    """Print the script of a shell."""
    shell.say(SCRIPTS[_shell_name(name)].rstrip())


def install(name: str | None = None) -> None:
    """Write the script of a shell to where it looks for it."""
    known = _shell_name(name)
    path = _cache_file(known)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(SCRIPTS[known], encoding="utf-8")
    shell.say(f"Written: {path}\n{NEXT[known].format(path=path, folder=path.parent)}")


def line_candidates(line: str, breaks: str) -> list[str]:
    """Return what bash puts in place of the end of a line from the last of its ``breaks`` between words."""
    for quote in ("", "'", '"'):  # one may still be open; the letter is what is being typed, where nothing is yet
        try:
            words = shlex.split(f"{line}x{quote}")
        except ValueError:
            continue
        typed = words[-1][:-1]
        cut = 0 if quote else 1 + max([typed.rfind(letter) for letter in "=:" if letter in breaks], default=-1)
        return [word[cut:] for word in candidates([*words[1:-1], typed])]
    return []


def candidates(words: list[str]) -> list[str]:
    """Return what the last of the ``words`` after the program's name may become; it is incomplete, or empty."""
    typed = words[-1] if words else ""
    before = [word for word in words[:-1] if word != shell.DEBUG]
    if not before:
        return _fitting([*HOMES, *(names.split()[0].rstrip(",") for names in OPTIONS)], typed)
    if before[0] in ("--install-completion", "--show-completion"):
        return _fitting(list(SCRIPTS), typed)
    try:
        command = command_of(before[0])
    except MbsvibError:
        return []
    arguments = command.arguments
    if command.models and any(word.lower().endswith(tuple(READERS)) for word in before):
        arguments += ROBOTS
    if command.models:
        arguments += (ALIGN,)
    by_name = {name: argument for argument in arguments for name in argument.names}
    awaited = by_name.get(before[-1])
    if awaited is not None and awaited.takes_value:
        return _values(awaited, before, typed, by_name)
    option, equals, value = typed.partition("=")
    if equals and option in by_name:
        return [f"{option}={one}" for one in _values(by_name[option], before, value, by_name)]
    if typed.startswith("-"):
        return _fitting([name for name in by_name if name.startswith("-")] + ["--help"], typed)
    positional = [argument for argument in arguments if not argument.optional]
    number = len(_positional_words(before, by_name))
    if number >= len(positional) and not (positional and positional[-1].settings.get("nargs") == "+"):
        return []
    return _values(positional[min(number, len(positional) - 1)], before, typed, by_name)


def _values(argument: Argument, before: list[str], typed: str, by_name: dict[str, Argument]) -> list[str]:
    if "choices" in argument.settings:
        return _fitting([str(choice) for choice in argument.settings["choices"]], typed)
    if isinstance(argument.completes, tuple):
        return _fitting(list(argument.completes), typed)
    if argument.completes == "file":
        return _files(typed, ())
    if argument.completes == "model":
        from mbsvib import library

        return _fitting(list(library.models()), typed) + _files(typed, SUFFIXES)
    positional = _positional_words(before, by_name)
    if not argument.completes or not positional:
        return []
    try:
        return _fitting(_names(model_of(ModelFile(positional[0])), argument.completes), typed)
    except (MbsvibError, OSError):  # a faulty model has no names; its commands say why
        return []


def _names(model: Model, kind: Named) -> list[str]:
    if kind == "parameter":
        return list(model.parameters)
    if kind == "coordinate":
        return [f"{joint.name}.{direction}" for joint in model.joints.values() for direction, _ in joint.freedom]
    if kind == "joint":
        return [f"{name}=" for name in model.joints]
    if kind == "spring":
        return list(model.springs)
    if kind == "body":
        return [*model.bodies, "ground"]
    system = model.linearize()
    return list(system.inputs if kind == "input" else system.outputs)


def _positional_words(before: list[str], by_name: dict[str, Argument]) -> list[str]:
    """Return the words after the command that are neither options nor their values."""
    result, skip = [], False
    for word in before[1:]:
        if skip:
            skip = False
        elif word.startswith("-"):
            option = by_name.get(word)
            skip = option is not None and option.takes_value
        else:
            result.append(word)
    return result


def _files(typed: str, suffixes: tuple[str, ...]) -> list[str]:
    """Return folders and files that begin as typed, where ~ may be the home."""
    head, _, tail = typed.rpartition("/")
    folder = Path(head + "/").expanduser() if "/" in typed else Path()
    try:
        entries = sorted(folder.iterdir())
    except (OSError, RuntimeError):  # RuntimeError: the home of a user that is not known
        return []
    lead = head + "/" if "/" in typed else ""
    return [f"{lead}{entry.name}{'/' if entry.is_dir() else ''}" for entry in entries
            if entry.name.startswith(tail) and (tail.startswith(".") or not entry.name.startswith("."))
            and (entry.is_dir() or not suffixes or entry.suffix.lower() in suffixes)]  # fmt: skip


def _fitting(words: list[str], typed: str) -> list[str]:
    return [word for word in words if word.startswith(typed)]


def _shell_name(name: str | None) -> str:
    known = name if name is not None else Path(os.environ.get("SHELL", "")).name
    if known not in SCRIPTS:
        reason = f"no completion for '{known}'.{nearest(known, SCRIPTS)}" if known else "which shell is not known."
        raise shell.UsageProblem(f"{reason} Give one of {', '.join(SCRIPTS)}, as in: mbsvib --install-completion bash.")
    return known


def _cache_file(name: str) -> Path:
    data = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")
    settings = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return {"bash": data / "bash-completion" / "completions" / "mbsvib",
            "zsh": data / "zsh" / "site-functions" / "_mbsvib",
            "fish": settings / "fish" / "completions" / "mbsvib.fish"}[name]  # fmt: skip
