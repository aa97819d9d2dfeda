"""Several records of one platform on bases of their own, by a simulator that shares no code."""

from dataclasses import replace

import numpy as np
import pytest
from independent.selfcal import ARCSEC, NOMINAL, PPM, PRIOR, UG, Drive, Faults, G, study
from independent.selfcal_driven import Place, driven
from scipy.stats import chi2

import inercal as ic
from inercal.foundation.errors import StudyError
from inercal.foundation.records.record import Record
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import EXTENDED, to_linear
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.result.unmodelled import Evidence, of_all
from inercal.systems.selfcal.several import fit, parts_of, placed

ONE = Drive((("z", 360), ("z", -360)), rate=np.radians(2.0))
PLACES = (
    Place(heading=0.3),
    Place(tilt=(0.0, 1.5)),
    Place(tilt=(1.5, 0.0), heading=2.0),
    Place(tilt=(0.8, 0.2), heading=-0.5),
)
FIXED = 'heading = "0 deg"\nfixed = { x = "0 deg", y = "0 deg" }'
WITHOUT = ("th_x", "th_y", "temperature")


def of_study(folder, names, places, more=""):
    path = folder / "study.toml"
    entries = "".join(
        f'\n[[records]]\nfile = "{name}"\nheading = "{np.degrees(place.heading)} deg"\n'
        f'tilt = ["{np.degrees(place.tilt[0])} deg", "{np.degrees(place.tilt[1])} deg"]\n'
        for name, place in zip(names, places, strict=True)
    )
    path.write_text(study(more=more).replace('heading = "0 deg"', FIXED) + entries)
    return path


def made(folder, rng, truth, of_rig, places=PLACES):
    """Records of the same platform; the base of each is turned by what nobody states."""
    records = []
    for k, place in enumerate(places):
        base = replace(of_rig, base=60 * ARCSEC * rng.standard_normal(3))
        driven(rng, ONE, truth, NOMINAL, base, place).write(folder / f"r{k}.csv", WITHOUT)
        records.append(ic.read(folder / f"r{k}.csv"))
    return records


def drawn(rng):
    return PRIOR * rng.standard_normal(18), Faults(
        gamma=20 * ARCSEC * rng.standard_normal(3), gyro_scale=100 * PPM * rng.standard_normal(3)
    )


@pytest.mark.slow
@pytest.mark.parametrize("draws", [4, pytest.param(20, marks=pytest.mark.campaign)])
def test_uncertainties_of_a_common_fit_hold(draws, tmp_path):
    """NEES of the common coefficients over draws of four records, within limits that 1 in 10000 leaves; all that one
    axis alone cannot tell is told by four bases."""
    names = [f"r{k}.csv" for k in range(4)]
    settings = ic.study(of_study(tmp_path, names, PLACES)).settings
    rng, total = np.random.default_rng(20261126), 0.0
    for _ in range(draws):
        truth, of_rig = drawn(rng)
        records = made(tmp_path, rng, truth, of_rig)
        found = fit(parts_of(records, [placed(record, settings) for record in records]))
        true = dict(
            zip(EXTENDED, to_linear(np.concatenate([truth, of_rig.gyro_scale, np.zeros(3)])), strict=True)
        )
        told = [k for k, name in enumerate(found.names) if name in true]
        error = found.x[told] - [true[found.names[k]] for k in told]
        total += error @ np.linalg.solve(found.covariance[np.ix_(told, told)], error)
        assert found.converged
        assert found.apart == ""
    low, high = chi2.ppf([5e-5, 1 - 5e-5], draws * 21)
    assert low < total < high
    assert (np.sqrt(np.diag(found.covariance)) < 0.6 * found.prior)[[3, 4, 5, 12, 13, 14, 15, 16, 17]].all()


def test_records_on_one_base_are_as_good_as_one_record_after_the_other(tmp_path):
    """The paper's 18 states: a common fit, and one record made of two with a gap, where the attitude is taken anew."""
    names, places = ["r0.csv", "r1.csv"], (PLACES[3], PLACES[3])
    asked = of_study(tmp_path, names, places, '[model]\nstates = "paper"\n')
    settings = ic.study(asked).settings
    rng = np.random.default_rng(5)
    truth, records = 0.1 * PRIOR * rng.standard_normal(18), []
    for name in names:
        driven(rng, ONE, truth, NOMINAL, Faults(), PLACES[3]).write(tmp_path / name, WITHOUT)
        records.append(ic.read(tmp_path / name))
    studies = [placed(record, settings) for record in records]
    found = fit(parts_of(records, studies))
    first, second = (recording_of(record, each) for record, each in zip(records, studies, strict=True))
    n = len(first.rate)
    joined = replace(
        first,
        t=np.append(first.t, second.t + first.t[-1] + 20.0),
        rate=np.vstack([first.rate, [[np.radians(1.0)] * 3], second.rate]),
        th=np.vstack([first.th, second.th]),
        acc=np.vstack([first.acc, second.acc]),
        held=(n,),
        walked=None,
    )
    whole = estimate(joined, problem(studies[0]), history=False)
    assert whole.restarts == (n + 1,)
    u = np.sqrt(np.diag(whole.covariance))
    assert np.abs((found.x - whole.coefficients) / u).max() < 0.1
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(u, rel=0.01)


def test_the_command_fits_records_together_and_names_what_changed(tmp_path):
    names, rng = [f"r{k}.csv" for k in range(3)], np.random.default_rng(6)
    asked = of_study(tmp_path, names, PLACES[:3])
    truth, of_rig = drawn(rng)
    records = made(tmp_path, rng, truth, of_rig, PLACES[:3])
    result = ic.calibrate(records, asked)
    estimate_ = result.estimate
    assert estimate_.status.value == "ok", estimate_.message
    assert estimate_.message.startswith("25 coefficients from 3 records, ")
    assert not any(name.startswith("beta") for name in estimate_.names)
    assert [each["file"].rsplit("/", 1)[-1] for each in estimate_.result["records"]] == names
    assert {item.source for item in estimate_.budget} >= {"prior"}
    off = (estimate_.values[:18] - truth) / estimate_.u[:18]
    assert np.abs(off).max() < 4.0
    shifted = truth.copy()
    shifted[12] += 200 * UG
    driven(rng, ONE, shifted, NOMINAL, of_rig, PLACES[2]).write(tmp_path / names[2], WITHOUT)
    study_ = ic.study(asked).settings
    records[2] = ic.read(tmp_path / names[2])
    apart = fit(parts_of(records, [placed(record, study_) for record in records])).apart
    assert apart.startswith("the records contradict each other")


@pytest.mark.slow
def test_errors_of_the_rig_that_no_state_has_are_in_u_of_a_common_fit(tmp_path):
    """K2 of 10 ug/g^2 is the same in all records: more than 4 u off by noise and prior, within 4 u as stated, most
    of some u, and told."""
    names, rng = [f"r{k}.csv" for k in range(3)], np.random.default_rng(11)
    asked = of_study(tmp_path, names, PLACES[:3])
    truth, of_rig = drawn(rng)
    of_rig = replace(of_rig, k2=10e-6 / G * np.array([1.0, -1.0, 1.0]))
    together = ic.calibrate(made(tmp_path, rng, truth, of_rig, PLACES[:3]), asked).estimate
    (line,) = (each for each in together.budget if each.source == "errors of the rig that are not fitted")
    off = np.abs(together.values[:18] - truth)
    bound = [together.result["bounds"][name] for name in together.names[:18]]
    assert (off / bound).max() > 4.0
    assert (off / together.u[:18]).max() < 4.0
    assert max(line.share.values()) > 0.5
    told = next(each for each in together.findings if each.code == "considered" and not each.where)
    assert any("K2_" in item["error"] for item in told.items)


def test_evidence_of_several_recordings_adds_where_errors_are_the_same():
    """Two recordings of one K2, and of a bias that wanders in each by itself: score and information of the one add,
    those of the others stay apart, and so do the shifts."""
    one = Evidence(("k2", "accelerometer_walk"), ("K2_x", "ka0_T1_x"), np.array([2.0, 3.0]), np.array([1.0, 5.0]),
                   np.array([[4.0, 0.5], [0.5, 9.0]]), np.array([[0.1, 0.2], [0.3, 0.4]]))  # fmt: skip
    both = of_all([one, one])
    assert both.names == ("K2_x", "ka0_T1_x", "ka0_T1_x")
    assert both.score == pytest.approx([2.0, 5.0, 5.0])
    assert both.information == pytest.approx(np.array([[8.0, 0.5, 0.5], [0.5, 9.0, 0.0], [0.5, 0.0, 9.0]]))
    assert both.shift == pytest.approx(np.array([[0.2, 0.2, 0.2], [0.6, 0.4, 0.4]]))


def test_a_record_that_is_not_named_is_refused(tmp_path):
    asked = of_study(tmp_path, ["a.csv"], PLACES[:1])
    driven(np.random.default_rng(1), Drive((("z", 30.0),))).write(tmp_path / "b.csv", WITHOUT)
    with pytest.raises(
        StudyError, match=r"records: found no entries for .*b\.csv among a\.csv, expected one"
    ):
        ic.calibrate(ic.read(tmp_path / "b.csv"), asked)
    assert isinstance(ic.read(tmp_path / "b.csv"), Record)
