"""One temperature of several in a file: that of the sensor, not of the air."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from inercal.foundation.records.read.table import FirstLook
from inercal.foundation.records.recognise.units import Guess, quoted
from inercal.foundation.records.recognise.words import words_of


def one_thermometer(sample: FirstLook, guesses: list[Guess], chosen: Mapping[str, str]) -> list[Guess]:
    """Channels with one temperature: that of the sensor, not of the air; where words do not tell it is asked."""
    titles = {sample.origin(index): name.strip() for index, name in enumerate(sample.names)}
    several = [guess for guess in guesses if guess.name == "temperature"]
    if len(several) < 2:
        return guesses
    near = [guess for guess in several if _of_the_sensor(titles[guess.origin])]
    inside = near or [guess for guess in several if not _of_the_air(titles[guess.origin])] or several
    picked = [guess for guess in several if titles[guess.origin] == chosen.get("temperature", "").strip()]
    best = (picked or inside)[0]
    others = [titles[guess.origin] for guess in several if guess is not best]
    if not picked and len(inside) > 1:
        first, second = (titles[guess.origin] for guess in inside[:2])
        asked = (
            f"Which is the temperature of the sensor, {quoted(first)} or {quoted(second)}? Answer with the name, as "
            f"temperature={second}, or none."
        )
        best = replace(best, unit=best.unit or "degC", grade="guess", question=asked)
    best = replace(best, reason=f"{best.reason}; not taken: {', '.join(map(quoted, others[:3]))}")
    return [*(guess for guess in guesses if guess.name != "temperature"), best]


def _of_the_sensor(name: str) -> bool:
    """True for the name of a temperature within a sensor or its unit."""
    inside = r"imu|sensor|chip|die|board|intern\w*|core|mcu|cpu|mems|gyr\w*|acc\w*|inertial"
    return any(re.fullmatch(inside, word) for word in words_of(name)) and not _of_the_air(name)


def _of_the_air(name: str) -> bool:
    """True for the name of a temperature around an instrument."""
    around = (
        r"air|ambient|room|env\w*|extern\w*|outside|outdoor|luft|raum|umgebung\w*|aussen\w*|chamber|oven|bath|baro\w*|gps"
        r"|motor"
    )
    return any(re.fullmatch(around, word) for word in words_of(name))
