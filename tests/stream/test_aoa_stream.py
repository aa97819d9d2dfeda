"""A model measured row by row: a line for each, with the digits of the whole file, killed or not."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import BASE, DEG, G, study
from streams_that_break import lines_out

from inercal.faces.stream.aoa import Aoa
from inercal.faces.stream.checkpoint import fingerprint
from inercal.faces.stream.lines import Lines
from inercal.faces.stream.run import Saving
from inercal.foundation.errors import InputError, RecordError, StudyError
from inercal.foundation.records.read import read
from inercal.foundation.records.write import write_record
from inercal.foundation.results.files import save
from inercal.foundation.units import parse_quantity, parse_unit
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.disturbances import Disturbances, Oscillation
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.reading.from_record import recording_of
from inercal.systems.aoa.reading.wind_off_zero import with_zero
from inercal.systems.aoa.result.columns import angles_record
from inercal.systems.aoa.result.systematic import by_fusion
from inercal.systems.aoa.settings import Attitude, Estimator, SensorCalibration, Timing, Zero
from inercal.systems.aoa.simulate import simulate, to_record
from inercal.systems.aoa.task import measure

SHORT = replace(BASE, duration=0.6)
LONG = replace(BASE, duration=4.2, sample_rate=500.0)
#: sensors that read counts and volts, with bias, slopes and ranges
CALIBRATED = {
    "a1": SensorCalibration(2.5e-3, 0.02, 0.9 * G, 1e-4, 1e-3, 20.0, "count"),
    "a2": SensorCalibration(1.02, -0.03),
    "a3": SensorCalibration(0.5 * G, 0.01, 3.0 * G, per="V"),
    "gyro": SensorCalibration(-20.0 * DEG, 0.01, 40.0 * DEG, per="V"),
}
ROLLED = Attitude(
    roll=parse_quantity("5.0(2) deg", "angle", "roll"), upwash=parse_quantity("0.1(1) deg", "angle", "up")
)


def recorded(tmp_path, settings, seed=1, change=lambda rows: rows, **columns):
    """Header and rows of a simulated file, fields as text; ``columns`` are functions of its time, in degC."""
    record = to_record(simulate(settings, np.random.default_rng(seed)).recording, settings)
    first = next(iter(record.columns.values()))
    more = {
        name: replace(first, name=name, unit=parse_unit("degC"), values=of(first.t))
        for name, of in columns.items()
    }
    write_record(replace(record, columns={**record.columns, **more}), tmp_path / "log.csv")
    header, *rows = (tmp_path / "log.csv").read_text().splitlines()
    fields = change([dict(zip(header.split(","), row.split(","), strict=True)) for row in rows])
    return "\n".join([",".join(fields[0]), *(",".join(row.values()) for row in fields)]) + "\n"


def live(text, settings, every=0.0, saving=None, kill=None, said=None):
    """Lines out for such a file, without their status, which is 1 until a stream has decided."""
    return [without_status(line) for line in whole_lines(text, settings, every, saving, kill, said)]


def without_status(line):
    """A line of angles less its sixth field."""
    fields = line.split(",")
    return ",".join(fields[:5] + fields[6:])


def whole_lines(text, settings, every=0.0, saving=None, kill=None, said=None):
    """Lines out for such a file."""
    lines = Lines(io.BytesIO(text.encode()), "log", None, lambda finding: None)
    estimator = Aoa(lines, settings, every, lambda f: None if said is None else said.append(f))
    return lines_out(estimator, lines, saving, kill)


def of_file(text, settings, tmp_path):
    """The lines that a whole file gives."""
    (tmp_path / "whole.csv").write_text(text)
    recording = with_zero(recording_of(read(tmp_path / "whole.csv"), settings), settings)
    of = problem(settings, recording.spatial)
    angles = by_fusion(recording, settings, of, estimate(recording, of))
    write_record(angles_record(recording, angles, settings), tmp_path / "angles.csv")
    return [without_status(line) for line in (tmp_path / "angles.csv").read_text().splitlines()]


def flawed(rows):
    """Rows without a time, twice, backward, without values, and not there for so long that the angle is lost."""
    rows[0]["t [s]"] = ""
    rows[4]["t [s]"] = rows[3]["t [s]"]
    name = next(name for name in rows[0] if name.startswith("a1"))
    of_gyro = next(name for name in rows[0] if name.startswith("gyro ["))
    rows[7][name] = rows[90][name] = rows[91][name] = ""
    rows[95][of_gyro] = "NaN"
    rows[120]["t [s]"], rows[150]["t [s]"] = rows[100]["t [s]"], ""
    rows[151] = dict.fromkeys(rows[151], "")
    for row in rows[200:]:
        row["t [s]"] = repr(float(row["t [s]"] or "nan") + 40.0).replace("nan", "")
    rows[205]["t [s]"] = rows[204]["t [s]"]
    for row in rows[-10:]:
        row["t [s]"] = repr(float(row["t [s]"]) + 40.0)
    return rows[:220] + rows[228:]


@pytest.mark.parametrize("states", [8, 11, 15, 19])
def test_lines_are_those_of_the_whole_file_to_the_last_digit(states, tmp_path):
    settings = study(states, SHORT)
    text = recorded(tmp_path, settings, change=flawed)
    out = live(text, settings)
    assert out == of_file(text, settings, tmp_path)
    assert out[0] == "t [s],theta [deg],u_theta [deg],rate [deg/s],nis [1]"
    assert len(out) == len(text.splitlines())
    assert out[1] == ",,,,"  # a row without a time has its line, and no angle


@pytest.mark.parametrize(
    "changes",
    [
        {"attitude": ROLLED},
        {"timing": replace(study().timing, gyro_delay=None, common_delay=5e-4, common_delay_u=1e-4)},
        {"sensors": {"a2": SensorCalibration(range=0.6 * G)}},
        {"sensors": CALIBRATED, "disturbances": Disturbances(spikes=1e-3)},
    ],
)
def test_so_they_are_with_whatever_the_study_states(changes, tmp_path):
    settings = study(motion=SHORT, **changes)
    text = recorded(tmp_path, settings, 2, flawed)
    assert live(text, settings) == of_file(text, settings, tmp_path)


def test_sensors_are_calibrated_at_the_temperature_of_the_row(tmp_path):
    settings = study(motion=SHORT, sensors=CALIBRATED)
    text = recorded(tmp_path, settings, 3, temperature=lambda t: 25.0 + 10.0 * t)
    out = live(text, settings)
    assert out == of_file(text, settings, tmp_path)
    colder = recorded(tmp_path, settings, 3, temperature=lambda t: 15.0 + 0.0 * t)
    assert out != live(colder, settings)


def test_gyros_for_roll_and_yaw_are_used(tmp_path):
    settings = study(motion=SHORT, disturbances=Disturbances(yaw=Oscillation(1.0 * DEG, 8.0)))
    text = recorded(tmp_path, settings, 4, flawed)
    assert "gyro_yaw" in text.splitlines()[0]
    assert live(text, settings) == of_file(text, settings, tmp_path)


@pytest.mark.parametrize("block", [37, 10_000])
def test_with_them_alpha_and_beta_are_those_of_the_tracked_roll(block, tmp_path, monkeypatch):
    """To the digit, and off by degrees from those of the stated roll: the model rolls by 2 deg while it is measured."""
    monkeypatch.setattr("inercal.systems.aoa.fusion.filter_result._BLOCK", block)
    rolling = Disturbances(roll=Oscillation(2.0 * DEG, 6.0), yaw=Oscillation(1.0 * DEG, 8.0))
    settings = study(motion=SHORT, disturbances=rolling, attitude=ROLLED)
    text = recorded(tmp_path, settings, 4, flawed)
    out = live(text, settings)
    assert out == of_file(text, settings, tmp_path)
    stated = settings.attitude.roll.value
    theta, beta = np.radians(np.genfromtxt(out[50:150], delimiter=",")[:, [1, 6]]).T
    assert np.nanmax(np.abs(np.arcsin(np.sin(beta) / np.sin(theta)) - stated)) > 1.0 * DEG
    # killed and resumed too
    saving = Saving(tmp_path / "state", 7)
    given = [line for kill in (2, 130, 214, None) for line in live(text, settings, saving=saving, kill=kill)]
    assert set(given) == set(out)


@pytest.mark.slow
def test_a_prior_from_a_turntable_puts_the_sensors_right_as_in_the_file(tmp_path):
    """An axis that is off by 1 mrad: the stream corrects the study as the whole file does."""
    table = replace(BASE, kind="two-tone", duration=20.0, sample_rate=500.0, mean=20.0 * DEG, amplitude=25.0 * DEG,
                    frequency=0.2, second_amplitude=5.0 * DEG, second_frequency=1.3)  # fmt: skip
    settings = study(motion=table)
    off = replace(settings.layout, angle=settings.layout.angle + np.array([1e-3, -5e-4, 0.0]))
    made = to_record(simulate(replace(settings, layout=off), np.random.default_rng(11)).recording, settings)
    first = measure(made, settings)
    save(first.estimate, tmp_path / "table.json")
    second = replace(
        settings, motion=SHORT, estimator=replace(settings.estimator, prior=str(tmp_path / "table.json"))
    )
    text = recorded(tmp_path, second, 12)
    (tmp_path / "whole.csv").write_text(text)
    whole = measure(read(tmp_path / "whole.csv"), second)
    assert abs(whole.settings.layout.angle - settings.layout.angle).max() > 5e-4
    write_record(angles_record(whole.recording, whole.angles, whole.settings), tmp_path / "angles.csv")
    whole_file = (tmp_path / "angles.csv").read_text().splitlines()
    assert live(text, second) == [without_status(line) for line in whole_file]


def test_a_model_on_its_side_is_refused():
    on_side = Attitude(roll=parse_quantity("-90 deg", "angle", "roll"))
    with pytest.raises(StudyError, match=r"model\.roll: found -90 deg, expected one further from \+-90 deg"):
        live("t [s],a1 [g],a2 [g],a3 [g],gyro [deg/s]\n0,0,0,0,0\n", study(attitude=on_side))


def test_the_zero_is_put_in_once_it_is_over_as_the_file_has_it(tmp_path):
    """A model at rest at an angle that is known: better known after than without, to the digits of the file."""
    rest = replace(BASE, kind="static", duration=1.0, first=3.0 * DEG, last=3.0 * DEG)
    settings = study(motion=rest, zero=Zero(0.2, 0.8, 3.0 * DEG, 1e-4 * DEG))

    def gaps(rows):
        rows[500]["a1 [g]"] = ""
        return rows

    text = recorded(tmp_path, settings, 5, gaps)
    out = live(text, settings)
    over = 802 + 1  # of the head and the row by which it is seen that the stretch is over
    assert out[over:] == of_file(text, settings, tmp_path)[over:]
    plain = live(text, replace(settings, zero=None))
    assert out[:over] == plain[:over]
    u, without = ([float(line.split(",")[2]) for line in lines[1:]] for lines in (out, plain))
    assert u[-1] < 0.9 * without[-1]


def test_a_zero_in_slight_buffet_is_averaged_and_one_in_motion_left_out(tmp_path):
    """0.03 deg rms: the digits of the file, which allows for it. A sweep in the stretch: said, as without a zero."""
    buffet = replace(BASE, kind="buffet", duration=4.0, mean=3.0 * DEG, rms=0.03 * DEG, low=2.0, high=10.0)
    settings = study(motion=buffet, zero=Zero(0.0, 3.0, 3.0 * DEG, 1e-3 * DEG))
    text, said = recorded(tmp_path, settings, 6), []
    out = live(text, settings, said=said)
    assert [each.code for each in said] == ["not_at_rest"]
    assert "is averaged" in said[0].message
    over = 3002 + 1
    assert out[over:] == of_file(text, settings, tmp_path)[over:]
    sweep = replace(BASE, kind="static", duration=4.0, first=0.0, last=4.0 * DEG)
    moving, said = replace(settings, motion=sweep), []
    text = recorded(tmp_path, moving, 7)
    assert live(text, moving, said=said) == live(text, replace(moving, zero=None))
    assert "the zero is left out" in said[0].message
    assert said[0].harm


@pytest.mark.slow
def test_killed_anywhere_and_resumed(tmp_path):
    """While rows are held, in the midst, while they are held again, at the end: every line is one of the whole run."""
    settings = study(motion=SHORT, sensors=CALIBRATED, attitude=ROLLED)
    text = recorded(tmp_path, settings, 6, flawed)
    whole = live(text, settings)
    for every in (1, 7, 50):
        saving, given = Saving(tmp_path / f"state{every}", every), []
        for kill in (2, 11, 24, 130, 203, 214, 240, 585, None):
            given += live(text, settings, saving=saving, kill=kill)
        # all but the titles are unique through their time, and so is the number of those without one
        assert set(given) == set(whole)
        timed = [line for line in given if line[0] != ","]
        assert list(dict.fromkeys(timed)) == [line for line in whole if line[0] != ","]


def test_a_stream_that_goes_on_in_another_file(tmp_path):
    """The rows held at the end of the first are answered there, and once more with those that follow."""
    settings = study(motion=SHORT)
    text = recorded(tmp_path, settings, 7, flawed)
    whole = live(text, settings)
    header, *rows = text.splitlines(keepends=True)
    for cut, held in ((208, 8), (100, 0)):
        saving = Saving(tmp_path / f"state{cut}", 10)
        first = live("".join([header, *rows[:cut]]), settings, saving=saving)
        second = live("".join([header, *rows[cut:]]), settings, saving=saving)
        assert len(first) == cut + 1
        assert first[: cut + 1 - held] == whole[: cut + 1 - held]
        assert second[1:] == whole[cut + 1 - held :]


def test_a_line_for_each_interval(tmp_path):
    settings = study(motion=SHORT)
    text = recorded(tmp_path, settings, 8, flawed)
    whole = live(text, settings)
    out = live(text, settings, every=0.1)
    assert set(out) < set(whole)
    stamps = [float(line.split(",")[0]) for line in out[1:]]
    # counted from the first row with a time, 1 ms
    assert stamps[:2] == [0.001, 0.101]
    assert all(line.split(",")[1] for line in out[1:])
    assert np.all(np.diff(np.floor((np.array(stamps) - 0.001) / 0.1 + 1e-9)) > 0)


def test_a_state_of_another_study_is_not_gone_on_with(tmp_path):
    text = recorded(tmp_path, study(motion=SHORT))
    saving = Saving(tmp_path / "state", 50)
    live(text, study(), saving=saving)
    with pytest.raises(InputError, match="other settings"):
        live(text, study(8), saving=saving)


def test_settings_that_decide_the_digits_are_in_the_fingerprint(tmp_path):
    base = study()
    others = [
        study(8),
        study(sensors={"a1": SensorCalibration(1.01)}),
        study(sensors={"gyro": SensorCalibration(range=1.0)}),
        study(attitude=ROLLED),
        study(attitude=replace(ROLLED, yaw=ROLLED.upwash)),
        study(zero=Zero(0.0, 1.0, 0.0, 1e-3)),
        study(noise=replace(base.noise, gyro=0.01)),
        study(r=(-0.2, 0.2, 0.25)),
        study(timing=replace(base.timing, common_delay=1e-3)),
    ]
    lines = Lines(
        io.BytesIO(recorded(tmp_path, study(motion=SHORT)).encode()), "log", None, lambda finding: None
    )
    marks = {fingerprint(Aoa(lines, each).settings) for each in (base, *others)}
    marks.add(fingerprint(Aoa(lines, base, 1.0).settings))
    assert len(marks) == 2 + len(others)


def test_what_is_missing_is_said_once_and_gone_without(tmp_path):
    settings = study(motion=SHORT)

    def without(*names):
        return lambda rows: [{k: v for k, v in row.items() if k.split(" ")[0] not in names} for row in rows]

    for names, code in ((("gyro",), "gyro_missing"), (("a3",), "nan")):
        text = recorded(tmp_path, settings, change=without(*names))
        said, saving = [], Saving(tmp_path / f"state{code}", 10)
        live(text, settings, saving=saving, kill=50, said=said)
        live(text, settings, saving=saving, said=said)
        assert [finding.code for finding in said] == [code]
        assert live(text, settings) == of_file(text, settings, tmp_path)


def test_saturation_is_said_once_for_each_sensor(tmp_path):
    settings = study(
        motion=LONG,
        sensors={"a2": SensorCalibration(range=0.6 * G), "gyro": SensorCalibration(range=40.0 * DEG)},
    )
    said, text = [], recorded(tmp_path, settings)
    live(text, settings, said=said)
    assert [(f.code, f.message.split(":")[0]) for f in said] == [("saturation", "gyro"), ("saturation", "a2")]
    assert said[0].where == "t = 0 s"


def test_a_gyro_that_falls_silent_is_said(tmp_path):
    def silent(rows):
        return [row | ({"gyro [deg/s]": ""} if k >= 1250 else {}) for k, row in enumerate(rows)]

    said, settings = [], study(motion=LONG)
    live(recorded(tmp_path, settings, change=silent), settings, said=said)
    assert [finding.code for finding in said] == ["gyro_missing"]
    assert float(said[0].where.split(" ")[2]) == pytest.approx(3.5, abs=2e-3)


@pytest.mark.parametrize("killed", [False, True])
def test_innovations_that_contradict_the_model_are_said_once(killed, tmp_path):
    """A gyro of the wrong sign, or more noise than stated: also after a restart it is said no second time.

    Where the stream decides on nothing: else it is said once it has decided.
    """
    settings = study(motion=LONG, band=Band(math.inf), estimator=Estimator(snap=1e8))
    loud = replace(settings, noise=replace(settings.noise, accelerometer=0.4 * settings.noise.accelerometer))

    def turned(rows):
        return [row | {"gyro [deg/s]": repr(-float(row["gyro [deg/s]"]))} for row in rows]

    for text, of in (
        (recorded(tmp_path, settings, change=turned), settings),
        (recorded(tmp_path, settings), replace(loud, estimator=Estimator(8, snap=1e7))),
    ):
        said, saving = [], Saving(tmp_path / f"state{of.estimator.states}", 10)
        if killed:
            live(text, of, saving=saving, kill=2050, said=said)
        live(text, of, saving=saving, said=said)
        assert [finding.code for finding in said] == ["excess_scatter"]
        assert said[0].where == "t = 4 s"


def test_while_a_stream_has_not_decided_no_contradiction_is_said(tmp_path):
    settings = study(motion=LONG)
    said = []
    out = whole_lines(recorded(tmp_path, settings), replace(settings, timing=Timing(0.02)), said=said)
    fields = [line.split(",") for line in out[1:]]
    assert float(fields[-1][4]) > 2.0
    assert {each[5] for each in fields} <= {"1.0", "2.0"}
    assert said == []


def test_sound_innovations_and_spikes_are_not_said(tmp_path):
    """As the model has them, and with one spike of 0.5 g in a thousand samples."""
    for states in (8, 19):
        for spikes in (0.0, 1e-3):
            settings = study(states, LONG, disturbances=Disturbances(spikes=spikes))
            said = []
            live(recorded(tmp_path, settings, 9), settings, every=1.0, said=said)
            assert said == []


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("t [s],gyro [deg/s]", "found no accelerometer among gyro, expected t, a1, a2, a3 and gyro"),
        ("t [s],a1 [g],gyro [deg/s]", "axes are parallel, expected a2, a3 too"),
        (
            "t [s],a1 [count],a2 [g],a3 [g]",
            r"a1 is in count, expected a scale under \[sensors.a1\] of the study",
        ),
        ("a1 [g],a2 [g],a3 [g]", "expected"),
    ],
)
def test_columns_that_do_not_do_are_one_sentence(header, words):
    row = ",".join("0" * len(header.split(",")))
    with pytest.raises(InputError, match=words):
        live(f"{header}\n{row}\n{row}\n", study())


def test_time_that_stays_behind_is_refused(tmp_path):
    settings = study(motion=LONG)
    header, *rows = recorded(tmp_path, settings).splitlines(keepends=True)
    with pytest.raises(RecordError, match=r"log: t: 1000 rows in a row are not later than 1\.998 s"):
        live("".join([header, *rows[:1000], *rows]), settings)


def test_the_truth_is_within_the_uncertainty(tmp_path):
    """Errors over u after the first second: rms between 0.1 and 2, for the sensors' errors are drawn once."""
    settings = study(motion=LONG)
    out = live(recorded(tmp_path, settings, 10), settings)
    truth = np.genfromtxt(tmp_path / "log.csv", delimiter=",", names=True)["theta_ref_deg"]
    theta, u = np.genfromtxt(out[1:], delimiter=",")[:, 1:3].T
    ratio = ((theta - truth) / u)[500:]
    assert 0.1 < math.sqrt(np.mean(ratio**2)) < 2.0
