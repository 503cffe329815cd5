"""A shell at a terminal, into which a line is typed, and whose tab key is pressed."""

import os
import pty
import re
import select
import subprocess

PROMPT = "ready> "
# The key Ctrl-X shows the line as edited, between brackets that nothing else prints.
SHELLS = {
    "bash": (["bash", "--norc", "--noprofile", "-i"],
             "source {script}; bind 'set enable-bracketed-paste off'; "
             "bind -x '\"\\C-x\": echo \"<<$READLINE_LINE>>\"'"),
    "zsh": (["zsh", "-f", "-i"],
            "fpath+=({folder}); autoload -Uz compinit; compinit -u -D; unset zle_bracketed_paste; "
            "shown() {{ print -r \"<<$BUFFER>>\" }}; zle -N shown; bindkey '^X' shown"),
}  # fmt: skip
PATIENCE = 60.0  # s without a letter, after which the shell is taken as dead


def completed(shell, script, typed, folder):
    """A line after tab, typed in a shell that reads the script, in a folder."""
    words, setting = SHELLS[shell]
    master, slave = pty.openpty()
    environment = dict(os.environ, PS1=PROMPT, TERM="dumb")
    process = subprocess.Popen(words, stdin=slave, stdout=slave, stderr=slave, cwd=folder, env=environment,
                               start_new_session=True)  # fmt: skip
    os.close(slave)
    try:
        _until(master, PROMPT)
        # the quotes keep the echo of this line apart from what it prints
        os.write(master, f"{setting.format(script=script, folder=script.parent)}; echo se''t\n".encode())
        _until(master, f"set\r*\n(.|\n)*{PROMPT}")
        os.write(master, f"{typed}\t\x18".encode())
        return re.search("<<(.*)>>", _until(master, "<<.*>>"))[1]
    finally:
        process.kill()
        process.wait()
        os.close(master)


def _until(master, pattern):
    text = ""
    while not re.search(pattern, text):
        if not select.select([master], [], [], PATIENCE)[0]:
            raise TimeoutError(f"the shell printed {text!r}, and then nothing")
        text += os.read(master, 4096).decode(errors="replace")
    return text
