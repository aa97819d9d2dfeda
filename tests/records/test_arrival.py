"""Stamps of arrival become even steps of the mean rate; gaps, jitter within bounds and sound stamps stay."""

import numpy as np
import pytest

from inercal.foundation.records.arrival import evenly
from rows import for_each

N = 6000
EVEN = 0.01 * np.arange(N)
RNG = np.random.default_rng(20261127)
LOST = np.sort(RNG.choice(N, int(0.85 * N), replace=False))


def in_bursts(short, pause, count, rng):
    """Stamps of rows that come ``count`` at a time."""
    steps = rng.permutation(np.repeat([short] * (count - 1) + [pause], N // count))
    return np.cumsum(steps + rng.uniform(0.0, 0.05 * short, len(steps)))


@for_each(
    "t",
    [
        in_bursts(0.002, 0.034, 4, np.random.default_rng(1)),
        np.ceil(EVEN / 0.05) * 0.05,  # five rows for each packet, all with its stamp
        np.floor(EVEN),  # whole seconds
        np.floor(np.arange(N) / 95.0 * 1000) / 1000,  # milliseconds of a loop of 95 Hz
        np.cumsum(np.random.default_rng(2).exponential(0.01, N)),
    ],
)
def test_stamps_of_arrival_become_even(t):
    made, finding = evenly(t, "t")
    assert finding.code == "arrival_stamps"
    np.testing.assert_allclose(np.diff(made), (t[-1] - t[0]) / (len(t) - 1), rtol=1e-9)
    assert f"{(len(t) - 1) / (t[-1] - t[0]):.5g} Hz" in finding.headline


@for_each(
    "t",
    [
        EVEN,
        EVEN + np.random.default_rng(3).uniform(-0.002, 0.002, N),
        EVEN[LOST],  # rows lost at random
        np.delete(EVEN, np.arange(2000, 2500)),  # one gap
        np.concatenate([EVEN[:3000], EVEN[2999] + 0.02 * np.arange(1, 3001)]),  # another rate
        np.r_[EVEN[:50], np.nan, EVEN[51:]],
    ],
)
def test_sound_stamps_and_lost_rows_stay(t):
    made, finding = evenly(t, "t")
    assert made is t
    assert finding is None


def test_noise_is_that_of_the_mean_rate(tmp_path):
    """White noise of known density, stamped on arrival: N is within its u, where the median rate made half of it."""
    import inercal as ic

    density, rate = 0.0125, 100.0
    rng = np.random.default_rng(99)
    t = in_bursts(0.002, 0.034, 4, rng)
    t *= (N / rate) / (t[-1] - t[0])
    record = ic.record(t=t, gyro_x=rng.normal(0.0, density * np.sqrt(rate), N), units={"gyro_x": "deg/s"})
    assert [finding.code for finding in record.findings] == ["arrival_stamps"]
    found = ic.allan(record)["N_gyro_x"]
    assert np.degrees(found.value) == pytest.approx(density, abs=4 * np.degrees(found.u))


def test_inspect_says_rates_and_turns(tmp_path, monkeypatch, capsys):
    """Mean and median rate of the stamps; the factor two of a wrong range, and a reversed axis, are findings."""
    import json

    from test_recognise import ACC, GYRO, T, written

    from inercal.cli import run

    monkeypatch.chdir(tmp_path)
    for name, factor, codes in (
        ("sound", [1, 1, 1], []),
        ("half", [0.5, 0.5, 0.5], ["unit_suspect"]),
        ("reversed", [1, 1, -1], ["sign_suspect"]),
    ):
        head = (
            "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]\n"
        )
        written(tmp_path / f"{name}.csv", head, np.column_stack([T, ACC, GYRO * factor]))
        assert run(["inspect", f"{name}.csv", "--out", f"{name}.json"]) == 0
        assert "t: 100 Hz by the median step, 100 Hz by the mean" in capsys.readouterr().out
        result = json.loads((tmp_path / f"{name}.json").read_text("utf-8"))
        assert [finding["code"] for finding in result["findings"]] == codes
        assert result["result"]["turns"]["ratio"] == pytest.approx(factor[0], rel=0.03)
        assert result["result"]["rates"][0]["mean"] == pytest.approx(100.0, rel=1e-6)
