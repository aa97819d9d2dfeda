"""Sections read from stretches: means and their variances against many draws, turns against closed forms."""

import numpy as np
import pytest
from held_recordings import GRAVITY, Handling, held
from recordings import arrays, shipped
from scipy.optimize import least_squares
from scipy.signal import lfilter
from test_section_holds import variants

from inercal.systems.imu.sections.cutting.cut import (
    Stretch,
    TriadSamples,
    cut,
    motion_between_rests,
    variances_of_means,
)
from inercal.systems.imu.sections.cutting.holds import holds_of
from inercal.systems.imu.sections.cutting.table import SectionRow, quantity_of

RATE = 100.0


def samples(t, values, clipped=None):
    none = np.zeros(len(t), dtype=bool)
    return TriadSamples(np.asarray(t), np.asarray(values), none if clipped is None else clipped)


def noises(rng, kind, count, length):
    """Stretches (length, 3) of noise of unit size."""
    white = rng.normal(size=(count, length + 200, 3))
    if kind == "correlated":  # a filter of some 0.1 s
        white = lfilter([np.sqrt(1.0 - 0.9**2)], [1.0, -0.9], white, axis=1)
    return [x[200:] for x in white]


@pytest.mark.parametrize("kind", ["white", "correlated"])
def test_the_variance_of_a_mean_is_that_of_many_means(kind):
    """2000 means tell their variance to 1.8 % for three axes; the noise is told by 20 stretches, to some 4 %."""
    rng = np.random.default_rng(21)
    length = 300
    true = np.mean([x.mean(axis=0) ** 2 for x in noises(rng, kind, 2000, length)])
    told = [np.mean(variances_of_means(noises(rng, kind, 20, length), [length])[0]) for _ in range(20)]
    assert np.mean(told) == pytest.approx(true, rel=0.12)


def test_coarse_outputs_add_the_square_of_a_step_over_twelve():
    """A mean whose noise is hidden by the steps errs by up to half of one."""
    rng = np.random.default_rng(22)
    inputs = rng.uniform(-50.0, 50.0, size=(400, 3))
    stretches = [np.round(x + 0.01 * rng.normal(size=(200, 3))) for x in inputs]
    errors = np.array([x.mean(axis=0) for x in stretches]) - inputs
    told = np.mean(variances_of_means(stretches, [200])[0])
    assert told == pytest.approx(np.mean(errors**2), rel=0.25)


def a_turn(angle, duration, rest=2.0, noise=2e-3, seed=23, level=0.0):
    """A smooth turn about z between two rests; ``level``: tilt of z [rad]."""
    rng = np.random.default_rng(seed)
    n, k = round(duration * RATE), round(rest * RATE)
    s = (np.arange(n) + 0.5) / n
    turned = np.concatenate(
        [np.zeros(k), angle * (s - np.sin(2 * np.pi * s) / (2 * np.pi)), np.full(k, angle)]
    )
    rate = np.zeros((n + 2 * k, 3))
    rate[k : k + n, 2] = angle / duration * (1.0 - np.cos(2.0 * np.pi * s))
    t = np.arange(len(rate)) / RATE
    force = GRAVITY * np.stack(
        [np.sin(level) * np.cos(turned), -np.sin(level) * np.sin(turned), np.full(len(t), np.cos(level))],
        axis=1,
    )
    gyro = rate @ np.diag([1.0, 1.0, 1.02]) + [0.02, -0.01, 0.03] + noise * rng.normal(size=rate.shape)
    return t, force + 0.01 * rng.normal(size=force.shape), gyro, turned


def row(kind, **known):
    return SectionRow("one", "one.csv", kind=kind, **known)


@pytest.mark.parametrize("angle", [2.0 * np.pi, -2.0 * np.pi, 0.5 * np.pi])
def test_a_turn_is_read_over_its_motion_alone(angle):
    t, acc, gyro, turned = a_turn(angle, 6.0, level=0.1)
    stretch = Stretch(
        row("turn", axis=np.array([0.0, 0.0, 1.0]), angle=quantity_of(angle, 0.0, "deg")),
        samples(t, acc),
        samples(t, gyro),
    )
    done = cut([stretch])
    (section,) = done.sections
    assert 5.0 < section.duration < 6.4
    expected = np.array([0.02, -0.01, 0.03]) + np.array([0.0, 0.0, 1.02 * angle / section.duration])
    np.testing.assert_allclose(section.gyro, expected, atol=5.0 * np.sqrt(section.gyro_var.max()))
    np.testing.assert_allclose(section.gyro_var, 2e-3**2 / (section.duration * RATE), rtol=0.5)
    inside = (turned != 0.0) & (turned != angle)
    span = np.count_nonzero(inside) / RATE
    assert section.cosine_sine[0] * section.duration == pytest.approx(
        np.cos(turned[inside]).mean() * span + section.duration - span, abs=0.6
    )
    assert section.cosine_sine[1] == pytest.approx(
        np.sin(turned[inside]).mean() * span / section.duration, abs=0.06
    )
    np.testing.assert_allclose(section.acc, acc[:180].mean(axis=0), atol=0.01)
    np.testing.assert_allclose(section.acc_after, acc[-180:].mean(axis=0), atol=0.01)


def test_the_integral_of_a_turn_errs_by_its_noise():
    """The normalised error over 200 turns; nothing of the motion is cut off."""
    errors = []
    known = row("turn", angle=quantity_of(2.0 * np.pi, 0.0, "deg"))
    for seed in range(200):
        t, _, gyro, _ = a_turn(2.0 * np.pi, 4.0, seed=seed)
        one, *ends = cut([Stretch(known, None, samples(t, gyro))]).sections
        assert [end.kind for end in ends] == ["rest", "rest"]
        errors.append((one.gyro[2] - 0.03 - 1.02 * 2.0 * np.pi / one.duration) / np.sqrt(one.gyro_var[2]))
    assert abs(np.mean(errors)) < 4.0 / np.sqrt(200)
    assert 0.85 < np.std(errors) < 1.15


def test_what_is_wrong_with_a_turn_is_said():
    t, acc, gyro, _ = a_turn(2.0 * np.pi, 6.0)
    known = row("turn", angle=quantity_of(2.0 * np.pi, 0.0, "deg"))
    clipped = gyro[:, 2] > 1.5
    cases = {
        "at the end of its range": Stretch(known, None, samples(t, gyro, clipped)),
        "not at rest at its ends": Stretch(known, None, samples(t[300:], gyro[300:])),
        "angle is not stated": Stretch(row("turn"), None, samples(t, gyro)),
        "lasts 0.5 s": Stretch(known, None, samples(t[:51], gyro[:51])),
        "samples are missing": Stretch(
            known, None, samples(np.delete(t, slice(400, 420)), np.delete(gyro, slice(400, 420), axis=0))
        ),
        "rate is not stated": Stretch(row("rate"), None, samples(t, gyro)),
        "without a gyro": Stretch(known, samples(t, acc), None),
    }
    for words, stretch in cases.items():
        done = cut([stretch])
        assert done.sections == ()
        assert words in done.unused["one"]


def test_a_rest_without_a_motion_is_no_turn():
    rng = np.random.default_rng(24)
    assert isinstance(motion_between_rests(np.arange(1000) / RATE, rng.normal(size=(1000, 3))), str)


def test_the_accelerometers_of_a_steady_rate_are_left_out():
    t, acc, gyro, _ = a_turn(2.0 * np.pi, 6.0)
    (section,) = cut(
        [Stretch(row("rate", rate=quantity_of(1.0, 0.01, "deg/s")), samples(t, acc), samples(t, gyro))]
    ).sections
    assert section.acc is None
    assert (section.rate, section.rate_u) == (pytest.approx(1.0), pytest.approx(0.01))


def rests(t, acc, gyro):
    """The sections of all holds."""
    found = holds_of(t, acc, gyro).acc
    whole = samples(t, acc)
    rows = [SectionRow(f"rest {k}", "log", t[hold.start], t[hold.stop - 1]) for k, hold in enumerate(found)]
    return cut([Stretch(one, whole.between(one.begin, one.end), None) for one in rows]).sections


def ellipsoid(sections):
    """K0 (3,) by |f| = g over the means of rests, its u by their variances, and that with what scatter exceeds them."""
    means, variances = (np.array([getattr(one, name) for one in sections]) for name in ("acc", "acc_var"))
    middle, half = 0.5 * (means.max(axis=0) + means.min(axis=0)), 0.5 * np.ptp(means, axis=0)
    spread = np.sqrt(np.mean(variances / half**2, axis=1))
    rows, columns = np.triu_indices(3)

    def miss(p):
        shape = np.zeros((3, 3))
        shape[rows, columns] = p[3:]
        return (np.linalg.norm(((means - middle) / half - p[:3]) @ shape.T, axis=1) - 1.0) / spread

    fit = least_squares(miss, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    excess = max(fit.fun @ fit.fun / (len(means) - 9), 1.0)
    u = half * np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac))[:3])
    return middle + half * fit.x[:3], u, u * np.sqrt(excess)


LAWS = {
    "xsens": lambda: arrays(shipped("xsens")[0]),
    "hand": lambda: held(1)[:3],
    "restless hand": lambda: held(2, Handling(tremor=0.05, tremor_rate=0.03))[:3],
    "table": lambda: held(3, Handling(40, 100.0, (5.0, 6.0), tremor=0.0, tremor_rate=0.0, noise=2e-3))[:3],
}


@pytest.mark.parametrize("name", LAWS)
def test_values_hardly_change_whatever_is_done_to_a_recording(name):
    """Some hundred comparisons: four sigmas stand for the three of one. Twice the same holds say nothing more, and what
    a cut takes of u hangs on the poses that it takes."""
    t, acc, gyro = LAWS[name]()
    value, by_noise, u = ellipsoid(rests(t, acc, gyro))
    wrong = []
    for what, time, f, w, _ in variants(t, acc, gyro):
        if what not in ("turned", "twice"):
            changed, noise, v = ellipsoid(rests(time, f, w))
            off = np.max(np.abs(changed - value) / (4.0 * np.sqrt(np.abs(v**2 - u**2)) + 0.3 * u))
            larger = 0.0 if "cut" in what else np.max(noise / by_noise) / 1.3 * np.sqrt(len(time) / len(t))
            wrong += [(what, round(float(off), 2), round(float(larger), 2))] if max(off, larger) > 1.0 else []
    assert wrong == []
