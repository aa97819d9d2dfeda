"""The exceptions of inercal.

InercalError
 ├── InputError            a file, a study key, an option: what was found and what was expected
 │    ├── RecordError      a recording that cannot be read
 │    ├── MapError         a column map that does not fit its file
 │    ├── StudyError       a study file that does not validate
 │    └── QuantityError    a text that is not a quantity of the expected kind
 ├── UsageError            a command line that is wrong in itself
 ├── MissingExtraError     an optional package is not installed
 ├── RunError              a run of a Monte Carlo that failed (`inercal.foundation.computing.runs`)
 └── CalibrationError      an estimate whose status is not ``ok`` (``raise_for_status``)

Every message is one sentence: where, what was found, what was expected. The command line turns an
`InercalError` into one line on standard error and exit code 2.
"""

from __future__ import annotations

from typing import Any, Protocol

from inercal.foundation.addresses import shown_address, without_secrets


class Judged(Protocol):
    """A result with a verdict: `inercal.foundation.results.result.Estimate`, which stands above this floor."""

    @property
    def status(self) -> Any:
        """The verdict (`inercal.foundation.findings.Status`)."""

    @property
    def message(self) -> str:
        """The verdict in a sentence."""


class InercalError(Exception):
    """Anything inercal raises on purpose."""


class InputError(InercalError):
    """Bad input. ``where`` names the file, line, column, key or option at fault. Secrets of addresses are hidden."""

    def __init__(self, where: object, message: str) -> None:
        self.where = shown_address(str(where))
        self.message = without_secrets(message)
        super().__init__(f"{self.where}: {self.message}")

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str]]:
        """Survive the way back from a worker process."""
        return type(self), (self.where, self.message)


def plain(where: object, text: str) -> str:
    """The text, where a system can take it as a name, an argument or UTF-8.

    Raises `InputError` for a NUL, or half of a surrogate pair.
    """
    odd = next((each for each in text if each == "\0" or "\ud800" <= each <= "\udfff"), None)
    if odd is not None:
        what = "a NUL" if odd == "\0" else f"half of a surrogate pair, {odd!r},"
        raise InputError(where, f"found {what} at character {text.index(odd) + 1}, expected plain text")
    return text


def spelt(text: str) -> str:
    """The text with what `plain` refuses spelt out, to be shown."""
    return text.replace("\0", "\\x00").encode(errors="backslashreplace").decode()


class RecordError(InputError):
    """A recording that cannot be read."""


class MapError(InputError):
    """A column map that is wrong in itself or does not fit its file."""


class StudyError(InputError):
    """A study file that does not validate."""


class QuantityError(InputError):
    """A text that is not a quantity, or one of another dimension."""


class UsageError(InercalError):
    """A command line that is wrong in itself: an unknown command or option, a missing argument."""


class MissingExtraError(InercalError):
    """An optional package is missing; the message holds the ``pip install`` line."""

    def __init__(self, feature: str, extra: str) -> None:
        self.feature, self.extra = feature, extra
        super().__init__(f"{feature} needs the extra '{extra}': pip install 'inercal[{extra}]'")

    def __reduce__(self) -> tuple[type[MissingExtraError], tuple[str, str]]:
        """Survive the way back from a worker process."""
        return type(self), (self.feature, self.extra)


class CalibrationError(InercalError):
    """An estimate that ended with a bad verdict; ``estimate`` holds it in full."""

    def __init__(self, message: str, estimate: Judged) -> None:
        self.estimate = estimate
        super().__init__(message)
