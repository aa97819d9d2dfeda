"""Refusals of a command line in sentences of our own: what was found, what was expected."""

from __future__ import annotations

import difflib
from typing import Any, get_args, get_origin

from cyclopts import (
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownOptionError,
    UnusedCliTokensError,
)
from cyclopts.exceptions import UnknownCommandError

from inercal.foundation.keys import in_place_of
from inercal.foundation.units import shown


def refusal(error: CycloptsError, commands: dict[str, list[str]], usage: str) -> str:
    """One sentence: where, what was found, what was expected.

    ``commands`` are the kinds of each verb; ``usage`` is how the command at fault is called.
    """
    chain = error.command_chain or ()
    command = " ".join(chain)
    match error:
        case MissingArgumentError():
            return _missing(error, command)
        case UnknownCommandError():
            return _unknown_command(str((error.unused_tokens or [""])[0]), command, commands)
        case UnusedCliTokensError():
            extra = ", ".join(map(shown, error.unused_tokens or ()))
            return f"{command}: found {extra} too, expected {usage}"
        case UnknownOptionError():
            return _unknown_option(error, command)
        case RepeatArgumentError():
            return f"{command}: found {error.token.keyword} twice, expected it once"
        case CoercionError() if error.token is not None and error.argument is not None:
            return _wrong_value(error, command)
        case _:
            return str(error)


def _missing(error: MissingArgumentError, command: str) -> str:
    """The missing part: a value after an option, or the argument altogether."""
    argument = error.argument
    if argument is None:
        return str(error)
    words = (argument.parameter.help or "").rstrip(".")
    if error.keyword is not None or argument.tokens:
        return f"{command}: found nothing after {error.keyword or argument.name}, expected a value ({words})"
    return f"{command}: {argument.name} is missing, expected it ({words})"


def _unknown_command(word: str, verb: str, commands: dict[str, list[str]]) -> str:
    """A verb, or the kind after one, that there is not."""
    names = commands[verb] if verb in commands else list(commands)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    expected = f"did you mean {near[0]}?" if near else f"expected {_or(names)}"
    return f"{verb or 'inercal'}: found {shown(word)}, {expected}"


def _unknown_option(error: UnknownOptionError, command: str) -> str:
    """An option that the command does not have."""
    word = (error.token.keyword or error.token.value).partition("=")[0]
    names = [name for each in error.argument_collection if each.parse for name in each.names]
    options = [name for name in names if name.startswith("--")]
    near = difflib.get_close_matches(word, options, n=1, cutoff=0.6)
    expected = f"did you mean {near[0]}?" if near else f"expected {_or(options)}"
    return f"{command}: found the option {word}, {expected}"


def _wrong_value(error: CoercionError, command: str) -> str:
    """A value that an option does not take."""
    assert error.token is not None
    assert error.argument is not None
    option = error.token.keyword or error.argument.name
    found = f"{command}: found {shown(error.token.value)} for {option}"
    if gone := in_place_of(option, error.token.value):
        return f"{found}, {gone}"
    choices = _choices(error.argument.hint)
    flag = error.argument.hint is bool
    expected = f"expected {_or(choices)}" if choices else "expected nothing after it" if flag else str(error)
    return f"{found}, {expected}"


def _choices(hint: Any) -> list[str]:
    """The texts that a hint allows, those of an optional one too."""
    choices = []
    for each in get_args(hint):
        choices += _choices(each) if get_origin(each) is not None else [str(each)] if _is_choice(each) else []
    return choices


def _is_choice(value: object) -> bool:
    """True for a text or a number that is a choice."""
    return isinstance(value, str | int) and not isinstance(value, type)


def _or(words: list[str]) -> str:
    """Words with "or" before the last."""
    return " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))
