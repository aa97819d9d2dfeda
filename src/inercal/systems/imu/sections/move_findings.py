"""Findings about moves between rests: those left out, those that lie off the others, those without a say."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.places import counted, counted_names
from inercal.systems.imu.sections.cutting.between import NamedMove
from inercal.systems.imu.sections.outlying import outlying_of
from inercal.systems.imu.sections.with_moves import CalibrationWithMoves


def findings_of_moves(found: CalibrationWithMoves, moves: Sequence[NamedMove]) -> Iterator[Finding]:
    """All that a calibration says of its moves, and of rests that lie off the others beside them."""
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
    sections = found.calibration.problem.readings.sections
    for one in outlying_of(found.calibration):
        of_move = one.kind == "move"
        name = moves[found.used[one.place]].name if of_move else sections[one.place].name
        where = moves[found.used[one.place]].where if of_move else sections[one.place].where
        yield Finding(
            "outlying_section",
            f"{name} lies off what all other rests and moves say (p = {one.probability:.1g}).",
            where,
            EVERYTHING,
            action="Was the instrument pushed, or the gyro at the end of its range? Leave the section out.",
        )
