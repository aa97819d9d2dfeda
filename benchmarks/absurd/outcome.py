"""One run, and what became of it."""

from dataclasses import dataclass, field

from absurd import laws
from absurd.draws import Draws
from inercal.foundation.errors import InercalError


@dataclass
class Run:
    """A run: ``study`` as drawn, what was done besides in ``words``, its ``outcome`` (a status, or where it was
    refused), and the laws that it broke in ``wrong``."""

    study: dict
    words: list = field(default_factory=list)
    outcome: str = ""
    wrong: list = field(default_factory=list)


def made(study, run, rng):
    """A run by one stream of random numbers: ``run(done, draws)`` on a ``study(draws)``; it may be refused."""
    draws = Draws(rng)
    done = Run(study(draws))
    try:
        run(done, draws)
    except InercalError as error:
        done.outcome = done.outcome or "recording refused"
        done.wrong += laws.of_refusal(error)
    return done
