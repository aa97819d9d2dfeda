"""Noise of a record: the right channels, in SI, with what is known of each coefficient, and only at rest."""

from dataclasses import replace

import numpy as np
import pytest

from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.instruments.noise import SYMBOLS, NoiseModel
from inercal.foundation.noise.outcome import noise_of, unrest
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.results.files import load, save
from inercal.foundation.units import STANDARD_GRAVITY, parse_unit

RATE = 100.0
SOURCE = Source("static.csv", "0" * 64)


def column(name, unit, values, t=None, rate=RATE):
    stamps = np.arange(len(values)) / rate if t is None else t
    return Column(name, parse_unit(unit), np.asarray(values, float), stamps, SOURCE)


def record(*columns):
    """A record of columns; those of one length share a clock."""
    clocks = {}
    shared = [Column(c.name, c.unit, c.values, clocks.setdefault(len(c.t), c.t), c.source) for c in columns]
    return Record({c.name: c for c in shared}, sources=(SOURCE,))


def white(n, seed, N=1.0):
    return NoiseModel(N=N).simulate(n, 1.0 / RATE, np.random.default_rng(seed))[:, 0]


def codes(estimate):
    return [finding.code for finding in estimate.findings]


# Rows that are no samples.


def test_values_that_stand_for_several_rows_count_once():
    """N is of the true rate; of the rows it would be 6 % low here."""
    N = 0.02
    values = NoiseModel(N=N).simulate(4000, 7.0 / RATE, np.random.default_rng(4))[:, 0]
    result = noise_of(record(column("gyro_x", "rad/s", np.repeat(values, 7))))
    assert "held_samples" in codes(result.estimate)
    assert abs(result.estimate["N_gyro_x"].value - N) < 4.0 * result.estimate["N_gyro_x"].u
    assert result.channels[0].curve.interval == pytest.approx(7.0 / RATE)


def test_an_erased_tail_and_rows_of_another_packet_are_left_out():
    x = 0.1 * white(4000, 5)
    plain = noise_of(record(column("gyro_x", "rad/s", x))).estimate
    erased = noise_of(record(column("gyro_x", "rad/s", np.append(x, np.zeros(400))))).estimate
    assert erased["N_gyro_x"].value == plain["N_gyro_x"].value
    t = np.arange(4000) / RATE
    both = np.concatenate([t, t[::2] + 0.3 / RATE])
    order = np.argsort(both)
    mixed = column("gyro_x", "rad/s", np.append(x, np.full(2000, np.nan))[order], both[order])
    assert noise_of(record(mixed)).estimate["N_gyro_x"].value == pytest.approx(
        plain["N_gyro_x"].value, rel=1e-9
    )


@pytest.mark.parametrize("noise", [0.3, 2.0])
def test_a_noise_below_the_steps_of_the_output_is_suspect(noise):
    values = 0.01 * np.rint(0.4 + noise * np.random.default_rng(6).standard_normal(3000))
    estimate = noise_of(record(column("gyro_x", "rad/s", values))).estimate
    assert ("coarse_output" in codes(estimate)) == (noise < 1.0)
    assert (estimate.status is Status.SUSPECT) == (noise < 1.0)


# Numbers.


def test_white_noise_of_a_gyro_and_an_accelerometer_in_si():
    """0.1 deg/s/sqrt(Hz) is an angle random walk of 0.1 deg/sqrt(s); 1 mg/sqrt(Hz) a velocity random walk."""
    found = noise_of(
        record(
            column("gyro_x", "deg/s", 3.0 + 0.1 * white(20000, 1)),
            column("acc_z", "mg", 1000.0 + white(20000, 2)),
        )
    ).estimate
    assert found.status is Status.OK
    for name, unit, truth in (
        ("N_gyro_x", "rad/sqrt(s)", np.radians(0.1)),
        ("N_acc_z", "m/s/sqrt(s)", 1e-3 * STANDARD_GRAVITY),
    ):
        p = found[name]
        assert p.unit == unit
        assert abs(p.value - truth) < 4.0 * p.u
        assert p.u < 0.03 * truth
    assert found.result["channels"]["gyro_x"]["unit"] == "rad/s"
    assert found.result["channels"]["acc_z"]["unit"] == "m/s^2"


def test_the_curve_is_the_overlapping_allan_deviation():
    """Against the definition, in as many words: half the mean square of differences of adjacent means."""
    x = 0.1 * white(3000, 3)
    channel = noise_of(record(column("gyro_y", "deg/s", x))).channels[0]
    for m in (1, 10, 100):
        at = int(np.argmin(np.abs(channel.curve.tau - m / RATE)))
        assert channel.curve.tau[at] == pytest.approx(m / RATE)
        means = np.convolve(np.radians(x), np.full(m, 1.0 / m), "valid")
        expected = np.sqrt(0.5 * np.mean((means[m:] - means[:-m]) ** 2))
        assert channel.deviation[at] == pytest.approx(expected, rel=1e-9)
        assert channel.limits[0][at] < expected < channel.limits[1][at]


def test_every_channel_has_all_five_and_says_which_are_not_seen():
    found = noise_of(
        record(column("gyro_x", "rad/s", white(20000, 4)), column("a1", "count", white(20000, 5)))
    )
    estimate = found.estimate
    assert estimate.names == tuple(f"{symbol}_{name}" for name in ("gyro_x", "a1") for symbol in SYMBOLS)
    assert estimate.units == (
        *("rad/sqrt(s)", "rad/s", "rad/s/sqrt(s)", "rad/s^2", "rad"),
        *("count*sqrt(s)", "count", "count/sqrt(s)", "count/s", "count*s"),
    )
    for channel in found.channels:
        told = estimate.result["channels"][channel.name]
        assert {*told["resolved"], *told["upper_limits"]} == set(SYMBOLS)
        assert "N" in told["resolved"]
        for symbol, limit in told["upper_limits"].items():
            p = estimate[f"{symbol}_{channel.name}"]
            assert p.value == 0.0
            assert 1.6449 * p.u == pytest.approx(limit)
        # what is not seen is small beside what is, at each averaging time at which it could be
        assert told["upper_limits"]["K"] < 1.0
    assert estimate.covariance[0, 5] == 0.0


def test_quantisation_is_seen_where_it_rules():
    """Differences of a rounded angle: 3 Q^2 / tau^2 with Q = step/sqrt(12)."""
    rng = np.random.default_rng(6)
    step = 1e-5
    angle = np.cumsum(1.618e-5 + 3e-6 * rng.normal(size=20001))
    rate = np.diff(step * np.rint(angle / step)) * RATE
    p = noise_of(record(column("gyro_x", "rad/s", rate))).estimate["Q_gyro_x"]
    assert p.unit == "rad"
    assert p.value == pytest.approx(step / np.sqrt(12.0), rel=0.05)


def test_the_fit_is_that_of_a_recording_with_gaps():
    """Of quantisation 2 % of lost samples leave far more than without: fit and curve agree, and N is the true one."""
    rng = np.random.default_rng(20261121)
    model = NoiseModel(N=3e-4, Q=2e-4)
    x = model.simulate(40000, 1.0 / RATE, rng)[:, 0]
    kept = rng.random(len(x)) >= 0.02
    t = np.arange(len(x)) / RATE
    found = noise_of(record(column("gyro_x", "rad/s", x[kept], t[kept])))
    (channel,) = found.channels
    used = channel.curve.tau < 20.0  # of 20 means and more
    assert np.all(
        np.abs(channel.deviation / channel.fitted - 1.0)[used] < 4.5 / np.sqrt(2 * channel.curve.dof[used, 0])
    )
    without = np.sqrt(channel.fit.variance(channel.curve.tau))
    assert np.max(channel.fitted / without) > 1.2
    for name, truth in (("N_gyro_x", model.N), ("Q_gyro_x", model.Q)):
        assert abs(found.estimate[name].value - truth) < 4.5 * found.estimate[name].u


# Channels.


def test_angles_temperature_and_commands_are_left_out():
    x = white(2000, 7)
    others = [
        ("phi1", "deg"),
        ("temperature", "degC"),
        ("wc_x", "deg/s"),
        ("th_x", "deg"),
        ("trigger", "count"),
    ]
    wanted = [("acc_x", "g"), ("gyro", "deg/s"), ("gyro_roll", "deg/s"), ("a12", "V"), ("y_x", "deg/h")]
    found = noise_of(record(*(column(name, unit, x) for name, unit in (*others, *wanted))))
    assert [channel.name for channel in found.channels] == [name for name, _ in wanted]


def test_clocks_keep_their_own_averaging_times():
    found = noise_of(
        record(column("acc_x", "g", white(4000, 8)), column("gyro_x", "deg/s", white(1000, 9), rate=25.0))
    )
    fast, slow = found.channels
    assert fast.curve.tau[0] == pytest.approx(0.01)
    assert slow.curve.tau[0] == pytest.approx(0.04)
    assert found.estimate.statistics["rate_hz"] == pytest.approx(RATE)


def test_gaps_and_lost_samples_leave_the_coefficient():
    """Two seconds missing from the time axis, and one sample in fifty not a number."""
    rng = np.random.default_rng(10)
    x = white(20000, 11)
    x[rng.random(20000) < 0.02] = np.nan
    kept = np.r_[0:6000, 6200:20000]
    t = np.arange(20000)[kept] / RATE
    found = noise_of(record(column("gyro_x", "rad/s", x[kept], t=t)))
    p = found.estimate["N_gyro_x"]
    assert found.estimate.status is Status.OK
    assert abs(p.value - 1.0) < 4.0 * p.u + 0.02  # overstated by the share that is missing, as is said there
    assert found.channels[0].curve.samples == 20000


def test_a_few_rows_that_are_repeated_or_without_a_stamp_do_no_harm():
    x = white(5000, 23)
    order = np.r_[0:3000, 2980:5000]
    t = order / RATE
    t[1000] = np.nan
    found = noise_of(record(column("acc_x", "g", x[order], t=t)))
    expected = noise_of(record(column("acc_x", "g", np.where(np.arange(5000) == 1000, np.nan, x))))
    np.testing.assert_allclose(found.channels[0].deviation, expected.channels[0].deviation, rtol=1e-12)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ([column("temperature", "degC", white(100, 1))], "found temperature, expected acceleration or rate"),
        ([column("acc_x", "g", white(15, 1))], "found 15 samples of acc_x, expected at least 16"),
        ([column("acc_x", "g", 1e200 * white(100, 1))], "expected the output of a sensor"),
        ([column("acc_x", "g", np.full(100, np.nan))], "found 0 samples of acc_x"),
        ([column("acc_x", "g", white(100, 1), t=np.arange(100.0)[::-1])], "expected increasing times"),
    ],
)
def test_what_holds_no_noise_is_refused(columns, words):
    with pytest.raises(RecordError, match=words):
        noise_of(record(*columns))


def test_a_channel_that_never_changes_has_no_coefficients():
    found = noise_of(
        record(column("acc_x", "g", np.ones(500)), column("acc_y", "g", white(500, 12)))
    ).estimate
    assert [name for name in found.names if name.endswith("acc_x")] == []
    assert "N_acc_y" in found.names
    assert "acc_x: the output never changes" in next(
        f.message for f in found.findings if f.code == "resolution"
    )
    assert "resolved" not in found.result["channels"]["acc_x"]


def test_a_dead_channel_harms_no_coefficient_of_another():
    dead = replace(
        record(column("acc_x", "g", np.ones(500)), column("acc_y", "g", white(500, 12))),
        findings=(Finding("dead_channel", "acc_x: all 500 samples are 1", harm=("acc_x",)),),
    )
    found = noise_of(dead).estimate
    assert found.status is Status.OK
    assert "dead_channel" in codes(found)


@pytest.mark.parametrize("suffix", ["json", "toml"])
def test_saved_and_read_back(suffix, tmp_path):
    found = noise_of(record(column("acc_x", "g", white(500, 13)))).estimate
    save(found, tmp_path / f"noise.{suffix}")
    again = load(tmp_path / f"noise.{suffix}")
    np.testing.assert_array_equal(again.values, found.values)
    np.testing.assert_array_equal(again.covariance, found.covariance)
    assert again.result["channels"]["acc_x"]["tau"] == found.result["channels"]["acc_x"]["tau"].tolist()


# Rest.


def turned(seconds, peak, seed=14):
    """Two minutes at rest, and then a slow turn of some seconds."""
    more = int(seconds * RATE)
    x = 0.01 * white(12000 + more, seed)
    x[12000:] += peak * np.sin(np.pi * np.arange(more) / more)
    return x


@pytest.mark.parametrize(("seconds", "peak"), [(20.0, 50.0), (60.0, 30.0)], ids=["fast", "slow"])
def test_an_instrument_that_moves_is_not_at_rest(seconds, peak):
    """Also where within a second it hardly changes against the noise of 0.1 rad/s, of which a mean has 0.01."""
    x = turned(seconds, peak)
    moving = record(column("gyro_x", "rad/s", x), column("gyro_y", "rad/s", 0.01 * white(len(x), 15)))
    found = noise_of(moving).estimate
    assert found.status is Status.INCONSISTENT
    assert "not at rest (gyro_x)" in found.message
    where = [finding.where for finding in found.findings if finding.code == "not_at_rest"]
    assert len(where) == 1
    begin, _, end = where[0].removesuffix(" s from the start").partition(" s to ")
    assert float(begin) == pytest.approx(120.0, abs=2.1)
    assert float(end) == pytest.approx(120.0 + seconds, abs=2.1)
    still = noise_of(moving.between(end=119.0)).estimate
    assert still.status is Status.OK
    assert "not_at_rest" not in codes(still)
    assert abs(still["N_gyro_x"].value - 0.01) < 4.0 * still["N_gyro_x"].u


def test_a_knock_is_said_and_left_to_the_user():
    x = white(1200000, 16)
    x[10000:10020] += 400.0 * np.sin(np.arange(20.0))
    found = noise_of(record(column("acc_x", "g", x))).estimate
    assert found.status is Status.OK
    assert codes(found).count("not_at_rest") == 1
    assert found.message == "noise of 1 channel from 12000 s at rest, acc_x disturbed"


@pytest.mark.parametrize(
    "x",
    [
        white(6000, 17),
        np.cumsum(white(6000, 18)),
        np.rint(0.35 * white(6000, 19) / 10.0),
        np.where(np.arange(6000) % 50 == 0, np.nan, white(6000, 20)),
        white(40, 21),
    ],
    ids=["white", "walk", "coarse steps", "lost samples", "short"],
)
def test_noise_alone_is_no_unrest(x):
    assert unrest(x, 1.0 / RATE) is None


def test_what_unrest_does_to_the_deviation():
    """A fifth of the pieces is twenty times as loud: their means jump too, and rule the differences of means."""
    x = white(10100, 22) / 10.0
    x.reshape(100, 101)[40:60] *= 20.0
    found = unrest(x, 1.0 / RATE)
    assert found.of == 100
    assert 20 <= found.pieces <= 22  # beside a loud piece the mean jumps too
    assert (found.first, found.last) == pytest.approx((40.4, 60.6), abs=1.02)
    # mean squares: of 99 pairs 19 are of both loud, 2 of one, 78 of none
    expected = np.sqrt((19 * 400 + 2 * 200.5 + 78) / 99)
    assert found.factor == pytest.approx(expected, rel=0.5)
    assert not found.moving


def test_a_span_of_the_record():
    """Times count from the first stamp of each clock; a clock without an end in the span keeps what lies in it."""
    t = 50.0 + np.arange(1000) / RATE
    whole = record(column("acc_x", "g", np.arange(1000.0), t=t), column("gyro_x", "deg/s", np.arange(200.0)))
    part = whole.between(1.0, 3.0)
    np.testing.assert_array_equal(part["acc_x"].values, np.arange(100.0, 301.0))
    np.testing.assert_array_equal(part["gyro_x"].values, np.arange(100.0, 200.0))
    assert whole.between() is whole
    with pytest.raises(InputError, match="found 20 s to 30 s, expected a span within the record"):
        whole.between(20.0, 30.0)
    with pytest.raises(InputError, match=r"found 20 s and later, expected .* which lasts 9.99 s"):
        whole.between("20 s")


@pytest.mark.parametrize("samples", [21, pytest.param(51, marks=pytest.mark.campaign), 200])
def test_a_short_record_shows_white_noise_alone(samples):
    """100 white records: nothing but N is reported, and N is covered by its interval (at least 85 of 100: 95 less
    4.5 standard deviations)."""
    hits = 0
    for seed in range(100):
        found = noise_of(record(column("acc_x", "m/s^2", white(samples, seed))))
        assert {c.fit.names for c in found.channels if c.fit is not None} <= {("N",), ()}
        assert "few_degrees_of_freedom" in {f.code for f in found.estimate.findings}
        low, high = found.estimate["N_acc_x"].interval(0.95)
        hits += low < 1.0 < high
    assert hits >= 85
