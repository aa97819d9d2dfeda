"""Verdict of a Ferraris calibration: contradictions, findings, status in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding, Status
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted_names
from inercal.systems.imu.ferraris.method import Inputs, Matrices
from inercal.systems.imu.ferraris.names import NAMES, POSITIONS, TURNS, in_words
from inercal.systems.imu.ferraris.readings import SectionReadings
from inercal.systems.imu.ferraris.scatter import Scatter
from inercal.systems.imu.ferraris.sections import Sections
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import unit_words
from inercal.systems.imu.settings import FerrarisSettings


def too_few(sections: Sections) -> str:
    """The missing sections, and the remedy."""
    missing = sections.missing
    present = len(NAMES) - len(missing)
    wanted = ", ".join(f"{name} ({in_words(name)})" for name in missing)
    how = {
        "labels": "label it in the recording",
        "study": "name it under imu.ferraris.sections",
        "detection": "record it, or name it under imu.ferraris.sections",
    }[sections.found_by]
    plural = how if len(missing) == 1 else how.replace(" it", " them")
    strange = f" (found the labels {counted_names(sections.strange)})" if sections.strange else ""
    return f"found {present} of the nine sections, not {wanted}: {plural}{strange}"


def unused_labels(sections: Sections) -> list[Finding]:
    """``unused_labels``: the record is labelled, but no label names a section, so that these were detected."""
    if sections.found_by != "detection" or not sections.strange:
        return []
    text = (
        f"the labels {counted_names(sections.strange)} name none of the sections x_p to z_rot, which were detected "
        'instead: state them under imu.ferraris.sections, such as x_p = "LABEL"'
    )
    return [Finding("unused_labels", text)]


def contradictions(
    triads: tuple[Triad, Triad],
    matrices: Matrices,
    misses: tuple[float, float] | None,
    options: FerrarisSettings,
) -> Iterator[Finding]:
    """Contradictions of the data to the sections or the stated turn, which make a result inconsistent."""
    for triad, model in zip(triads, (matrices.accelerometer, matrices.gyro), strict=True):
        wrong = unit_words(triad, replace(model, scale=np.abs(model.scale)))
        if wrong:
            yield Finding("unit_suspect", wrong, harm=EVERYTHING)
    sign = np.sign(np.diag(matrices.rate_gain))
    if np.ptp(sign) > 0.0:
        odd = 1.0 if np.sum(sign > 0.0) == 1 else -1.0
        axis = "xyz"[int(np.argmax(sign == odd))]
        yield Finding(
            "sign_suspect",
            f"gyro_{axis} runs against the other two in the turns: check its sign in the map, or whether {axis}_rot "
            "was turned the other way",
            harm=("gyro",),
        )
    elif misses is not None and misses[0] > LIMITS.vertical_miss:
        if misses[1] < min(LIMITS.vertical_miss, 0.5 * misses[0]):
            yield Finding(
                "sign_suspect",
                f"the motion between the positions shows that the turns were made against the stated sense: state "
                f'imu.ferraris.turn = "{-math.degrees(options.turn):g} deg"',
                harm=("gyro",),
            )
        else:
            yield Finding(
                "contradiction",
                f"gyro and accelerometers contradict each other by {math.degrees(misses[0]):.0f} deg (rms of the "
                "verticals carried from position to position): check the order and signs of the gyro's axes, and the "
                "angle of the turns",
                harm=EVERYTHING,
            )


def wrong_axes(x: Inputs, weights: Array) -> Iterator[Finding]:
    """Positions and turns that show on another axis than they should, upside down, or not at all."""
    force = (x.force[0::2] - x.force[1::2]).T
    turned = ((x.turned_rate - weights @ x.rate) * x.durations[:, None]).T
    for sensor, gain in (("acc", force), ("gyro", turned)):
        size = np.max(np.abs(gain), axis=1, keepdims=True)
        by_axis = gain / np.where(size > 0.0, size, 1.0)
        for j, axis in enumerate("xyz"):
            what = f"the positions {axis}_p and {axis}_a" if sensor == "acc" else f"the turn {axis}_rot"
            shows = "show" if sensor == "acc" else "shows"
            seen = int(np.argmax(np.abs(by_axis[:, j])))
            if abs(by_axis[seen, j]) < LIMITS.faint_response:
                text = f"{what} {shows} hardly on any axis of {sensor}: check the sections"
                yield Finding("contradiction", text, harm=EVERYTHING)
            elif seen != j:
                yield Finding(
                    "channel_swap",
                    f"{what} {shows} on {sensor}_{'xyz'[seen]}: check the order of the channels and the sections",
                    harm=EVERYTHING,
                )
            elif sensor == "acc" and by_axis[j, j] < 0.0:
                yield Finding(
                    "sign_suspect",
                    f"acc_{axis} reads downward in {axis}_p and upward in {axis}_a: check its sign in the map, and the "
                    "sections",
                    harm=EVERYTHING,
                )


def sense_finding(
    matrices: Matrices, misses: tuple[float, float] | None, options: FerrarisSettings
) -> Iterator[Finding]:
    """A gyro that runs against the stated sense on all axes: negative scale factors, and what they may mean.

    A negative sense of the turns is no default: it was stated on purpose, and is believed.
    """
    if np.any(np.diag(matrices.rate_gain) > 0.0):
        return
    text = "all three gyro axes run against the stated sense of the turns, so that the scale factors S are negative: "
    if misses is None:
        yield Finding(
            "sign_suspect",
            text
            + "the gyro counts against the right-hand rule, or the turns were made the other way (then change "
            "the sign of imu.ferraris.turn); the recording lacks the motion between the positions that would tell",
            harm=() if options.turn < 0.0 else ("gyro",),
        )
    else:
        yield Finding("sign_suspect", text + "the gyro counts against the right-hand rule", harm=())


def scatter_findings(scatter: Scatter, options: FerrarisSettings) -> Iterator[Finding]:
    """Findings about the six equations left over in the positions of each sensor."""
    if options.alignment is not None and scatter.excess["acc"]:
        yield Finding(
            "excess_scatter",
            f"the positions scatter by {math.degrees(scatter.tilt):.2g} deg, more than the stated alignment of "
            f"{math.degrees(options.alignment):.2g} deg explains; the uncertainties use the scatter",
            harm=(),
        )
    if scatter.excess["gyro"]:
        yield Finding(
            "excess_scatter",
            f"the gyro's output at rest scatters from position to position {scatter.over_expected['gyro']:.1f} times "
            "as much as its noise within them explains; the uncertainties use the scatter",
            harm=(),
        )


def verdict(
    readings: SectionReadings, scatter: Scatter, against: list[Finding], options: FerrarisSettings
) -> tuple[Status, str]:
    """Status and message; ``against`` what contradicts the result."""
    poor = [*(finding for finding in readings.findings if finding.code != "turn_cut"), *against]
    if poor:
        return Status.INCONSISTENT, poor[0].message
    if scatter.tilt > LIMITS.position_tilt and not math.isinf(scatter.tilt_dof):
        worst = int(np.argmax(np.max(np.abs(scatter.left["acc"]), axis=1)))
        pair = f"{POSITIONS[2 * worst]} and {POSITIONS[2 * worst + 1]}"
        return Status.INCONSISTENT, (
            f"the positions scatter by {math.degrees(scatter.tilt):.0f} deg from upright, most of all {pair}: check "
            "the sections"
        )
    seen = "as stated" if math.isinf(scatter.tilt_dof) else "by their scatter"
    return Status.OK, (
        f"{3 + 9 + 12 + 9} coefficients from {len(POSITIONS)} positions and {len(TURNS)} turns of "
        f"{math.degrees(options.turn):g} deg; positions upright to {math.degrees(scatter.tilt):.2g} deg ({seen})"
    )
