"""Faults of a test are named, or in u, by records of a simulator that shares no code with the product."""

import sys
from pathlib import Path

import numpy as np
import pytest
from turntable_studies import DEG_H, LATITUDE, WHEEL_X, study

from inercal.foundation.geometry.earth import Site
from inercal.foundation.instruments.by_angle import ChannelModel
from inercal.foundation.rigs.plans import grid
from inercal.systems.turntable.positions.examination import Examination, examine, f_test
from inercal.systems.turntable.positions.faults import approach
from inercal.systems.turntable.positions.shifts import Scale, doubts
from inercal.systems.turntable.task import calibrate, simulate

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "independent"))

import turntable_drift
import turntable_faults

from turntable import ARCSEC, Faults

WHEEL, SHUFFLED, FORCE = turntable_faults.TESTS
UG = turntable_faults.UG


def calibrated(name, folder, seeds, faults):
    (folder / "study.toml").write_text(turntable_faults.study(name))
    return [
        turntable_faults.calibrated(name, [20261123, 7, seed], faults, folder).estimate
        for seed in range(seeds)
    ]


#: faults that shift a value by more than 2 u, and a name that each of them gets
LARGE = [
    (WHEEL, Faults(heading=np.pi / 2), "heading_suspect"),
    (WHEEL, Faults(warm_up=1.0), "warm_up"),
    (SHUFFLED, Faults(hysteresis=0.2), "approach_hysteresis"),
    (FORCE, Faults(tilt_north=20.0 * ARCSEC), "level_suspect"),
    (SHUFFLED, Faults(ramp=0.4), "trend"),
    (FORCE, Faults(backlash=20.0 * ARCSEC), "approach_hysteresis"),
    (FORCE, Faults(harmonic={(1, 1): 40.0 * ARCSEC}), "angle_harmonic"),
    (FORCE, Faults(warm_up=200.0 * UG), "warm_up"),
    (SHUFFLED, Faults(field=0.5), "ground_field"),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "faults", "code", "draws"),
    [
        *((*each, 4) for each in LARGE[:4]),
        *(pytest.param(*each, 50, marks=pytest.mark.campaign) for each in LARGE),
    ],
)
def test_a_fault_that_shifts_a_value_is_named(name, faults, code, draws, tmp_path):
    """Of 50 one may end ok; most bear the name, others that of a fault that looks alike."""
    done = calibrated(name, tmp_path, draws, faults)
    assert sum(each.status.value == "ok" for each in done) <= draws // 50
    assert sum(code in {finding.code for finding in each.findings} for each in done) > draws // 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "draws"),
    [(FORCE, 20), *(pytest.param(each, 500, marks=pytest.mark.campaign) for each in turntable_faults.TESTS)],
)
def test_sound_records_end_ok(name, draws, tmp_path):
    """At 0.5 % 20 records have more than two others with a probability of 1.5e-4, 500 more than 8 with one of 1e-3."""
    done = calibrated(name, tmp_path, draws, Faults())
    assert sum(each.status.value != "ok" for each in done) <= (2 if draws == 20 else 8)
    ratios = [turntable_faults.enlarged(each) for each in done]
    assert np.quantile(ratios, 0.9) < 1.5
    assert max(ratios) < 3.5


def test_a_plan_in_order_hides_more_than_a_shuffled_one(tmp_path):
    """A trend is nearly a term where the positions are taken in order, and not where they are shuffled."""
    in_order, shuffled = (calibrated(name, tmp_path, 1, Faults())[0] for name in (WHEEL, SHUFFLED))
    counts = [
        next((row["faults"] for row in said.items if row["unseen"] == "by order"), 0.0)
        for result in (in_order, shuffled)
        for said in result.findings
        if said.code == "blind"
    ]
    assert counts[0] > sum(counts[1:])


def test_a_field_is_judged_with_the_part_that_does_not_show(tmp_path):
    """Its west part shows and shifts no value, its north part shifts k_z and shows in no residual."""
    (done,) = calibrated(SHUFFLED, tmp_path, 1, Faults(field=0.5))
    (said, *_) = (each for each in done.findings if each.code == "ground_field")
    assert {"k_z", "kY_z"} & set(said.harm)


def test_noise_that_is_estimated_as_none_tells_nothing(tmp_path):
    """Beside what the table does to a channel its noise may come out as zero: a fault is then no certainty."""
    (tmp_path / "study.toml").write_text(turntable_faults.study(FORCE))
    record = [1, 0, 3], Faults(scale_drift=50e-6)
    evidence = turntable_faults.calibrated(FORCE, *record, tmp_path).evidence
    fit = evidence.fitting.fit
    asked = {each.fault.name: each for each in examine(evidence.readings, fit, [None] * 3).asked}
    field = asked["field acc_z"]
    now = fit.with_effects(fit.effects.beside(field.fault.columns @ field.base), [None] * 3)
    assert now.noise[2] < 0.05 * fit.noise[2]  # of nothing, what the iteration leaves by rounding
    assert now.noise_dof[2] < 1.0
    assert f_test(fit, [None] * 3, field).chance > 1e-3


def test_a_fault_in_doubt_counts_by_the_probability_that_it_is_there():
    """Shift, its u and probability by ordinary least squares, noise stated and no errors of the table."""
    from scipy.stats import chi2

    noise = 0.01 * DEG_H
    settings = study(grid((6, 6)), coefficients=WHEEL_X, noise=noise)
    record = simulate(settings, np.random.default_rng(5))
    record["y_x"].values[:] += 0.03 * np.linspace(0.0, 1.0, 36)
    done = calibrate(record, settings)
    fit = done.fitting.fit
    A, y = fit.model.rows(done.readings.angles)[:, 0], done.readings.y[:, 0]
    examination = examine(done.readings, fit, [noise])
    assert not examination.significant
    assert examination.doubtful
    length = np.abs(A).max(axis=0)
    own_u = noise * np.sqrt(np.diag(np.linalg.inv((A / length).T @ (A / length)))) / length
    more, supports = 0.0, []
    for each in examination.doubtful:
        B = np.column_stack([A / length, Z := each.fault.columns[:, 0] @ each.seen.base])
        m = Z.shape[1]
        before, after = (np.linalg.lstsq(C, y, rcond=None)[0] for C in (A / length, B))
        gained = np.sum((y - A / length @ before) ** 2) - np.sum((y - B @ after) ** 2)
        p = chi2.sf(gained / noise**2, m)
        assert each.chance == pytest.approx(p, rel=1e-6)
        supports.append(0.5 / len(examination.asked) / (-np.e * p * np.log(p)))
        u = noise * np.sqrt(np.diag(np.linalg.inv(B.T @ B)))[:12] / length
        b2 = np.maximum((u / own_u) ** 2 - 1.0, 0.0)
        s = (before - after[:12]) / length / own_u
        most = np.sqrt(chi2.isf(3e-3 / len(examination.asked), m) * b2)
        more += supports[-1] * (s**2 + b2) * (4.0 / np.maximum(most, 4.0)) ** 2
    more /= 1.0 + sum(supports)
    assert done.estimate.u / own_u == pytest.approx(np.sqrt(1.0 + more), rel=1e-5)
    assert more.max() > 0.05
    drifts = [each.redrawn for each in done.estimate.budget if "not excluded" in each.source]
    assert drifts == [each.fault.code in ("trend", "warm_up") for each in examination.doubtful]


def test_the_base_is_the_same_in_repeat_runs_and_a_drift_is_another():
    settings = study(grid((6, 6)), coefficients=WHEEL_X, noise=0.01 * DEG_H)
    done = calibrate(simulate(settings, np.random.default_rng(5)), settings)
    fit, noise = done.fitting.fit, [0.01 * DEG_H]
    examination = examine(done.readings, fit, noise)
    tested = tuple(f_test(fit, noise, each) for each in examination.asked)
    scale = Scale(done.estimate.names, np.eye(len(fit.c)), done.estimate.u)
    sources = doubts(Examination((), tested, examination.asked), fit, scale)
    redrawn = {each.fault.kind: source.redrawn for each, source in zip(tested, sources, strict=True)}
    assert {kind for kind, each in redrawn.items() if each} == {"trend", "warm-up", "scale drift"}
    assert not redrawn["level"]
    assert not redrawn["heading"]


def test_the_test_of_a_trend_is_the_f_test_of_a_column():
    """Without errors of the table it is that of ordinary least squares, one channel by itself."""
    from scipy.stats import f

    settings = study(grid((6, 6)), coefficients=WHEEL_X, noise=None)
    rng = np.random.default_rng(5)
    for size in (0.0, 0.04):
        record = simulate(study(grid((6, 6)), coefficients=WHEEL_X, noise=0.01 * DEG_H), rng)
        values = record["y_x"].values
        values += size * np.linspace(0.0, 1.0, 36)
        done = calibrate(record, settings)
        (channel,) = done.fitting.fit.model.channels
        assert isinstance(channel, ChannelModel)
        A = done.fitting.fit.model.rows(done.readings.angles)[:, 0]
        y = done.readings.y[:, 0]
        squares = [
            np.sum(np.square(y - B @ np.linalg.lstsq(B, y, rcond=None)[0]))
            for B in (
                A / np.abs(A).max(0),
                np.column_stack([A / np.abs(A).max(0), np.linspace(-0.5, 0.5, 36)]),
            )
        ]
        expected = f.sf((squares[0] - squares[1]) / (squares[1] / (36 - 13)), 1, 36 - 13)
        fit = done.fitting.fit
        seen = {each.fault.name: each for each in examine(done.readings, fit, [None]).asked}
        assert f_test(fit, [None], seen["trend y_x"]).chance == pytest.approx(expected, rel=1e-3)
        assert (expected < 1e-3) == (size > 0.0)


def test_the_sense_of_approach():
    angles = np.radians([[0.0, 0.0], [45.0, 0.0], [45.0, 350.0], [10.0, 10.0], [190.0, 10.0]])
    np.testing.assert_array_equal(approach(angles), [[0, 0], [1, 0], [1, -1], [-1, 1], [0, 1]])


# drift that is fitted


@pytest.mark.slow
@pytest.mark.parametrize("kind", turntable_drift.FAULTS)
@pytest.mark.parametrize("runs", [3, pytest.param(100, marks=pytest.mark.campaign)])
def test_intervals_hold_where_drift_is_fitted(kind, runs):
    """12 coefficients a run, tied by the table: a design effect of 3 gives 4 standard errors of 25 and 4.4 %."""
    made = turntable_drift.campaign(kind, runs)
    assert made["covered"] > 0.95 - 4.0 * np.sqrt(0.05 * 0.95 * 3.0 / (12 * runs))
    assert made["ok"] >= 1.0 - (2 if runs == 3 else 5) / runs


def test_drift_within_the_dwells_is_named_and_used(tmp_path):
    """A warm-up of 200 ug that is over after the first dwells shows within them; a slope is known better by samples."""
    turntable_drift.FAULTS["brief"] = lambda rng: Faults(warm_up=200.0 * UG, tau=0.02)
    done = turntable_drift.one(np.random.default_rng(1), "brief", tmp_path, 20, "none").estimate
    assert done.status.value == "suspect"
    assert "warm_up" in [each.code for each in done.findings]
    u = [
        turntable_drift.one(np.random.default_rng(1), "linear", tmp_path, n).estimate.result["nuisances"][0][
            "u"
        ]
        for n in (1, 20)
    ]
    assert u[1] < u[0]
    del turntable_drift.FAULTS["brief"]


# a latitude that is hardly known


@pytest.mark.parametrize(("degrees", "status"), [(1.0, "ok"), (5.0, "ok"), (26.0, "suspect")])
def test_a_latitude_that_is_hardly_known(degrees, status):
    """k = k' cos L' / cos L: to second order while that does, then the verdict says that it does not."""
    u = np.radians(degrees)
    settings = study(site=Site(9.8, (), LATITUDE, u), coefficients=WHEEL_X, noise=0.01 * DEG_H)
    done = calibrate(simulate(settings, np.random.default_rng(4)), settings).estimate
    assert done.status.value == status
    k = done["k_x"]
    if status == "ok":
        drawn = (
            k.value * np.cos(LATITUDE) / np.cos(LATITUDE + u * np.random.default_rng(1).normal(size=20000))
        )
        assert k.u == pytest.approx(np.sqrt(np.mean(np.square(drawn - k.value))), rel=0.06)
    else:
        assert any(each.code == "uncertain_site" and "k_x" in each.harm for each in done.findings)


def test_a_latitude_without_an_uncertainty_is_said_with_what_it_would_do():
    """The error that is named shifts the value that is named by 2 u, where the test is made again at that latitude."""
    settings = study(coefficients=WHEEL_X, noise=0.01 * DEG_H)
    record = simulate(settings, np.random.default_rng(5))
    done = calibrate(record, settings).estimate
    assert not [each for each in done.budget if "not excluded" in each.source]  # which would make u larger
    (said,) = (each.message for each in done.findings if each.code == "stated_exact")
    size, name = float(said.split(" deg")[0].split()[-1]), said.split("shift ")[1].split()[0]
    other = study(site=Site(9.8, (), LATITUDE + np.radians(size)), coefficients=WHEEL_X, noise=0.01 * DEG_H)
    shift = calibrate(record, other).estimate[name].value - done[name].value
    assert abs(shift) / done[name].u == pytest.approx(2.0, rel=0.35)  # the size is said in one digit
