"""Findings about moves between rests: those left out, those that lie off the others, those without a say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import fdtrc

from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.places import counted, counted_names
from inercal.systems.imu.limits import LIMITS as OF_ALL
from inercal.systems.imu.sections.calibration import SectionCalibration
from inercal.systems.imu.sections.cutting.between import NamedMove
from inercal.systems.imu.sections.outlying import outlying_of, shifts_of
from inercal.systems.imu.sections.with_moves import CalibrationWithMoves


def of_channels(found: CalibrationWithMoves) -> tuple[Finding, ...]:
    """Questions about the channels of a gyro that contradicts the accelerometers, for which it is not calibrated."""
    channels = found.channels
    if channels is None:
        return ()
    text = (
        f"Gyro and accelerometers contradict each other by {math.degrees(channels.miss):.0f} deg after moves."
    )
    action = "Check the signs and the order of its axes in the map."
    out = [Finding("contradiction", f"{text[:-1]}: it is not calibrated.", harm=EVERYTHING, action=action)]
    if channels.told:
        measured = ", ".join(
            f"gyro_{name} measures {'+' if sign > 0 else '-'}{'xyz'[axis]}"
            for name, axis, sign in zip("xyz", channels.order, channels.signs, strict=True)
            if (name, sign) != ("xyz"[axis], 1.0)
        )
        code = "sign_suspect" if channels.order == (0, 1, 2) else "channel_swap"
        headline = f"Against the accelerometers {measured}, it seems."
        out.append(Finding(code, headline, harm=EVERYTHING, action=action))
    return tuple(out)


def findings_of_moves(
    found: CalibrationWithMoves, moves: Sequence[NamedMove], *, numbered: bool = False
) -> Iterator[Finding]:
    """All that a calibration says of its moves, and of rests that lie off the others beside them; those that are
    ``numbered`` a study leaves out by number or time."""
    if found.left_out:
        few = "is" if len(found.left_out) == 1 else "are"
        yield Finding(
            "poor_section",
            f"{len(found.left_out)} of {counted(len(moves), 'move')} {few} not used.",
            moves[found.left_out[0].move].where,
            (),
            action="Move more slowly, or set a larger range of the gyro.",
            items=tuple({"move": moves[one.move].name, "why": one.why} for one in found.left_out),
        )
    if found.spoiled:
        yield Finding(
            "contradiction",
            f"Moves would make {counted_names(found.spoiled)} of the accelerometers worse, and have no say in it.",
            harm=(),
            action="Move more slowly, and set a larger range and a faster rate of the gyro.",
        )
    if found.rescaled:
        yield Finding(
            "unit_suspect",
            "Moves between rests deny the stated unit of the gyro.",
            harm=tuple(
                name for name in found.calibration.names if name.startswith(("S_", "D_F", "T_", "G_"))
            ),
            action="Check the unit of the gyro in the map.",
        )
    if not found.calibration.converged:
        return
    yield from _drifting(found.calibration)
    outlying = outlying_of(found.calibration)
    if not outlying:
        return
    sections = found.calibration.problem.readings.sections
    shifts = shifts_of(found.calibration, outlying)
    worst = max(shifts, key=lambda name: abs(shifts[name]))
    for one in outlying:
        if one.kind == "move":
            of = moves[found.used[one.place]]
            name, where = of.name, of.where
            left = f"{of.move.t[0]:.2f} s .. {of.move.t[-1]:.2f} s"
        else:
            name, where = sections[one.place].name, sections[one.place].where
            left = name
        leave = f'by imu.exclude = ["{left}"]' if numbered else "of the sections"
        yield Finding(
            "outlying_section",
            f"{name} lies off what all other rests and moves say (p = {one.probability:.1g}).",
            where,
            tuple(term for term, shift in shifts.items() if abs(shift) > 1.0),
            action=f"Was the instrument pushed, or the gyro at the end of its range? Leave it out {leave}.",
            items=({"without it": worst, "changes by [u]": shifts[worst]},),
        )


def _drifting(found: SectionCalibration) -> Iterator[Finding]:
    """A bias of the gyro that changes from rest to rest in their order: moves have that of the rests beside them."""
    left = found.residuals[:, 2]
    n = len(left)
    if n - 2 < OF_ALL.outlier_dof or not any(name.startswith("D_F") for name in found.names):
        return
    course = np.linspace(-0.5, 0.5, n)
    gain = course @ left / (course @ course)
    rest = np.sum((left - course[:, None] * gain) ** 2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(rest > 0.0, gain**2 * (course @ course) / (rest / (n - 2)), 0.0)
    if 3.0 * float(np.min(fdtrc(1, n - 2, ratio))) < OF_ALL.driver_probability:
        yield Finding(
            "bias_drift",
            "The bias of the gyro drifts from pose to pose, and D_F is its mean.",
            harm=(),
            action="Let the unit warm up before the first pose.",
            items=tuple(
                {"axis": axis, "drift in all [output]": float(size)}
                for axis, size in zip("xyz", gain, strict=True)
            ),
        )
