"""Checks of what is said of sections against what was read in them, before any fit.

Names are hypotheses: a side taken twice, a rest that does not stand where its name says, outputs of the other sign, a
rate or turn that the gyro contradicts. What data contradict becomes a finding that asks, and is not believed.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.inference.plausible import off_scale
from inercal.foundation.records.places import counted_names
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.section import Section

_LETTERS = "xyz"


def contradictions(
    sections: Sequence[Section], gyro_scale: float | None, *, backward: bool = False
) -> tuple[Finding, ...]:
    """Findings about sections in which something else was read than is said of them.

    ``gyro_scale`` is that of a sound gyro [output per rad/s]; None: in counts, only compared with each other. One that
    is known to count ``backward`` has the opposite sign.
    """
    sense = -1.0 if backward else 1.0
    return (*_of_rests(sections), *_turning_rests(sections), *_of_rotations(sections, gyro_scale, sense))


def direction(vector: Array) -> str:
    """A direction (3,) in words: ``+x`` of the nearest axis."""
    k = int(np.argmax(np.abs(vector)))
    return f"{'-' if vector[k] < 0.0 else '+'}{_LETTERS[k]}"


def specific_force(means: Array) -> Array:
    """Specific force (n, 3), as a part of gravity, in means (n, 3) of accelerometers that are not calibrated.

    Most rests on sides have an axis level, so that its median is its bias.
    """
    off = means - np.median(means, axis=0)
    return np.asarray(off / np.median(np.linalg.norm(off, axis=1)))


def _of_rests(sections: Sequence[Section]) -> list[Finding]:
    """Contradictions of rests; a side taken twice is named alone, for it makes sound ones look wrong."""
    named = [one for one in sections if one.kind == "rest" and one.up is not None and one.acc is not None]
    whole = [one for one in named if np.isfinite(one.acc).all()]  # type: ignore[arg-type]
    if len(whole) < 2:
        return []
    means, ups = (np.array([getattr(one, name) for one in whole]) for name in ("acc", "up"))
    if len(whole) >= LIMITS.sides_to_compare:
        sizes = np.linalg.norm(specific_force(means), axis=1)
        odd = [k for k in range(len(whole)) if not 0.5 < sizes[k] < 2.0]
        if odd:  # first: one file in a small unit makes all others look alike
            return [_other_unit(whole[k], float(sizes[k])) for k in odd]
    gravity = 0.5 * float(np.max(np.ptp(means, axis=0)))
    near = 2.0 * np.sin(0.5 * LIMITS.side) * gravity
    twice = [
        _taken_twice(whole[i], whole[j], whole)
        for i, j in itertools.combinations(range(len(whole)), 2)
        if ups[i] @ ups[j] < -np.cos(LIMITS.side) and np.linalg.norm(means[i] - means[j]) < near
    ]
    if twice:
        return twice
    if len(whole) < LIMITS.sides_to_compare:
        return []
    force = specific_force(means)
    cosines = np.sum(force * ups, axis=1) / np.linalg.norm(force, axis=1)
    if np.all(cosines < -np.cos(LIMITS.side)):
        return [
            Finding(
                "sign_suspect",
                "Every rest stands on the side opposite to its name.",
                counted_names([one.where for one in whole]),
                action="Say whether the outputs show gravity, down: then give acc the sign - in the map.",
                harm=EVERYTHING,
            )
        ]
    wrong = [k for k in range(len(whole)) if cosines[k] < np.cos(LIMITS.side)]
    return [_elsewhere(whole[k], force[k]) for k in wrong]


def _turning_rests(sections: Sequence[Section]) -> Iterator[Finding]:
    """Rests in which the gyro reads something else than in the others."""
    rests = [
        one for one in sections if one.kind == "rest" and one.gyro is not None and np.isfinite(one.gyro).all()
    ]
    if len(rests) < LIMITS.holds_to_compare:
        return
    means = np.array([one.gyro for one in rests])
    off = np.linalg.norm(means - np.median(means, axis=0), axis=1)
    for one, size in zip(rests, off, strict=True):
        if size > LIMITS.turning_rest * float(np.median(off)):
            yield Finding(
                "not_at_rest",
                f"The gyro turns in {one.name}: {size / float(np.median(off)):.0f} times as far off as in other rests.",
                one.where,
                action="Take it out, or state it as kind `rate` with its rate.",
                harm=EVERYTHING,
            )


def _taken_twice(one: Section, other: Section, whole: Sequence[Section]) -> Finding:
    """Two files of opposite sides that hold the same one."""
    assert one.up is not None
    assert one.acc is not None
    rest = [third for third in whole if third is not one and third is not other]
    # which of the two is right shows against the rest, if there are any
    middle = (
        np.median([third.acc for third in rest if third.acc is not None], axis=0)
        if len(rest) > 1
        else one.acc
    )
    along = float((one.acc - middle) @ one.up)
    wrong, right = (other, one) if along > 0.0 else (one, other)
    said = "" if len(rest) < 2 else f", which looks like that of {right.name}"
    return Finding(
        "poor_section",
        f"{one.name} and {other.name} hold the same side{said}.",
        f"{one.where} and {other.where}",
        action=f"Record the side of {wrong.name} again, or correct its name.",
        harm=EVERYTHING,
    )


def _other_unit(section: Section, size: float) -> Finding:
    """A rest whose output is not of the size of gravity."""
    return Finding(
        "unit_suspect",
        f"{section.name} reads {size:.3g} times the gravity of the other rests.",
        section.where,
        action="Say in the map which unit this file has.",
        harm=EVERYTHING,
    )


def _elsewhere(section: Section, force: Array) -> Finding:
    """A rest that does not stand where its name says."""
    assert section.up is not None
    found, said = direction(force), direction(section.up)
    angle = float(np.degrees(np.arccos(np.clip(force @ section.up / np.linalg.norm(force), -1.0, 1.0))))
    code = "sign_suspect" if found[1] == said[1] and found != said else "channel_swap"
    off = f"{angle:.0f} deg off {said}" if found == said else f"on {found}, not on {said}"
    return Finding(
        code if found != said else "poor_section",
        f"{section.name} stands {off}.",
        section.where,
        action=f"Correct its name or `up`, or say in the map which column is acc_{found[1]} and with which sign.",
        harm=EVERYTHING,
    )


def _of_rotations(sections: Sequence[Section], gyro_scale: float | None, sense: float) -> Iterator[Finding]:
    """Contradictions of rates and turns."""
    turning = [
        one
        for one in sections
        if one.kind in ("rate", "turn")
        and one.gyro is not None
        and np.isfinite(one.gyro).all()
        and one.axis is not None
        and _rate(one) != 0.0
    ]
    if not turning:
        return
    bias = _bias(sections, turning, gyro_scale)
    if bias is None:
        return
    gains = []
    for one in turning:
        assert one.axis is not None
        assert one.gyro is not None
        off = one.gyro - bias
        k = int(np.argmax(np.abs(off)))
        axis = int(np.argmax(np.abs(one.axis)))
        if k != axis and abs(off[k]) > 2.0 * abs(off[axis]):
            yield Finding(
                "channel_swap",
                f"{one.name} turns about {_LETTERS[k]}, not about {_LETTERS[axis]}.",
                one.where,
                action="Correct its name or `axis`, or say in the map which column is which axis of the gyro.",
                harm=EVERYTHING,
            )
        else:
            gains.append((one, sense * float(off @ one.axis) / _rate(one)))
    yield from _of_gains(gains, gyro_scale)


def _of_gains(gains: Sequence[tuple[Section, float]], gyro_scale: float | None) -> Iterator[Finding]:
    """Contradictions in sign and size of outputs over stated rates."""
    if not gains:
        return
    if len(gains) > 1 and all(gain < 0.0 for _, gain in gains):
        yield Finding(
            "sign_suspect",
            "Every rate or turn has the sign opposite to what is stated.",
            counted_names([one.where for one, _ in gains]),
            action="Say whether rates are counted against the right-hand rule, or give gyro the sign - in the map.",
            harm=EVERYTHING,
        )
        return
    if gyro_scale is not None and len(gains) > 1:
        parts = np.array([gain / gyro_scale for _, gain in gains])
        part = float(np.median(parts))
        if abs(part - 1.0) > LIMITS.rate_miss and np.ptp(parts) < LIMITS.rate_miss * part:
            yield off_scale("The gyro", f"{part:.3g} times what is stated", part, harm=EVERYTHING)
            return
    usual = gyro_scale if gyro_scale is not None else float(np.median([abs(gain) for _, gain in gains]))
    for one, gain in gains:
        what, unit, stated = (
            ("rate", "deg/s", one.rate) if one.kind == "rate" else ("angle", "deg", one.angle)
        )
        if gain < 0.0:
            yield Finding(
                "sign_suspect",
                f"{one.name} turns the other way than its {what} says, about {_letter(one)}.",
                one.where,
                action=f"Correct the sign of its `{what}` or `axis`, or that of gyro_{_letter(one)} in the map.",
                harm=EVERYTHING,
            )
        elif abs(gain / usual - 1.0) > LIMITS.rate_miss:
            found, said = np.degrees(stated * gain / usual), np.degrees(stated)
            yield Finding(
                "rate_suspect",
                f"{one.name} is stated as {said:.6g} {unit}, and the gyro reads about {found:.4g} {unit}.",
                one.where,
                action=f"Correct its `{what}`, or the unit of the gyro in the map.",
                harm=EVERYTHING,
            )


def _letter(section: Section) -> str:
    """The axis of the case that a rotation is nearest to."""
    return "" if section.axis is None else direction(section.axis)[1]


def _bias(sections: Sequence[Section], turning: Sequence[Section], gyro_scale: float | None) -> Array | None:
    """Mean output (3,) of the gyro at rest; without rests by all rates, in counts where these tell it; else None."""
    rests = [one.gyro for one in sections if one.kind == "rest" and one.gyro is not None]
    if rests:
        return np.asarray(np.median(rests, axis=0))
    if gyro_scale is not None:
        return np.zeros(3)
    if len(turning) < LIMITS.sides_to_compare:
        return None
    rates = np.array([_rate(one) * one.axis for one in turning if one.axis is not None])
    outputs = np.array([one.gyro for one in turning])
    middle = outputs.mean(axis=0), rates.mean(axis=0)
    gain = np.sum((outputs - middle[0]) * (rates - middle[1])) / np.sum((rates - middle[1]) ** 2)
    return np.asarray(middle[0] - gain * middle[1])


def _rate(section: Section) -> float:
    """Mean rate that is stated of a rate or a turn [rad/s]."""
    return section.rate if section.kind == "rate" else section.angle / section.duration
