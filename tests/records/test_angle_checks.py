"""Checks of angles: full turns, frozen encoders and shifted commands are said, ordinary motion is not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.inputs import Source
from inercal.foundation.records.checks import check
from inercal.foundation.records.column import Column
from inercal.foundation.units import parse_unit

ARCSEC = 1.0 / 3600.0


def record(t, **channels):
    """Columns of a record; angles in deg, rates in deg/s."""
    made = {}
    for name, values in channels.items():
        sensor = name.partition("_")[0]
        unit = parse_unit("deg/s" if sensor in ("wc", "gyro") else "1" if sensor == "position" else "deg")
        made[name] = Column(name, unit, np.asarray(values, float), t, Source("a.csv", ""))
    return made


def triads(t, **arrays):
    return record(
        t, **{f"{name}_{axis}": a[:, k] for name, a in arrays.items() for k, axis in enumerate("xyz")}
    )


def said(columns):
    return [(finding.code, finding.where) for finding in check(columns)]


def platform_rate(th, dt):
    """Rate [deg/s] (n, 3) of the platform inside three gimbals z, y, x, from a row to the next."""
    middle = np.radians((th[1:] + th[:-1]) / 2)
    a, b, c = np.diff(th, axis=0).T / dt
    phi, theta = middle[:, 2], middle[:, 1]
    rate = np.stack(
        [
            c - a * np.sin(theta),
            b * np.cos(phi) + a * np.cos(theta) * np.sin(phi),
            -b * np.sin(phi) + a * np.cos(theta) * np.cos(phi),
        ],
        axis=-1,
    )
    return np.vstack([rate, rate[-1:]])


def turns(dt=0.2, rate=1.0, rest=60.0):
    """Angles (n, 3) [deg] of single-axis turns with rests between them, and the commanded rates [deg/s]."""
    th, wc = [np.zeros((round(rest / dt), 3))], [np.zeros((round(rest / dt), 3))]
    for axis, angle in ((2, 180.0), (0, 90.0), (2, -180.0), (0, 90.0), (1, 45.0)):
        steps = round(abs(angle) / rate / dt)
        unit = np.eye(3)[axis] * np.sign(angle)
        th.append(th[-1][-1] + unit * rate * dt * np.arange(1, steps + 1)[:, None])
        wc.append(np.tile(unit * rate, (steps, 1)))
        th.append(np.tile(th[-1][-1], (round(rest / dt), 1)))
        wc.append(np.zeros((round(rest / dt), 3)))
    th, wc = np.vstack(th), np.vstack(wc)
    return dt * np.arange(len(th)), th, np.roll(wc, -1, axis=0)


def noisy(th, seed=5, size=2 * ARCSEC):
    return th + size * np.random.default_rng(seed).standard_normal(th.shape)


class TestFullTurns:
    T = 0.01 * np.arange(20_000)

    def test_a_turning_table_read_modulo_a_turn(self):
        """10 deg/s: full turns after 36 s, 72 s, ...; half turns, where an angle to +-180 deg jumps, between."""
        angle = 10.0 * self.T + 0.01
        columns = record(self.T, phi1=angle % 360.0, th_x=(angle + 180.0) % 360.0 - 180.0, phi2=angle)
        assert said(columns) == [
            ("wrap_2pi", "rows 3601, 7201, 10801 and 2 more"),
            ("wrap_2pi", "rows 1801, 5401, 9001 and 3 more"),
        ]

    def test_a_rest_beside_zero(self):
        """Encoder noise about 0 is read as 359.999 every other time."""
        angle = noisy(np.zeros(len(self.T)))[:200] % 360.0
        (finding,) = check(record(self.T[:200], theta_ref=angle))
        assert finding.code == "wrap_2pi"

    def test_fast_turns(self):
        angle = np.arange(2000) * 3.6
        assert said(record(self.T[:2000], phi1=angle % 360.0))[0][0] == "wrap_2pi"

    @pytest.mark.parametrize(
        "angle",
        [
            np.repeat(np.arange(40) * 90.0 % 360.0, 500),
            np.repeat(np.tile(np.arange(0.0, 360.0, 10.0), 3), 150),
            np.repeat([0.0, 350.0, 20.0, 340.0], 4000),
            180.0 * np.sin(T / 3.0),
            np.cumsum(np.random.default_rng(1).standard_normal(20_000)),
            360.0 * np.random.default_rng(2).random(20_000),
            10.0 * T,
        ],
        ids=["quarters", "tens", "stays", "to and fro", "wander", "at random", "counted on"],
    )
    def test_steps_and_motion_are_fine(self, angle):
        assert said(record(self.T[: len(angle)], phi1=angle)) == []

    def test_rows_of_positions_are_no_samples(self):
        """A plan of 5 deg steps: the same numbers as a table that turns past zero at 5 deg a sample."""
        plan = np.tile(np.arange(0.0, 360.0, 5.0), 4)
        number = np.arange(len(plan)) + 1.0
        for t, more in ((np.arange(288.0), {}), (60.0 * number, {}), (0.01 * number, {"position": number})):
            assert said(record(t, phi1=plan, **more)) == []
        assert said(record(0.01 * number, phi1=plan))[0][0] == "wrap_2pi"

    def test_a_turn_while_nothing_was_written_is_none(self):
        t = np.r_[self.T[:1000], 60.0 + self.T[:1000]]
        codes = [finding.code for finding in check(record(t, phi1=np.repeat([0.0, 360.0], 1000)))]
        assert "wrap_2pi" not in codes


class TestStuckEncoders:
    T = 0.01 * np.arange(6000)

    @pytest.mark.parametrize("count", [6, 50, 400])
    def test_an_angle_that_freezes_and_catches_up(self, count):
        angle = noisy(5.0 * self.T)
        angle[2000 : 2000 + count] = angle[2000]
        assert said(record(self.T, phi1=angle)) == [("stuck_encoder", f"rows 2001-{2000 + count}")]

    @pytest.mark.parametrize(
        "angle",
        [
            np.clip(5.0 * T - 100.0, 0.0, 90.0),
            np.round(0.3 * T, 2),
            np.repeat(0.5 * np.arange(600.0), 10),
            np.abs(np.mod(T, 20.0) - 10.0),
            np.repeat(np.arange(60.0), 100) * 10.0,
            np.zeros(6000),
        ],
        ids=["stays", "coarse", "held", "reversals", "steps", "rest"],
    )
    def test_stays_coarse_encoders_and_reversals_are_fine(self, angle):
        assert said(record(self.T, th_x=angle)) == []

    def test_no_angle_moves_amid_a_commanded_turn(self):
        t, th, wc = turns()
        stuck = th.copy()
        stuck[:, 1] = stuck[0, 1]  # the last turn, of 45 deg, is about y alone
        ((code, where),) = said(triads(t, th=noisy(stuck), wc=wc))
        assert code == "stuck_encoder"
        first, last = map(int, where.removeprefix("rows ").split("-"))
        turning = np.flatnonzero(wc[:, 1]) + 1
        assert abs(first - turning[0]) <= 10
        assert abs(last - turning[-1]) <= 10

    def test_no_angle_moves_though_the_gyro_turns(self):
        """Rate about a bias of 5 deg/s, as a cheap gyro has it: a standstill is told from a turn all the same."""
        t, th, wc = turns(dt=0.02, rate=5.0)
        gyro = wc + 5.0 + noisy(np.zeros_like(wc), 6, 0.3)
        assert said(triads(t, th=noisy(th), gyro=gyro)) == []
        still = th.copy()
        still[:, 1] = 0.0
        assert [code for code, _ in said(triads(t, th=noisy(still), gyro=gyro))] == ["stuck_encoder"]

    def test_earth_rate_commanded_at_rest_is_fine(self):
        t, th, wc = turns()
        assert said(triads(t, th=noisy(th), wc=wc + 15.04 / 3600)) == []


class TestShiftedCommands:
    @pytest.mark.parametrize("rows", [2, 7, 60, -5, -60])
    def test_the_shift_is_said(self, rows):
        t, th, wc = turns()
        late = np.roll(th, rows, axis=0)
        if rows > 0:
            late[:rows] = th[0]
        else:
            late[rows:] = th[-1]
        (finding,) = check(triads(t, th=noisy(late), wc=wc))
        assert finding.code == "command_shift"
        assert finding.headline.endswith(f"by {abs(rows) * 0.2:.4g} s.")
        assert ("follow" in finding.message) == (rows > 0)

    @pytest.mark.parametrize("dt", [0.01, 0.2])
    def test_command_and_angles_in_step_are_fine(self, dt):
        t, th, wc = turns(dt)
        assert said(triads(t, th=noisy(th), wc=wc)) == []

    def test_a_table_that_takes_time_to_speed_up_is_fine(self):
        """Ramps of 1 s about the commanded edges, the same angle gained."""
        t, th, wc = turns(0.1)
        ramp = np.ones(10) / 10
        rate = np.stack([np.convolve(a, ramp, "same") for a in wc.T], axis=-1)
        th = np.vstack([th[:1], th[0] + 0.1 * np.cumsum(rate, axis=0)[:-1]])
        assert said(triads(t, th=noisy(th), wc=wc)) == []


@settings(max_examples=40, deadline=None)
@given(
    size=st.tuples(*[st.floats(0.0, 60.0)] * 3),
    period=st.tuples(*[st.floats(3.0, 300.0)] * 3),
    rests=st.booleans(),
    sensor=st.sampled_from(["wc", "gyro"]),
    seed=st.integers(0, 100),
)
def test_motion_of_all_gimbals_says_nothing(size, period, rests, sensor, seed):
    """Any motion of three gimbals, with the platform rate that it gives, encoder and gyro noise."""
    t = 0.1 * np.arange(3000)
    th = np.asarray(size) * np.sin(2 * np.pi * t[:, None] / np.asarray(period))
    if rests:
        th[1000:2000] = th[1000]
        th[2000:] += th[1000] - th[2000]
    rate = platform_rate(th, 0.1) + 15.0 / 3600
    if sensor == "gyro":
        rate = noisy(rate, seed + 1, 0.05) + 0.5
    found = check(triads(t, th=noisy(th, seed), **{sensor: rate}))
    assert {finding.code for finding in found} & {"wrap_2pi", "stuck_encoder", "command_shift"} == set()


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(
        st.sampled_from([0.0, 1.0, 360.0, -1e300, 1e300, 1e-300, np.nan]), min_size=1, max_size=40
    ),
    step=st.sampled_from([0.0, 0.01, -1.0, 1e300, np.nan]),
    times=st.integers(1, 10),
)
def test_the_strangest_angles_raise_nothing(values, step, times):
    column = np.tile(values, times)
    t = np.arange(len(column)) * step
    table = np.stack([column, column[::-1], np.roll(column, 1)], axis=-1)
    check(triads(t, th=table, wc=np.roll(table, 2, axis=0)))
    check({**triads(t, th=table, gyro=table), **record(t, phi1=column, position=column)})
