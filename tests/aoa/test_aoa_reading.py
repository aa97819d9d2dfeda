"""Records in: units, calibration, saturation, clocks, and the four formats of a tunnel's data system."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat
from sting_study import BASE, DEG, G, study

from inercal.foundation.errors import RecordError
from inercal.foundation.geometry.rotations import principal
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.read import read
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from inercal.systems.aoa.reading.from_record import of_sensors, recording_of
from inercal.systems.aoa.settings import SensorCalibration
from inercal.systems.aoa.simulate import simulate

SHORT = study(motion=replace(BASE, duration=2.0))
TRUE = simulate(SHORT, np.random.default_rng(1)).recording
T = TRUE.t
SOURCE = Source("run.csv", "")
#: channel -> unit, values in it
CHANNELS = {
    **{f"a{k + 1}": ("g", TRUE.acc[:, k] / G) for k in range(3)},
    "gyro": ("deg/s", TRUE.gyro / DEG),
    "theta_ref": ("deg", TRUE.reference / DEG),
    "point": ("1", np.repeat([1.0, 2.0], 1000)),
    "trigger": ("1", (np.arange(2000) % 100 == 0).astype(float)),
}


def record(t=T, clocks=None, **changes):
    """The record with other columns (None: without), each (unit, values), or values alone in the usual unit."""
    columns, clocks = {}, clocks or {}
    for name, usual in (CHANNELS | changes).items():
        if usual is None:
            continue
        unit, values = usual if isinstance(usual, tuple) else (CHANNELS[name][0], usual)
        at = clocks.get(name, t)
        columns[name] = Column(name, parse_unit(unit), np.array(values, dtype=float), at, SOURCE)
    return Record(columns, (), (SOURCE,))


def changed(name, **of):
    """The study with a calibration."""
    return replace(SHORT, sensors={name: SensorCalibration(**of)})


def codes(recording):
    return [finding.code for finding in recording.findings]


def the(recording, code):
    (found,) = [finding for finding in recording.findings if finding.code == code]
    return found


def test_si_and_what_is_handed_on():
    found = recording_of(record(), SHORT)
    np.testing.assert_allclose(found.acc, TRUE.acc, rtol=1e-12)
    np.testing.assert_allclose(found.gyro, TRUE.gyro, rtol=1e-12)
    np.testing.assert_allclose(found.reference, TRUE.reference, rtol=1e-12)
    np.testing.assert_array_equal(found.point, CHANNELS["point"][1])
    np.testing.assert_array_equal(found.trigger, CHANNELS["trigger"][1])
    assert found.findings == ()
    assert not found.masked.any()
    assert not found.spatial
    assert np.isnan(np.hstack([found.turns, found.zero_angle])).all()


def test_four_formats_are_one_recording(tmp_path):
    titles = [f"{name} [{unit}]" if unit != "1" else name for name, (unit, _) in CHANNELS.items()]
    table = np.column_stack([T, *(values for _, values in CHANNELS.values())])
    csv = tmp_path / "run.csv"
    np.savetxt(csv, table, fmt="%.17g", delimiter=",", header=",".join(["t [s]", *titles]), comments="")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for name, (unit, values) in {"t": ("s", T), **CHANNELS}.items():
            file.create_dataset(name, data=values).attrs["units"] = unit
    with TdmsWriter(tmp_path / "run.tdms") as file:
        about = {"wf_increment": 1e-3, "wf_start_offset": 0.0}
        file.write_segment(
            [
                ChannelObject("Model", name, values, {"unit_string": unit, **about})
                for name, (unit, values) in CHANNELS.items()
            ]
        )
    savemat(tmp_path / "run.mat", {"t": T, **{name: values for name, (_, values) in CHANNELS.items()}})
    columns = {"t": ("s", T), **CHANNELS}
    (tmp_path / "map.toml").write_text(
        "".join(
            f'[columns.{name}]\nfrom = "{name}"\nunit = "{unit}"\n' for name, (unit, _) in columns.items()
        )
    )
    expected = recording_of(read(csv), SHORT)
    np.testing.assert_allclose(expected.acc, TRUE.acc, rtol=1e-12)
    for name, of in (("run.h5", None), ("run.tdms", None), ("run.mat", "map.toml")):
        found = recording_of(read(tmp_path / name, of and tmp_path / of), SHORT)
        for key in ("acc", "gyro", "reference", "point", "trigger"):
            np.testing.assert_array_equal(getattr(found, key), getattr(expected, key))
        np.testing.assert_allclose(found.t, expected.t, atol=1e-12)
        assert found.findings == ()


def test_calibration_from_volts_and_temperature():
    # what it measures is (indication x scale (1 + slope dT) - bias - slope dT), as the study says
    warm = np.linspace(20.0, 30.0, len(T))
    scale, bias = 2.0 * (1.0 + 1e-3 * (warm - 20.0)), 0.1 + 0.01 * (warm - 20.0)
    volts = (TRUE.acc[:, 1] + bias) / scale
    how = changed("a2", scale=2.0, bias=0.1, scale_slope=1e-3, bias_slope=0.01, temperature=20.0, per="V")
    found = recording_of(record(a2=("mV", 1e3 * volts), temperature=("degC", warm)), how)
    np.testing.assert_allclose(found.acc, TRUE.acc, atol=1e-12)
    assert the(recording_of(record(a2=("V", volts)), how), "not_stated").message.startswith(
        "a2: its temperature"
    )
    with pytest.raises(RecordError, match="a2 is in V, expected a scale under"):
        recording_of(record(a2=("V", volts)), SHORT)


def test_saturated_samples_are_masked_and_counted():
    limit = 0.5 * G
    clipped = np.clip(TRUE.acc[:, 1], -limit, limit)
    flat = clipped >= limit
    assert 100 < flat.sum() < 1500
    for settings in (SHORT, changed("a2", range=limit)):
        found = recording_of(record(a2=clipped / G), settings)
        finding = the(found, "saturation")
        assert finding.message.startswith(f"a2: {flat.sum()} samples ")
        assert finding.where.startswith("rows ")
        np.testing.assert_array_equal(np.isnan(found.acc[:, 1]), flat)
        np.testing.assert_array_equal(found.masked[:, 1], flat)
        assert not found.masked[:, [0, 2, 3]].any()


def test_single_samples_at_the_end_of_a_range_are_lost_too():
    """Noise takes samples beyond the range in ones and twos, beside the runs that show where it ends."""
    limit = 0.5
    noisy = TRUE.acc[:, 1] / G + 0.05 * np.random.default_rng(2).standard_normal(len(T))
    beyond = noisy > limit
    alone = beyond[1:-1] & ~beyond[:-2] & ~beyond[2:]
    assert alone.sum() > 10
    found = recording_of(record(a2=np.minimum(noisy, limit)), SHORT)
    np.testing.assert_array_equal(found.masked[:, 1], beyond)


def test_missing_sensors():
    found = recording_of(record(gyro=None), SHORT)
    assert codes(found) == ["gyro_missing"]
    assert np.isnan(found.gyro).all()
    found = recording_of(record(a1=None), SHORT)
    assert codes(found) == ["nan"]
    np.testing.assert_array_equal(np.isfinite(found.acc).all(axis=0), [False, True, True])
    dead = recording_of(record(a1=np.full(len(T), 0.3)), SHORT)
    assert the(dead, "dead_channel").message.startswith("a1 never changes")
    assert np.isnan(dead.acc[:, 0]).all()
    with pytest.raises(RecordError, match=r"a1, a3 alone .* whose axes are parallel, expected a2 too"):
        recording_of(record(a2=None), SHORT)
    with pytest.raises(RecordError, match="found no accelerometer among gyro"):
        recording_of(record(a1=None, a2=None, a3=None), SHORT)
    found = recording_of(record(gyro_roll=("deg/s", np.sin(T))), SHORT)
    assert the(found, "gyro_missing").message.startswith("gyro_roll is of no use without gyro_yaw")
    found = recording_of(record(gyro_roll=("deg/s", np.sin(T)), gyro_yaw=("deg/s", np.cos(T))), SHORT)
    assert found.spatial
    np.testing.assert_allclose(found.turns, DEG * np.column_stack([np.sin(T), np.cos(T)]), rtol=1e-12)
    assert the(recording_of(record(a4=("g", np.cos(T))), SHORT), "not_stated").message.startswith(
        "a4: not under"
    )


def test_a_calibration_that_ended_badly_is_named_in_files_and_streams():
    """Its numbers are used: whether they are good enough is for the user to say."""
    settings = study(sensors={"a2": SensorCalibration(caution="a2.json ended inconsistent: why")})
    assert (
        the(recording_of(record(), settings), "bad_verdict").message == "a2: a2.json ended inconsistent: why"
    )
    told = of_sensors(["a1", "a3"], ["gyro"], record(), settings)
    assert all(finding.code != "bad_verdict" for finding in told)  # of a sensor that is not there, nothing
    rolling = study(sensors={"gyro_roll": SensorCalibration(caution="roll.json ended inconsistent: why")})
    for gyros, count in (
        (["gyro", "gyro_roll"], 0),
        (["gyro", "gyro_roll", "gyro_yaw"], 1),
    ):  # used with yaw alone
        told = of_sensors(["a1", "a2", "a3"], gyros, record(), rolling)
        assert [finding.code for finding in told].count("bad_verdict") == count


def test_a_sensor_that_sticks_for_a_while():
    stuck = TRUE.acc[:, 0].copy() / G
    stuck[500:800] = stuck[500]
    found = recording_of(record(a1=stuck), SHORT)
    assert the(found, "dead_channel").where == "rows 501-800"
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.acc[:, 0])), np.arange(500, 800))


def test_time_that_does_not_go_on():
    t = T.copy()
    t[700:705] -= 0.1
    t[900] = t[899]
    found = recording_of(record(t=t), SHORT)
    finding = the(found, "backward_time")
    assert finding.message == "t: 6 rows not later than those before, left out"
    assert finding.where == "rows 701-705, 901"
    t = T.copy()
    t[300] = np.nan
    assert the(recording_of(record(t=t), SHORT), "nan").where == "row 301"
    t = T.copy()
    t[800:] -= 5.0
    with pytest.raises(RecordError, match="rows in a row from row 801 on are not later"):
        recording_of(record(t=t), SHORT)
    few = {name: (unit, values[:19]) for name, (unit, values) in CHANNELS.items()}
    with pytest.raises(RecordError, match="found 19 rows that go on in time, expected 20 or more"):
        recording_of(record(t=T[:19], **few), SHORT)


def test_a_gyro_on_a_clock_of_its_own():
    # linear interpolation of a rate of 1 Hz from samples 1 ms apart errs by (2 pi 1e-3)^2 / 8 = 5e-6 of it
    late = T + 0.4e-3
    gyro, ref = (np.sin(2.0 * np.pi * at) for at in (late, T[::20]))
    clocks = {"gyro": late, "theta_ref": T[::20]}
    found = recording_of(record(gyro=gyro, theta_ref=ref, clocks=clocks), SHORT)
    assert codes(found) == ["other_clock", "other_clock"]
    np.testing.assert_allclose(found.gyro[1:] / DEG, np.sin(2.0 * np.pi * T[1:]), atol=1e-5)
    assert np.isnan(found.gyro[0])
    slow = recording_of(record(gyro=np.sin(2.0 * np.pi * T[::20]), clocks={"gyro": T[::20]}), SHORT)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(slow.gyro)), np.arange(0, 2000, 20))


def test_accelerometers_on_clocks_of_their_own():
    """Rows are those of the fastest; a slower one has values at the rows nearest to its samples, each once."""
    late, third = T + 0.4e-3, T[::3]
    found = recording_of(
        record(
            a2=np.sin(2.0 * np.pi * third), a3=np.cos(2.0 * np.pi * late), clocks={"a2": third, "a3": late}
        ),
        SHORT,
    )
    np.testing.assert_array_equal(found.t, T)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(found.acc[:, 1])), np.arange(0, 2000, 3))
    np.testing.assert_allclose(found.acc[::3, 1] / G, np.sin(2.0 * np.pi * third), atol=1e-12)
    np.testing.assert_allclose(found.acc[1:, 2] / G, np.cos(2.0 * np.pi * T[1:]), atol=1e-5)
    assert codes(found).count("other_clock") == 2


@pytest.mark.parametrize("every", [1, 3])
def test_a_reference_that_jumps_by_a_turn_goes_on_over_it(every):
    """180 deg + 5 deg sin 2 pi t, recorded within +-180 deg: between two samples about the jump there is no 0 deg."""
    at = T[::every]
    true = np.pi + 5.0 * DEG * np.sin(2.0 * np.pi * T)
    ref = principal(true[::every]) / DEG
    assert np.ptp(ref) > 350.0
    clocks = {"theta_ref": at} if every > 1 else {}
    found = recording_of(record(theta_ref=ref, clocks=clocks), SHORT)
    told = np.isfinite(found.reference)
    assert told.sum() > 600
    off = (found.reference - true)[told]
    np.testing.assert_allclose(off, off[0], atol=1e-6)
    assert abs(principal(off[0])) < 1e-6
