"""``inercal completion``."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from inercal.cli.options import FileOutput
from inercal.cli.outcome import emit

Shell = Literal["bash", "zsh", "fish"]

_FILES = 'COMPREPLY=( $(compgen -f -- "${cur}") )'
"""Completion of file names in the script for bash: without slashes after folders, and broken at blanks."""


_ZSH = """
if [[ "$funcstack[1]" == "_inercal" ]]; then
  _inercal "$@"
else
  compdef _inercal inercal
fi"""
"""End of the script for zsh: it may be loaded from a folder of ``$fpath``, or sourced."""


def completion(
    shell: Annotated[Shell, Parameter(help="The shell to complete in.")],
    /,
    *,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Print the script by which a shell completes commands."""
    from inercal._files import write_text
    from inercal.estimate.result import without_coefficients

    output.check(())
    text = script(shell)
    if output.out is not None:
        write_text(output.out, text)
        output.say(f"completion: {output.out}")
    shown = text.rstrip("\n") if output.out is None else ""
    emit(
        without_coefficients("completion", f"completion for {shell}", {"shell": shell, "text": text}),
        shown,
        output,
    )


def script(shell: Shell) -> str:
    """The script of the whole tree of commands; it runs by itself, so that completing starts no Python."""
    from inercal.cli.tree import app

    text = app().generate_completion(shell=shell, prog_name="inercal")
    if shell == "bash":  # readline itself knows folders, blanks and ~: it is asked where nothing else fits
        text = text.replace(_FILES, "COMPREPLY=()")
        text = text.replace("complete -F _inercal inercal", "complete -o default -F _inercal inercal")
    if shell == "zsh":
        text = text.replace("_cyclopts_inercal", "_inercal").rstrip("\n") + _ZSH
    return text.rstrip("\n") + "\n"
