"""The live monitor against the same computed from the whole recording."""

import csv
import io

import numpy as np
import pytest

from inercal.faces.stream.lines import Lines
from inercal.faces.stream.monitor import Monitor
from inercal.faces.stream.run import Saving, run
from inercal.foundation.errors import InputError
from inercal.foundation.noise.dwell_means import overlapping_variance, running_sums
from inercal.foundation.records.dwells import static_intervals, windowed_variance
from inercal.systems.imu.limits import LIMITS

HEADER = "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]\n"
RATE, WINDOW = 50.0, 51
FIRST = 33  # stamps that tell the rate


def hold_and_turn(seed, n=1500, moves=((500, 620), (900, 1000))):
    """Noise at rest and two motions: (n, 6) samples at 50 Hz."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, 6)) * [0.01, 0.01, 0.02, 0.001, 0.002, 0.001] + [0, 0, 9.81, 0, 0, 0]
    for begin, end in moves:
        x[begin:end] += rng.standard_normal((end - begin, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    return x


def text(x, t=None, header=HEADER):
    t = np.arange(len(x)) / RATE if t is None else t
    rows = np.column_stack([t, x]).tolist()
    return header + "".join(",".join("" if v != v else repr(v) for v in row) + "\n" for row in rows)


def lines_of(data):
    return Lines(io.BytesIO(data.encode()), "stdin", None, lambda finding: None)


def watch(data, every=0.0):
    """Columns of the monitor's output by name."""
    out, lines = [], lines_of(data)
    run(Monitor(lines, every), lines, out.append)
    rows = list(csv.reader(out[1:]))
    columns = np.array([[float(v or "nan") for v in row] for row in rows]).T
    return dict(zip((title.split(" ")[0] for title in out[0].split(",")), columns, strict=True))


def test_rest_and_moments_are_those_of_the_recording():
    """The same variance over that of the same start, so the same rest: only the window ends at the sample."""
    x = hold_and_turn(1)
    found = watch(text(x))
    used = x[FIRST:]
    half = WINDOW // 2
    start = used[: int(5.0 * RATE) + 1]
    ratio = np.max(
        [
            windowed_variance(part, WINDOW) / np.linalg.norm(part[: len(start)].var(axis=0, ddof=1))
            for part in (used[:, :3], used[:, 3:])
        ],
        axis=0,
    )
    ratio = np.concatenate([np.full(FIRST + half, np.nan), ratio[:-half]])  # from the centre to the end
    known = np.arange(len(x)) >= FIRST + len(start) - 1
    np.testing.assert_allclose(found["restlessness"][known], ratio[known], rtol=1e-8)
    assert np.isnan(found["restlessness"][~known]).all()
    np.testing.assert_array_equal(found["rest"][known], ratio[known] <= LIMITS.moving_variance)
    for i, name in enumerate(HEADER.split(",")[1:]):
        windows = np.lib.stride_tricks.sliding_window_view(used[:, i], WINDOW)
        rows = slice(FIRST + WINDOW - 1, None)
        name = name.split(" ")[0]
        np.testing.assert_allclose(found[f"mean_{name}"][rows], windows.mean(axis=1), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found[f"sd_{name}"][rows], windows.std(axis=1, ddof=1), rtol=1e-8)


def test_static_intervals_are_those_of_the_recording():
    """As many, and each as long: from the first sample of the window to the last one still."""
    x = hold_and_turn(2)
    found = watch(text(x))
    still = found["rest"] == 1
    size = np.linalg.norm([1.0, 1.0, 4.0])
    calm = [windowed_variance(x[:, :3], WINDOW) < LIMITS.moving_variance * 1e-4 * size]
    calm += [windowed_variance(x[:, [4, 3, 5]], WINDOW) < LIMITS.moving_variance * 1e-6 * size]
    batch = static_intervals(np.all(calm, axis=0), np.empty(0, np.int64), 20)
    live = static_intervals(still, np.empty(0, np.int64), 20)
    assert len(live) == len(batch) == 3
    for a, b in zip(live[1:], batch[1:], strict=True):
        assert abs(a.start - WINDOW // 2 - b.start) <= 2
        # the length on the last line is that of the hold, from the first sample of its first window
        assert found["still"][a.stop - 1] == pytest.approx((a.samples + WINDOW - 2) / RATE)
    assert (found["still"][found["rest"] == 0] == 0).all()


def test_allan_deviation_since_the_last_motion():
    """Adjacent means that do not overlap, of the samples since rest was found, at the octave that is said."""
    x = hold_and_turn(3)
    found = watch(text(x))
    began = np.flatnonzero((found["rest"][1:] == 1) & (found["rest"][:-1] == 0))[-1] + 1
    for row in (began + 20, began + 100, len(x) - 1):
        part = x[began : row + 1]
        m = round(found["tau"][row] * RATE)
        assert m == 2 ** int(np.log2(len(part) / 9))
        means = part[: len(part) // m * m].reshape(-1, m, 6).mean(axis=1)
        expected = np.sqrt(np.mean(np.diff(means, axis=0) ** 2, axis=0) / 2)
        names = [name.split(" ")[0] for name in HEADER.split(",")[1:]]
        np.testing.assert_allclose([found[f"adev_{name}"][row] for name in names], expected, rtol=1e-7)
    assert np.isnan(found["adev_acc_x"][found["rest"] == 0]).all()


def test_random_walk_lies_within_its_uncertainty():
    """N of 150 channels of white noise after 40 s: on average right, its errors of the size that is stated."""
    rng = np.random.default_rng(4)
    n, channels, walk = 2000, 150, 0.02
    x = walk * np.sqrt(RATE) * rng.standard_normal((n, channels))
    header = ",".join(["t [s]", *(f"a{i + 1} [g]" for i in range(channels))]) + "\n"
    out, lines = [], lines_of(text(x, header=header))
    run(Monitor(lines, 39.9), lines, out.append)
    last = dict(zip(out[0].split(","), out[-1].split(","), strict=True))
    estimates = np.array([float(last[f"N_a{i + 1} [g/sqrt(Hz)]"]) for i in range(channels)])
    u = np.array([float(last[f"u_N_a{i + 1} [g/sqrt(Hz)]"]) for i in range(channels)])
    relative = u[0] / estimates[0]
    assert np.mean(estimates**2) / walk**2 == pytest.approx(1.0, abs=4.5 * 2 * relative / np.sqrt(channels))
    spread = np.std((estimates - walk) / (relative * walk))
    assert spread == pytest.approx(1.0, abs=4.5 / np.sqrt(2 * channels) + 0.05)
    # the overlapping variance of the same samples, at the octave nearest 1 s, is another estimate of it
    other = np.sqrt(overlapping_variance(running_sums(x[FIRST:]), 64) * 64 / RATE)
    assert np.std(estimates / other) < 2 * relative


@pytest.mark.parametrize("kind", ["missing value", "gap", "backward", "no stamp"])
def test_what_is_not_known_ends_rest_until_a_window_is_full(kind):
    x, t = hold_and_turn(5, moves=()), np.arange(1500) / RATE
    match kind:
        case "missing value":
            x[800, 4] = np.nan
        case "gap":
            t[800:] += 0.55
        case "backward":
            t[800:] -= 2.0
        case "no stamp":
            t[800] = np.nan
    found = watch(text(x, t))
    assert found["rest"][799] == 1
    lost = int(kind in ("missing value", "no stamp"))  # a row that takes no part
    assert np.isnan(found["rest"][800 : 800 + lost + WINDOW - 1]).all()
    after = 800 + lost + WINDOW - 1
    assert found["rest"][after] == 1
    assert found["still"][after] == pytest.approx((WINDOW - 1) / RATE)


def test_a_lost_sample_and_a_repeated_stamp_do_no_harm():
    x, t = hold_and_turn(6, moves=()), np.arange(1500) / RATE
    t[700] = t[699]
    found = watch(text(np.delete(x, 900, axis=0), np.delete(t, 900)))
    assert (found["rest"][400:] == 1).all()


def test_a_start_in_motion_waits_for_the_first_quiet_five_seconds():
    x = hold_and_turn(7, moves=((100, 300),))
    found = watch(text(x))
    first = int(np.flatnonzero(found["rest"] == 1)[0])
    # motion begins a start too, which the calm after it ends; the window is then filled anew
    assert 300 + 5 * RATE <= first <= 300 + WINDOW + 5 * RATE + 2
    assert found["restlessness"][first:].max() < 3.0


def test_lines_at_intervals_of_the_record():
    """The first row, and then the first row of each further interval, also where decimals round."""
    x = hold_and_turn(8, 900, ((500, 620),))
    every, all_rows = watch(text(x), 0.1), watch(text(x))
    assert every["t"] == pytest.approx(np.arange(180) / 10)
    for name, values in every.items():
        np.testing.assert_array_equal(values, all_rows[name][::5])


def test_killed_anywhere_and_resumed(tmp_path):
    """Digit for digit, whatever is known so far: the first stamps, the start, rest or motion."""
    data = text(hold_and_turn(9))
    lines = lines_of(data)
    whole = []
    run(Monitor(lines), lines, whole.append)
    rows = data.splitlines(keepends=True)[1:]
    saving = Saving(tmp_path / "state", 13)
    found = {}
    for kill in (10, 20, 40, 200, 350, 510, 560, 640, 1100, None):

        class Killed(Monitor):
            def step(self, state, sample, kill=kill):
                if sample.row == kill:
                    raise RuntimeError
                return super().step(state, sample)

        out, lines = [], lines_of(HEADER + "".join(rows))
        try:
            run(Killed(lines), lines, out.append, saving)
        except RuntimeError:
            assert kill is not None
        for line in out[1:]:
            assert found.setdefault(float(line.split(",")[0]), line) == line
    assert list(found.values()) == whole[1:]


def test_what_cannot_be_watched_is_one_sentence():
    with pytest.raises(InputError, match="found temperature, expected accelerometers"):
        Monitor(lines_of("t [s],temperature [degC]\n0,20\n"))
    with pytest.raises(InputError, match="33 time stamps that do not increase"):
        watch(text(hold_and_turn(10, 50, ()), np.zeros(50)))
