"""Pictures and pages of an angle of attack: they are drawings that can be read, and say what the numbers say."""

import base64
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from sting_study import BASE, DEG, G, scenario

from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.disturbances import Disturbances, Oscillation
from inercal.systems.aoa.figures import page as page_of
from inercal.systems.aoa.figures import pictures, sensors
from inercal.systems.aoa.figures.learned import consistency
from inercal.systems.aoa.figures.panels import (
    Marks,
    Signals,
    gaps,
    measured,
    of_angle,
    over_time,
    peak,
    spectral_density,
    stretches,
    thinned,
)
from inercal.systems.aoa.settings import Attitude
from inercal.systems.aoa.simulate import simulate, to_record
from inercal.systems.aoa.task import measure


def words_of(svg):
    """All words of a drawing, which has to be well-formed and to need nothing else."""
    assert ET.fromstring(svg).tag.endswith("svg")
    assert all(link.startswith(("#", "data:")) for link in re.findall(r'href="([^"]*)"', svg))
    numbers = " ".join(re.findall(r'(?: d|transform|width|height|[xy])="([^"]*)"', svg)).lower()
    assert "nan" not in numbers
    assert "inf" not in numbers
    assert len(svg) < 450_000
    return re.findall(r"<!-- (.*?) -->", svg)


def texts(picture):
    return words_of(picture.svg)


def check(page):
    """A page that needs nothing but itself, and each of its drawings."""
    assert "<script" not in page
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(link.startswith("data:") for link in links)
    for link in links:
        words_of(base64.b64decode(link.partition(",")[2]).decode())
    return page


def short(name="base", **changes):
    """A study of 17 s at 100 Hz."""
    return replace(scenario(name, sample_rate=100.0, duration=17.0), **changes)


def recorded(settings):
    return simulate(settings, np.random.default_rng(1)).recording


def measurement(settings, recording=None, **how):
    recording = recorded(settings) if recording is None else recording
    return measure(to_record(recording, settings), settings, **how)


def by(kind, settings):
    """The settings with another estimator."""
    return replace(settings, estimator=replace(settings.estimator, kind=kind))


def without_rows(recording, kept):
    cut = {name: getattr(recording, name)[kept] for name in ("t", "acc", "gyro", "turns", "zero_angle")}
    return replace(recording, **cut, reference=recording.reference[kept])


def by_title(drawn):
    return {picture.title: picture for picture in drawn}


@cache
def of_the_base():
    """Pictures of 30° + 10° sin 2 pi t."""
    settings = short()
    return pictures(measurement(settings))


@pytest.mark.slow
def test_what_is_drawn_of_a_fusion():
    drawn = of_the_base()
    assert [picture.title for picture in drawn] == [
        "Angle, its uncertainty, and its rate",
        "Close-up",
        "Where the sensors are",
        "Error against the reference",
        "Sensors against the reference angle",
        "What lever arms add to the readings",
        "Flexure of the sting",
        "What was learned of the sensors",
        "What was learned, over time",
        "How the uncertainties fall",
        "Normalised innovations squared",
        "Innovations and whether they are white",
        "Spectra",
        "Correlation of the coefficients",
    ]
    words = {title: texts(picture) for title, picture in by_title(drawn).items()}
    assert {"theta [°]", "u of theta [°]", "rate [°/s]", "time [s]"} <= set(words[drawn[0].title])
    assert {"a1", "a2", "a3", "gyro"} <= set(words["Innovations and whether they are white"])
    assert {"b_g", "b_1", "dr_3", "zo_2", "k_g"} <= set(words["What was learned of the sensors"])
    found = re.search(r"oscillates at (\S+) Hz", by_title(drawn)["Spectra"].caption)
    assert float(found[1]) == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_alpha_beta_and_roll_are_drawn_where_they_are_known():
    """A roll of 20 deg with yaw gyros: roll, alpha and beta; stated alone: alpha and beta; else theta is no alpha."""
    lies = Attitude(roll=Quantity(20.0 * DEG, 0.1 * DEG, parse_unit("rad"), ""))
    coupled = Disturbances(roll=Oscillation(1.0 * DEG, 3.0), yaw=Oscillation(1.0 * DEG, 2.0))
    title = "Alpha, beta and roll"
    assert title not in by_title(of_the_base())
    for changes, panels in (
        ({"attitude": lies}, {"alpha [°]", "beta [°]"}),
        ({"attitude": lies, "disturbances": coupled}, {"alpha [°]", "beta [°]", "roll [°]"}),
        ({"disturbances": coupled}, {"roll [°]"}),
    ):
        settings = short(**changes)
        words = texts(by_title(pictures(measurement(settings)))[title])
        assert {word for word in words if word.endswith("[°]")} == panels
        if "roll [°]" in panels and "attitude" in changes:
            told = next(word for word in words if word.startswith("roll:"))
            low, high = (float(x) for x in re.findall(r"-?[\d.]+", told.replace("−", "-"))[:2])
            assert (low, high) == pytest.approx((19.0, 21.0), abs=0.4)


def test_sensors_against_the_reference_are_drawn_as_they_are():
    values = np.array([[100.0, -50.0], [0.1, 0.2]])
    seen = np.array([[True, False], [True, True]])
    picture = sensors.fitted(
        ("a1", "a2"), ("scale − 1 [ppm]", "axis [mrad]"), values, 0.1 * np.abs(values), seen
    )
    assert {"a1", "a2", "scale − 1 [ppm]", "axis [mrad]"} <= set(texts(picture))
    texts(sensors.fitted(("a1",), ("x",), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1), dtype=bool)))


@pytest.mark.slow
@pytest.mark.parametrize(("roll", "kind"), [(0.0, "fusion"), (60.0, "fusion"), (60.0, "paper")])
def test_lever_arms_are_what_they_are_worth(roll, kind):
    """Of theta = 30° + A sin(W t): r W^2 A^2 centrifugal and, at a roll of cosine c, c r W^2 A tangential, in mg and,
    over g, in degrees, whatever the method."""
    lies = Attitude(roll=Quantity(roll * DEG, 0.0, parse_unit("rad"), ""))
    settings = short(attitude=lies)
    drawn = pictures(measurement(by(kind, settings))) if roll else of_the_base()
    picture = by_title(drawn)["What lever arms add to the readings"]
    w, c = 2.0 * math.pi * BASE.frequency, math.cos(roll * DEG)
    for name, kind, size in (
        ("a1", "tangential", c * 0.25 * w**2 * BASE.amplitude),
        ("a2", "centrifugal", 0.20 * w**2 * BASE.amplitude**2),
        ("a3", "tangential", c * 0.25 * w**2 * BASE.amplitude),
    ):
        title = next(text for text in texts(picture) if text.startswith(f"{name}, at most"))
        found = re.fullmatch(rf"{name}, at most: {kind} (\S+) mg = (\S+)°", title)
        assert float(found[1]) == pytest.approx(1e3 * size / G, rel=0.03)
        assert float(found[2]) == pytest.approx(size / G / DEG, rel=0.06)


@pytest.mark.slow
def test_accelerometers_alone_with_a_gap_and_a_restart():
    settings = short()
    recording = without_rows(recorded(settings), np.r_[0:500, 1300:1700])
    found = measurement(settings, replace(recording, gyro=np.full(len(recording.t), np.nan)))
    drawn = by_title(pictures(found))
    for picture in drawn.values():
        texts(picture)
    caption = drawn["Angle, its uncertainty, and its rate"].caption
    assert "Grey strip: no rows." in caption
    assert "the filter started anew" in caption
    assert "gyro 100 % missing" in drawn["What was measured"].caption
    assert "nose up: +" not in texts(drawn["Where the sensors are"])


def test_a_short_record_without_a_reference():
    settings = short()
    recording = replace(without_rows(recorded(settings), np.arange(40)), reference=None)
    drawn = by_title(pictures(measurement(settings, recording)))
    for picture in drawn.values():
        texts(picture)
    assert "Angle, its uncertainty, and its rate" in drawn
    assert not {"Error against the reference", "Spectra", "Close-up"} & set(drawn)


@pytest.mark.slow
def test_rows_that_are_not_later_are_not_drawn():
    settings = short()
    recording = recorded(settings)
    t = recording.t.copy()
    t[700:705] -= 1.0
    found = measurement(settings, replace(recording, t=t))
    page = check(page_of(found))
    assert "Angle, its uncertainty, and its rate" in page
    assert np.isnan(found.angles.theta[700:705]).all()


@pytest.mark.slow
def test_saturated_samples_are_marked():
    settings = short("clipping")
    drawn = by_title(pictures(measurement(settings)))
    assert "Red strip: saturated" in drawn["Angle, its uncertainty, and its rate"].caption
    caption = drawn["What was measured"].caption
    # |rate| = X |cos| over 40 of 62.8 deg/s: a part 2/pi acos(40/62.8) of the time
    share = 200.0 / math.pi * math.acos(40.0 / math.degrees(2.0 * math.pi * BASE.amplitude))
    assert float(re.search(r"gyro (\S+) % saturated", caption)[1]) == pytest.approx(share, abs=2.0)
    assert "a2" not in caption


@pytest.mark.slow
def test_points_and_their_errors():
    settings = replace(scenario("pitch-pause", sample_rate=100.0, last=10.0 * DEG))
    found = measurement(settings)
    assert len(found.points) == 3
    drawn = by_title(pictures(found))
    assert "3 in all" in drawn["Points"].caption
    assert {"mean angle [°]", "mean less reference [°]", "u of the mean"} <= set(texts(drawn["Points"]))
    assert "at rest" in drawn["Error against the reference"].caption


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False], ids=["reference", "none"])
def test_methods_side_by_side(known):
    """Errors against a reference, differences from the first without one; each method has its numbers."""
    settings = scenario("base", sample_rate=100.0, duration=4.0)
    recording = recorded(settings)
    found = measurement(settings, recording if known else replace(recording, reference=None), compare=True)
    drawn = by_title(pictures(found))
    words, over = texts(drawn["Methods side by side"]), texts(drawn["Methods over time"])
    assert set(found.compared) <= set(words) & set(over)
    assert ("fusion 19" in words) == known
    assert "error against the reference [°]" in words if known else "difference from fusion 19 [°]" in words
    base = found.recording.reference if known else found.angles.theta
    apart = np.degrees(found.compared["smoothed 8"].theta - base)[200:]
    assert f"{np.abs(apart).max():.2g} / {np.sqrt(np.mean(apart**2)):.2g}°" in words


def test_the_paper_s_way_has_angles_and_no_coefficients():
    settings = short()
    drawn = by_title(pictures(measurement(by("paper", settings))))
    assert not {"Flexure of the sting", "What was learned of the sensors"} & set(drawn)
    assert "improved, mechanical, dual" in " ".join(texts(drawn["Angle, its uncertainty, and its rate"]))
    assert "tangential" in " ".join(texts(drawn["What lever arms add to the readings"]))


def test_flexure_of_a_smoothed_record():
    """0.03 g rms of heave come out as 30 mg, beyond the prior of 10 mg; smoothed constants have no course over time."""
    settings = short("flexure")
    settings = replace(
        settings, estimator=replace(settings.estimator, smooth=True, snap=1e8), band=Band(math.inf)
    )
    drawn = by_title(pictures(measurement(settings)))
    title = next(text for text in texts(drawn["Flexure of the sting"]) if text.startswith("across the model"))
    assert float(re.search(r"(\S+) mg rms", title)[1]) == pytest.approx(30.0, rel=0.15)
    assert title.endswith("prior 10 mg")
    assert "What was learned of the sensors" in drawn
    assert "How the uncertainties fall" not in drawn


@pytest.mark.parametrize(("factor", "doubt"), [(1.0, False), (1e3, True), (1e-3, True)])
def test_positions_in_a_wrong_unit_are_seen(factor, doubt):
    """Millimetres given as metres, or the other way round."""
    r = factor * np.array([-0.25, 0.2, 0.25])
    angle = np.array([0.5, 0.0, -0.5]) * np.pi
    picture = sensors.side_view(("a1", "a2", "a3"), angle, r, np.zeros(3), True)
    assert ("are the units right?" in picture.caption) == doubt
    assert f"a2   r {200.0 * factor:g} mm, z 0 mm, axis 0°" in texts(picture)
    assert "nose up: +" in texts(picture)


def test_what_is_learned_is_set_against_its_prior():
    values, u = np.array([1.0, 0.1, np.nan]), np.array([0.1, 0.98, np.nan])
    picture = sensors.learned(("b_1", "dr_1", "k_g"), ("ug", "mm", "ppm"), values, u, np.zeros(3), np.ones(3))
    assert "Left at their priors: dr_1." in picture.caption
    assert {"1.00 ± 0.10 ug", "0.10 ± 0.98 mm", "– ± – ppm"} <= set(texts(picture))


def test_stretches_are_seen_however_short():
    t = np.arange(10_000.0)
    flags = np.zeros(10_000, dtype=bool)
    flags[[5000, *range(7000, 8000), 8002]] = True
    found = stretches(t, flags)
    assert len(found) == 2  # 8002 touches its neighbour
    assert np.ptp(found[0]) == pytest.approx(9999.0 / 600.0)
    assert found[1, 0] <= 7000.0
    assert found[1, 1] >= 8002.0
    assert stretches(t, np.zeros(10_000, dtype=bool)).shape == (0, 2)
    assert stretches(t, np.ones(10_000, dtype=bool)).shape == (1, 2)


def test_gaps_are_found_where_they_can_be_seen():
    t = np.concatenate([np.arange(0.0, 10.0, 0.01), np.arange(20.0, 30.0, 0.01), [30.02]])
    assert gaps(t) == pytest.approx(np.array([[9.99, 20.0]]))
    assert len(gaps(np.array([0.0, 1.0]))) == 0


@pytest.mark.parametrize("n", [900, 100_000])
def test_a_thinned_line_keeps_its_extremes_and_breaks_at_gaps(n):
    x = np.random.default_rng(2).standard_normal(n)
    cuts = np.array([n // 3])
    t, shown = thinned(np.arange(float(n)), x, cuts, 700)
    assert (np.nanmin(shown), np.nanmax(shown)) == (x.min(), x.max())
    assert np.isnan(shown[(t < n // 3).sum()])
    assert len(t) < 2900


def test_extreme_numbers_can_be_drawn():
    """Nothing known, infinity, and numbers beyond all axes."""
    t = np.arange(50.0)
    wild = np.where(t > 40.0, np.inf, np.where(t > 30.0, 1e300, t))
    panels = [
        Signals("nothing", {"x": np.full(50, np.nan)}, band=(np.full(50, np.nan), np.full(50, np.nan))),
        Signals("wild", {"x": wild, "y": -wild}, zero=True),
        Signals("flat", {"x": np.zeros(50)}, scale="log", levels={"one": 1.0}),
    ]
    assert {"nothing", "wild", "one"} <= set(texts(over_time("", "", t, panels)))
    assert "nothing" in texts(over_time("", "", t[:1], [replace(panels[0], lines={"x": t[:1]})]))
    strip = measured(t, ("a1",), np.ones((50, 1), dtype=bool), np.zeros((50, 1), dtype=bool), Marks())
    assert "a1 100 % missing" in strip.caption
    texts(strip)
    texts(sensors.side_by_side(("a", "b"), np.array([0.0, np.nan]), np.array([0.0, np.nan]), "error"))
    texts(sensors.points(*np.full((4, 2), np.nan), np.full(2, np.nan)))


def test_squared_innovations_are_those_of_each_sensor():
    rng = np.random.default_rng(3)
    values = rng.standard_normal((4000, 2)) * [1.0, 3.0]
    nis, white = consistency(np.arange(4000.0), values, ("a1", "gyro"), 5.0, Marks())
    assert "once settled, 5." in nis.caption
    assert {"a1", "gyro", "1, as stated", "2, inconsistent"} <= set(texts(nis))
    texts(white)
    assert consistency(np.arange(3.0), np.full((3, 2), np.nan), ("a1", "gyro"), math.nan, Marks()) == []


def test_spectral_density_of_known_signals():
    """White noise of variance s^2 at a rate f has 2 s^2/f, to a few times its scatter; a sine has its power at its
    frequency; Parseval's sum gives the variance. With a tenth of the samples missing, and a jump in time."""
    rng, rate, n = np.random.default_rng(4), 200.0, 40_000
    t = np.arange(n) / rate
    t[n // 2 :] += 7.0
    noise = 0.3 * rng.standard_normal(n)
    f, density = spectral_density(t, noise)
    averages = n / len(f) / 2.0
    assert density[5:].mean() == pytest.approx(2.0 * 0.09 / rate, rel=5.0 / np.sqrt(averages * len(f)))
    sine = np.sin(2.0 * np.pi * 3.21 * t) + noise
    sine[rng.random(n) < 0.1] = np.nan
    f, density = spectral_density(t, sine)
    assert peak(f, density) == pytest.approx(3.21, abs=0.25 * f[0])
    near = np.abs(f - 3.21) < 5.0 * f[0]
    assert density[near].sum() * f[0] == pytest.approx(0.5, rel=0.05)
    assert peak(*spectral_density(t, noise)) is None
    assert spectral_density(t[:100], noise[:100])[0].size == 0
    assert spectral_density(t, np.full(n, np.nan))[0].size == 0
    assert of_angle(t[:100], noise[:100], None, {}) == []
