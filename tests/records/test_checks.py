"""Checks say what is wrong with a recording, and nothing of ordinary motion, noise and quantisation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.inputs import Source
from inercal.foundation.records.checks import check
from inercal.foundation.records.checks.values import at_ends, outliers, saturation, time_axis, time_unit
from inercal.foundation.records.column import Column
from inercal.foundation.records.places import places
from inercal.foundation.units import parse_unit
from rows import for_each


def noise(count, seed=7):
    return np.random.default_rng(seed).standard_normal(count)


def column(name, values, unit, t=None):
    t = np.arange(len(values)) / 100 if t is None else t
    return Column(name, parse_unit(unit), np.asarray(values, float), t, Source("a.csv", ""))


def columns(unit, t=None, **values):
    n = len(next(iter(values.values())))
    t = np.arange(n) / 100 if t is None else t
    return {name: column(name, array, unit, t) for name, array in values.items()}


def said(findings):
    return [(finding.code, finding.where) for finding in findings]


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ([], ""),
        ([17], "row 17"),
        ([1, 2, 3], "rows 1-3"),
        ([1, 2, 5], "rows 1-2, 5"),
        ([1, 3, 5, 7, 8, 10], "rows 1, 3, 5 and 2 more"),
    ],
)
def test_places_are_ranges(numbers, text):
    assert places("row", numbers) == text


class TestTime:
    T = np.arange(3000) / 100

    def test_even_jittered_and_coarse_stamps_are_fine(self):
        jitter = np.clip(0.001 * noise(3000), -0.002, 0.002)
        for t in (self.T, self.T + jitter, np.round(np.arange(3000) / 222, 3), self.T + 1.7e9, self.T[:5]):
            assert time_axis(t) == []

    def test_lost_samples_are_a_gap(self):
        t = np.delete(self.T, [500, 900, 901, 902])
        (finding,) = time_axis(t)
        assert (finding.code, finding.where) == ("gap", "rows 500-501, 899-900")
        assert finding.message == "t: 2 gaps, the longest 0.04 s"

    def test_rows_without_a_stamp_are_no_gap(self):
        t = self.T.copy()
        t[500:510] = np.nan
        assert time_axis(t) == []

    def test_repeated_and_backward_stamps_are_told_apart(self):
        t = self.T.copy()
        t[700] = t[699]
        t[800:] -= 2.0
        found = said(time_axis(t))
        assert ("duplicate_time", "row 701") in found
        assert ("backward_time", "row 801") in found

    def test_a_change_of_rate_is_no_row_of_gaps(self):
        t = np.cumsum(np.r_[np.full(1500, 0.01), np.full(1500, 0.02)])
        (finding,) = time_axis(t)
        assert finding.code == "rate_change"
        assert "100 Hz to 50 Hz" in finding.message
        assert time_axis(np.cumsum(np.r_[np.full(1500, 0.01), np.full(1500, 0.0101)])) == []
        assert (
            time_axis(np.cumsum(np.r_[np.full(1500, 0.01), np.full(1500, 0.0103)]))[0].code == "rate_change"
        )

    @pytest.mark.parametrize(
        ("interval", "looks"), [(10.0, "ms"), (5e3, "us"), (1e7, "ns"), (1e-5, "s taken for a smaller unit")]
    )
    def test_implausible_intervals_name_the_likely_unit(self, interval, looks):
        (finding,) = time_unit(np.arange(1000) * interval)
        assert finding.code == "unit_suspect"
        assert looks in finding.message

    def test_plausible_intervals_and_dwell_rows_are_fine(self):
        for interval in (5e-4, 0.01, 1.0):
            assert time_unit(np.arange(1000) * interval) == []
        t = np.arange(1296) * 60.0
        assert check(columns("deg", t, phi1=np.arange(1296) % 360)) == ()

    def test_each_clock_is_named(self):
        slow, fast = np.delete(self.T, 500), self.T
        both = {
            "acc_x": column("acc_x", noise(2999), "g", slow),
            "gyro_x": column("gyro_x", noise(3000), "deg/s", fast),
        }
        assert check(both)[0].message.startswith("t of a.csv: 1 gap")


def pieces(steps):
    """Samples built of stretches of equal steps, NaN where they overflow."""

    def added(found):
        with np.errstate(all="ignore"):
            sums = np.cumsum(np.concatenate([np.full(count, step) for step, count in found]))
        return np.where(np.isfinite(sums), sums, np.nan)

    stretch = st.tuples(st.sampled_from(steps), st.integers(1, 400))
    return st.lists(stretch, min_size=1, max_size=6).map(added)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    t=pieces([0.01, 0.02, 0.0, -0.01, 1e-9, 1e300, 1e3]),
    acc=pieces([0.0, 1.0, -1.0, 1e-12, 1e308, -1e308]),
    lost=st.sets(st.integers(0, 500)),
)
def test_the_strangest_recordings_raise_nothing(t, acc, lost):
    size = min(len(t), len(acc))
    t, acc = t[:size], acc[:size]
    t[[index for index in lost if index < size]] = np.nan
    for unit in ("g", "m/s^2"):
        check(columns(unit, t, acc_x=acc, acc_y=acc[::-1], acc_z=np.roll(acc, 3)))
    check(columns("rad/s", t, gyro_x=acc))


class TestSaturation:
    THETA = np.linspace(0, 60, 6000)

    def test_motion_cut_off_at_the_range_is_said(self):
        motion = 300 * np.sin(self.THETA) + noise(6000)
        (finding,) = saturation(np.clip(motion, -250, 250), "gyro_x")
        assert finding.code == "saturation"
        assert "-250 and 250" in finding.message
        (finding,) = saturation(np.clip(np.round(motion * 100), None, 25000), "gyro_x")
        assert "at 25000" in finding.message

    def test_rest_before_the_motion_does_not_hide_it(self):
        rest = np.round(2 * noise(20_000))
        motion = np.clip(np.round(40_000 * np.sin(self.THETA)), -32768, 32767)
        assert len(saturation(np.r_[rest, motion, rest], "gyro_x")) == 1

    @for_each(
        "signal",
        [
            np.zeros(1000),
            np.round(noise(1_000_000) * 0.4),
            np.round(noise(100_000) * 2),
            np.round(1000 * np.sin(np.linspace(0, 10, 50_000))),
            np.round(1000 * np.sin(np.linspace(0, 10, 50_000)) + noise(50_000)),
            np.sin(np.linspace(0, 300, 50_000)),
            np.repeat([9.8, 0.0, -9.8, 0.1, 9.8, 0.2], 100),
            np.repeat(noise(1000), 4),
            np.repeat([0.0, 1.0, 0.0, 1.0, 0.0, 2.0, 0.0], 300),
            np.interp(np.arange(900), [0, 300, 310, 590, 600, 900], [0, 0, 1.0, 1.0, 0, 0]),
            np.array([1.0, np.nan, 1.0]),
            np.full(100, np.nan),
        ],
    )
    def test_quiet_slow_smooth_and_held_signals_are_fine(self, signal):
        assert saturation(signal, "gyro_x") == []


class TestOutliers:
    def test_single_samples_far_off_are_said(self):
        signal = noise(5000)
        signal[[100, 110, 3000]] += [60.0, -70.0, 80.0]
        (finding,) = outliers(signal, "acc_x")
        assert (finding.code, finding.where) == ("outlier", "rows 101, 111, 3001")

    def test_a_wrong_bit_in_a_resting_converter_is_said(self):
        signal = np.full(1000, 512.0)
        signal[500] += 256
        signal[::7] += 1
        assert said(outliers(signal, "acc_x")) == [("outlier", "row 501")]

    @for_each(
        "signal",
        [
            noise(1_000_000),
            np.round(noise(300_000) * 0.3),
            np.cumsum(noise(10_000)),
            np.r_[noise(50_000), 300 * np.sin(np.linspace(0, 200, 5000)), noise(500)],
            np.r_[noise(50_000), 300 * noise(2000), noise(500)],
            np.repeat([0.0, 1.0, 0.0, 5.0], 500),
            np.zeros(1000),
            np.full(100, np.nan),
            np.arange(10.0),
        ],
    )
    def test_noise_motion_and_steps_are_fine(self, signal):
        assert outliers(signal, "acc_x") == []

    def test_a_stop_within_a_sample_is_no_knock(self):
        """A rate that dips towards zero between two turns; beyond zero, or faster than both, it is a knock."""
        signal = 0.02 + 1e-6 * np.random.default_rng(4).standard_normal(2000)
        signal[[300, 600]] = 0.01, 0.001
        assert outliers(signal, "gyro_x") == outliers(-signal, "wc_y") == []
        assert said(outliers(signal, "acc_x")) == [("outlier", "rows 301, 601")]
        signal[900], signal[1200] = -0.001, 0.03
        assert said(outliers(signal, "gyro_x")) == [("outlier", "rows 901, 1201")]


class TestUnits:
    N = 1000

    def triad(self, norm, unit):
        return columns(unit, **{f"acc_{axis}": norm / np.sqrt(3) + 1e-3 * noise(self.N) for axis in "xyz"})

    @pytest.mark.parametrize(
        ("norm", "unit", "looks"), [(1.0, "m/s^2", "g"), (1000.0, "m/s^2", "mg"), (9.8, "g", "m/s^2")]
    )
    def test_gravity_in_another_unit_is_said(self, norm, unit, looks):
        (finding,) = check(self.triad(norm, unit))
        assert finding.code == "unit_suspect"
        assert finding.headline.endswith(f"{unit} looks like {looks}.")

    @pytest.mark.parametrize(
        ("norm", "unit"), [(9.7, "m/s^2"), (1.02, "g"), (990.0, "mg"), (16384.0, "count"), (50.0, "g")]
    )
    def test_gravity_in_its_unit_counts_and_heavy_loads_are_fine(self, norm, unit):
        assert check(self.triad(norm, unit)) == ()

    @pytest.mark.parametrize(
        ("unit", "largest", "looks"),
        [("deg/s", 129305.0, "mdeg/s"), ("mdeg/s", 1e8, "a smaller unit"), ("rpm", 2000.0, "a smaller unit")],
    )
    def test_rates_beyond_16_turns_a_second_are_said_in_any_unit(self, unit, largest, looks):
        """100 rad/s is 5730 deg/s; gyros of up to 4000 deg/s are made."""
        motion = np.sin(np.arange(self.N) / 50)
        (finding,) = check(columns(unit, gyro_y=largest * motion))
        assert finding.code == "unit_suspect"
        assert finding.headline.endswith(f"{unit} look like {looks}.")
        (factor,) = {column.unit.factor for column in columns(unit, gyro_y=motion).values()}
        assert check(columns(unit, gyro_y=np.deg2rad(4000.0) / factor * motion)) == ()

    @pytest.mark.parametrize(("unit", "wrong"), [("degC", 2345.0), ("K", 23.0), ("degF", -400.0)])
    def test_temperatures_no_instrument_stands_are_said(self, unit, wrong):
        (finding,) = check(columns(unit, temperature=wrong + 0.1 * noise(self.N)))
        assert finding.code == "unit_suspect"
        room = {"degC": 23.0, "K": 296.0, "degF": 73.0}[unit]
        assert check(columns(unit, temperature=room + 0.1 * noise(self.N))) == ()

    def test_a_dead_axis_is_said_and_tells_no_unit(self):
        """Without the vertical axis the norm, 0.1 m/s^2, is no gravity in any unit."""
        found = self.triad(9.8, "m/s^2")
        dead = columns(
            "m/s^2", acc_x=0.1 + 1e-3 * noise(self.N), acc_y=1e-3 * noise(self.N), acc_z=noise(self.N) * 0
        )
        (finding,) = check(dead)
        assert (finding.code, finding.message.split(":")[0]) == ("dead_channel", "acc_z")
        assert "all 1000 samples are 0" in finding.message
        assert check(found) == ()

    def test_rates_no_gyro_has_are_said(self):
        fast = 300 * np.sin(np.arange(self.N) / 50)
        (finding,) = check(columns("rad/s", gyro_x=fast))
        assert finding.code == "unit_suspect"
        assert check(columns("deg/s", gyro_x=fast)) == ()
        assert check(columns("rad/s", gyro_x=fast / 60)) == ()


def test_single_samples_at_a_level_where_a_signal_is_clipped_elsewhere_are_clipped_too():
    """A slow swing rests at the end of the range for long, a fast one for a sample."""
    rng = np.random.default_rng(20261126)
    t = np.arange(4000) / 100.0
    free = 2.5 * np.sin(2.0 * np.pi * 0.3 * t) * (t < 20.0) + 2.02 * np.sin(2.0 * np.pi * 5.0 * t) * (
        t >= 20.0
    )
    free += 0.01 * rng.standard_normal(len(t))
    clipped = np.clip(free, -2.0, 2.0)
    beyond = np.abs(free) >= 2.0
    assert beyond[t >= 20.0].any()
    assert np.array_equal(at_ends(clipped), beyond)
    assert not at_ends(free).any()
