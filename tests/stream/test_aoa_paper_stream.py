"""The paper's way row by row: the angles of the whole file, killed or not, and what it refuses."""

import io
from dataclasses import replace

import numpy as np
import pytest
from sting_study import BASE, DEG, G, study
from streams_that_break import lines_out
from test_aoa_stream import CALIBRATED, ROLLED, flawed, recorded

from inercal.aoa.alarm import Alarm
from inercal.aoa.reading.from_record import recording_of
from inercal.aoa.result.columns import angles_record
from inercal.aoa.result.systematic import by_methods
from inercal.aoa.settings import Calibration, Methods, Timing, Zero
from inercal.errors import RecordError, StudyError
from inercal.records.read import read
from inercal.records.write import write_record
from inercal.stream.aoa_paper import PaperAoa
from inercal.stream.lines import Lines
from inercal.stream.run import Saving

SHORT = replace(BASE, duration=0.6)
PROMPT = Timing(0.0)


def live(text, settings, methods, every=0.0, saving=None, kill=None, said=None):
    """Lines out for such a file, and the estimator."""
    lines = Lines(io.BytesIO(text.encode()), "log", None, lambda finding: None)
    of = PaperAoa(lines, settings, methods, every, lambda f: None if said is None else said.append(f))
    return lines_out(of, lines, saving, kill), of


def of_file(text, settings, methods, tmp_path):
    """The lines that a whole file gives."""
    (tmp_path / "whole.csv").write_text(text)
    recording = recording_of(read(tmp_path / "whole.csv"), settings)
    write_record(
        angles_record(recording, by_methods(recording, settings, methods), settings), tmp_path / "angles.csv"
    )
    return (tmp_path / "angles.csv").read_text().splitlines()


@pytest.mark.parametrize(
    "methods",
    [
        Methods(),
        Methods(static="gls"),
        Methods(static="segmented", centrifugal="none", tangential="none"),
        Methods(tangential="differentiated"),
    ],
    ids=lambda methods: methods.static + methods.tangential,
)
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"attitude": ROLLED, "alarm": Alarm(highest=32.0 * DEG)},
        {
            "sensors": CALIBRATED | {"gyro": replace(CALIBRATED["gyro"], range=None)},
            "timing": Timing(0.0, 5e-4, 1e-4),
        },
    ],
)
def test_lines_are_those_of_the_whole_file(methods, changes, tmp_path):
    """But for rounding, by sums of one row or of many; over a gap a difference of the gyro has another u, and without
    a gyro a common delay is made up for by the row before and not by those on both sides."""
    settings = study(motion=SHORT, **{"timing": PROMPT} | changes)
    even = methods.tangential == "differentiated"
    text = recorded(tmp_path, settings, 3, *([] if even else [flawed]))
    out, whole = live(text, settings, methods)[0], of_file(text, settings, methods, tmp_path)
    assert out[0] == whole[0]
    assert [line.split(",")[0] for line in out] == [line.split(",")[0] for line in whole]
    found, wanted = (np.genfromtxt(lines[1:], delimiter=",") for lines in (out, whole))
    assert np.isfinite(wanted[:, 1]).sum() > 100
    known = found[:, 3:4] == found[:, 3:4]
    np.testing.assert_allclose(
        np.where(known, found, 0.0), np.where(known, wanted, 0.0), rtol=1e-7, atol=1e-9
    )


def test_killed_anywhere_and_resumed(tmp_path):
    settings = study(motion=SHORT, timing=PROMPT, sensors=CALIBRATED)
    text = recorded(tmp_path, settings, 6, flawed)
    whole, _ = live(text, settings, Methods(tangential="differentiated"))
    saving, given = Saving(tmp_path / "state", 7), []
    for kill in (2, 24, 205, 240, None):
        given += live(text, settings, Methods(tangential="differentiated"), saving=saving, kill=kill)[0]
    assert set(given) == set(whole)


def test_limits_ranges_and_intervals(tmp_path):
    """A line each 0.1 s; what is beyond the limits, and a sensor at its range, are said once."""
    settings = study(
        motion=SHORT,
        timing=PROMPT,
        alarm=Alarm(highest=32.0 * DEG),
        sensors={"a2": Calibration(range=0.6 * G)},
    )
    said = []
    out, _ = live(recorded(tmp_path, settings, 8), settings, Methods(), every=0.1, said=said)
    assert 5 <= len(out) - 1 <= 7
    codes = [each.code for each in said]
    assert codes.count("beyond_limits") == 1
    assert codes.count("saturation") == 1


def test_rows_without_an_angle_are_counted(tmp_path):
    settings = study(motion=SHORT, timing=PROMPT)

    def silent(rows):
        name = next(each for each in rows[0] if each.startswith("a2"))
        return [row | {name: ""} for row in rows]

    text = recorded(tmp_path, settings, 8)
    _, of = live(recorded(tmp_path, settings, 8, silent), settings, Methods())
    assert of.failure == "600 rows of 600 have no angle"
    back = "\n".join([*text.splitlines()[:300], *(text.splitlines()[1:200] * 10)]) + "\n"
    with pytest.raises(RecordError, match=r"rows in a row are not later than 0\.298 s"):
        live(back, settings, Methods())


@pytest.mark.parametrize(
    ("methods", "changes", "words"),
    [
        (Methods(centrifugal="decision"), {}, "found decision with a stream, expected mechanical or none"),
        (Methods(), {"timing": Timing(2e-3)}, "found 2 ms with the paper's way on a stream"),
        (Methods(), {"zero": Zero(0.0, 1.0, 0.0, 1e-4)}, "known after its stretch alone"),
    ],
)
def test_what_looks_ahead_is_refused(methods, changes, words):
    with pytest.raises(StudyError, match=words):
        live("t [s],a1 [g],a2 [g],a3 [g],gyro [deg/s]\n0,0,0,0,0\n", study(**changes), methods)


def test_without_a_gyro_it_is_said_which_methods_work():
    text = "t [s],a1 [g],a2 [g],a3 [g]\n0,-0.87,0.5,0.87\n1,-0.87,0.5,0.87\n"
    with pytest.raises(RecordError, match="without it none, none or none, dual work"):
        live(text, study(), Methods())
    out, of = live(text, study(), Methods(centrifugal="none"))
    assert out[2].split(",")[1].startswith("29.88")
    assert of.failure == ""
