"""What became of one run."""

from dataclasses import dataclass, field


@dataclass
class Run:
    """A run: ``study`` as drawn, what was done besides in ``words``, its ``outcome`` (a status, or where it was
    refused), and the laws that it broke in ``wrong``."""

    study: dict
    words: list = field(default_factory=list)
    outcome: str = ""
    wrong: list = field(default_factory=list)
