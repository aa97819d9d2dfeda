"""What a calibration from sections says of them: faults of users, priors that rule, sections that are missing."""

from dataclasses import replace

import numpy as np
import pytest
from section_protocols import PLACED, WHOLE, poses, rates, sides, site, turns
from turned_units import DEG, Bench, Unit

from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.systems.imu.sections.calibration import calibrate_sections
from inercal.systems.imu.sections.cutting.checks import contradictions
from inercal.systems.imu.sections.findings import findings_of, verdict
from inercal.systems.imu.sections.missing import missing
from inercal.systems.imu.sections.priors import Priors


@pytest.fixture(scope="module")
def unit():
    return Unit(np.random.default_rng(1))


@pytest.fixture(scope="module")
def sound(unit):
    """Six sides and turns both ways, nothing stated."""
    b = Bench(unit, stated=False)
    return [*sides(b), *turns(b)]


def judged(sections, unit, **known):
    """Status, message and findings by code."""
    before = contradictions(sections, 1.0)
    found = calibrate_sections(sections, Priors(site(unit), **known))
    status, message = verdict(found, before)
    return status, message, {each.code: each for each in (*before, *findings_of(found, found.problem.priors))}


def exchanged(sections, first, second):
    """The sections with the outputs of two of them exchanged."""
    by = {s.name: s for s in sections}
    other = {first: by[second], second: by[first]}
    return [
        replace(s, acc=other[s.name].acc, gyro=other[s.name].gyro) if s.name in other else s for s in sections
    ]


def changed(sections, name, **fields):
    return [replace(s, **fields) if s.name == name else s for s in sections]


def test_sound_sections_are_ok(sound, unit):
    status, _, findings = judged(sound, unit)
    assert status is Status.OK
    assert set(findings) <= {"by_prior", "scatter_by_prior", "stated_exact", "blind"}
    assert {item["term"] for item in findings["by_prior"].items} >= {"K2_x", "K2_y", "K2_z"}


@pytest.mark.slow
def test_exchanged_ends_of_an_axis_are_named(sound, unit):
    status, message, findings = judged(exchanged(sound, "+z", "-z"), unit)
    assert status is Status.INCONSISTENT
    assert "+z stands on -z" in message
    assert "sign_suspect" in findings


@pytest.mark.slow
def test_exchanged_axes_are_named(sound, unit):
    status, message, _ = judged(exchanged(exchanged(sound, "+x", "+y"), "-x", "-y"), unit)
    assert status is Status.INCONSISTENT
    assert "+x stands on +y" in message


@pytest.mark.slow
def test_a_side_taken_twice_is_named_first_and_alone(sound, unit):
    copy = next(s.acc for s in sound if s.name == "-x") + 1e-3
    sections = changed(sound, "+x", acc=copy)
    (finding,) = contradictions(sections, 1.0)
    assert "+x and -x hold the same side" in finding.headline
    assert judged(sections, unit)[0] is Status.INCONSISTENT


def test_sides_that_show_gravity_ask_one_question(sound):
    down = [replace(s, acc=-s.acc, acc_after=None) for s in sound if s.kind == "rest"]
    (finding,) = contradictions(down, 1.0)
    assert finding.code == "sign_suspect"
    assert "gravity, down" in finding.action


@pytest.mark.slow
def test_a_turn_against_its_name_is_named(sound, unit):
    name = sound[8].name
    status, message, _ = judged(changed(sound, name, gyro=-sound[8].gyro), unit)
    assert status is Status.INCONSISTENT
    assert name in message


@pytest.mark.slow
def test_a_file_in_another_unit_is_named(sound, unit):
    status, message, _ = judged(changed(sound, "+x", acc=sound[0].acc / 9.80665), unit)
    assert status is Status.INCONSISTENT
    assert message.startswith("+x ")


@pytest.mark.slow
def test_a_wrong_unit_of_all_drops_the_prior_of_scale_factors(sound, unit):
    halved = [replace(s, gyro=0.5 * s.gyro) if s.kind == "turn" else s for s in sound]
    found = calibrate_sections(halved, Priors(site(unit)))
    assert found.freed
    assert found.value("S_x")[0] == pytest.approx(0.5 * unit.truth["S_x"], rel=0.01)
    assert verdict(found, ())[0] is Status.OK
    (finding,) = (each for each in findings_of(found, Priors(site(unit))) if each.code == "unit_suspect")
    assert "another range" in finding.headline
    assert finding.harm == ("S_x", "S_y", "S_z")


def test_a_rest_that_moved_is_named(unit):
    sections = sides(Bench(unit), 2, up_u=0.3 * DEG)
    pushed = [
        replace(s, name=f"{s.name} {k}", acc=s.acc + (0.3 if k == 3 else 0.0)) for k, s in enumerate(sections)
    ]
    _, _, findings = judged(pushed, unit)
    assert "+y" not in findings["outlying_section"].headline
    assert f"{pushed[3].name} lies off" in findings["outlying_section"].headline


def test_reversed_sides_without_any_direction_show_as_negative_scale(unit):
    """Checks before the fit need directions; a sign by itself stays for the scale factor to tell."""
    b = Bench(unit)
    sections = [replace(s, axis=None) for s in rates(b, **PLACED)]
    assert contradictions(sections, 1.0) == ()


def test_several_rates_without_a_setup_are_named(unit):
    b = Bench(unit)
    sections = [*sides(b), *(replace(s, setup="") for s in rates(b, axis_u=0.3 * DEG, up_u=0.3 * DEG))]
    assert "one_setup" in judged(sections, unit)[2]


def test_nothing_stated_says_so(unit):
    sections = [replace(s, gyro=None) for s in sides(Bench(unit, stated=False))]
    _, _, findings = judged(sections, unit)
    assert {"placing_by_prior", "scatter_by_prior"} & set(findings)


def test_too_few_rests_name_the_pose_to_add(unit):
    sections = [
        replace(s, up=None, gyro=None) for s in sides(Bench(unit))[:4]
    ]  # x and y up and down, never z
    found = missing(sections, Priors(site(unit)))
    assert found is not None
    assert "z" in found.cure or found.terms
    for section in sections:
        assert section.up is None
    assert missing(poses(Bench(unit), 12), Priors(site(unit))) is None


def test_a_single_axis_gyro_has_the_terms_of_its_axis_alone(unit):
    b = Bench(unit)
    sections = [*sides(b), *turns(b, (WHOLE,), **PLACED)]
    one = [replace(s, gyro=s.gyro * np.array([np.nan, np.nan, 1.0])) for s in sections]
    found = calibrate_sections(one, Priors(site(unit)))
    of_gyro = {name for name in found.names if name.startswith(("D_F", "S", "T", "G"))}
    assert of_gyro == {"D_F_z", "S_z", "T_zx", "T_zy", "G_zx", "G_zy", "G_zz"}


def test_counts_of_no_known_scale_give_scale_factors_by_turns(unit):
    b = Bench(unit)
    counts = [
        replace(s, acc=None, acc_var=None, acc_after=None, gyro=131.0 / DEG * s.gyro, gyro_var=None)
        for s in [*sides(b), *turns(b)]
    ]
    found = calibrate_sections(counts, Priors(Site(unit.gravity), gyro_scale=None))
    value, u, _ = found.value("S_z")
    assert value == pytest.approx(131.0 / DEG * unit.truth["S_z"], abs=4 * u)
    assert u < 1e-3 * value


@pytest.mark.slow
def test_a_fine_gyro_has_another_prior_of_g_sensitivity_than_a_micromachined_one(unit):
    fine, coarse = (
        calibrate_sections([*sides(b, up_u=0.3 * DEG), *turns(b, **PLACED)], Priors(site(unit)))
        for b in (Bench(Unit(np.random.default_rng(2), g_sensitivity=1e-9), gyro_noise=1e-8), Bench(unit))
    )
    assert fine.problem.sd[27] < 1e-3 * coarse.problem.sd[27]


def test_noise_that_is_stated_too_small_is_a_finding_and_u_allows_for_it(unit):
    sections = [replace(s, acc_var=s.acc_var / 1e4, gyro=None) for s in sides(Bench(unit), 3, up_u=0.3 * DEG)]
    found = calibrate_sections(sections, Priors(site(unit)))
    assert found.excess == {"acc"}
    assert found.scatter["acc"] == pytest.approx(3e-4, rel=0.5)
    assert "excess_scatter" in {each.code for each in findings_of(found, found.problem.priors)}


def test_sections_of_one_setup_are_not_independent(unit):
    """Four rates about a side tell its axis once: taken as placed anew each time, u(T) would be halved."""
    b = Bench(unit)
    sections = rates(b, values=(0.5, -0.5, 1.0, -1.0), rate_u=0.0, **PLACED)
    together, apart = (
        calibrate_sections([*sides(b, up_u=0.3 * DEG), *parts], Priors(site(unit)))
        for parts in (sections, [replace(s, setup="") for s in sections])
    )
    assert together.value("T_xy")[1] == pytest.approx(2.0 * apart.value("T_xy")[1], rel=0.1)


def test_a_section_between_two_others_of_its_setup_is_placed_with_them(unit):
    b = Bench(unit)
    parts = [*sides(b, up_u=0.3 * DEG), *rates(b, **PLACED)]
    mixed = [parts[k] for k in np.random.default_rng(0).permutation(len(parts))]
    one, other = (calibrate_sections(some, Priors(site(unit))) for some in (parts, mixed))
    assert np.allclose(one.x, other.x, atol=1e-4 * one.u)
    assert np.allclose(one.u, other.u, rtol=1e-6)


def test_noise_a_million_times_below_the_tilts_still_converges(unit):
    b = Bench(unit, acc_noise=5e-8)
    sections = [replace(s, gyro=None) for s in [*poses(b, 8), *sides(b, up_u=0.3 * DEG)]]
    assert calibrate_sections(sections, Priors(site(unit))).converged


@pytest.mark.slow
def test_a_fine_gyro_of_large_g_sensitivity_is_no_contradiction(unit):
    """Its class by noise, that of laser gyros, has none; the sections show it."""
    b = Bench(unit, gyro_noise=1e-8)
    found = calibrate_sections([*sides(b, up_u=0.3 * DEG), *turns(b, **PLACED)], Priors(site(unit)))
    assert verdict(found, ())[0] is Status.OK
    value, u, _ = found.value("G_zx")
    assert value == pytest.approx(unit.truth["G_zx"], abs=4 * u)
