"""Values that no instrument has are named, whatever u says; sound ones are not."""

import numpy as np
import pytest

from inercal.foundation.inference.plausible import beyond_prior, implausible

NAMES = ("K1_x", "K1_y", "M_xy", "K0_x")


def said(values, u=1e-3, about=1.0):
    scales = {name: about for name in NAMES if name.startswith("K1")}
    return list(implausible(NAMES, np.array(values), np.full(4, u), scales, ["M_xy"], {"K0_x": 9.81}))


def test_sound_values_are_not_named():
    assert said([1.02, 0.97, 0.03, 0.4]) == []


@pytest.mark.parametrize(
    ("value", "code", "words"),
    [
        (0.505, "unit_suspect", "another range"),
        (-1.0, "sign_suspect", "negative"),
        (0.01, "channel_swap", "not following its axis"),
        (1.2, "implausible", "more than a tenth off"),
    ],
)
def test_a_scale_factor_that_cannot_be_is_named_by_what_it_looks_like(value, code, words):
    (finding,) = said([value, 1.0, 0.0, 0.0])
    assert finding.code == code
    assert words in finding.headline
    assert finding.harm == ("K1_x",)


def test_scale_factors_off_alike_are_one_finding():
    (finding,) = said([0.505, 0.507, 0.0, 0.0])
    assert finding.harm == ("K1_x", "K1_y")
    assert len(finding.headline.split()) <= 20


def test_a_scale_that_the_record_does_not_fix_has_no_cause():
    """A scale of 2 ± 0.6 is no range: its own U is as large as what it says."""
    (finding,) = said([2.0, 1.0, 0.0, 0.0], u=0.3)[:1]
    assert "fixes no scale" in finding.headline


def test_a_scale_of_unknown_size_is_judged_by_its_sign_and_u_alone():
    assert [one.code for one in said([-417.0, 415.0, 0.0, 0.0], about=0.0)] == ["sign_suspect"]


def test_an_angle_and_a_bias_that_cannot_be():
    codes = [one.code for one in said([1.0, 1.0, 1.6, 9.812])]
    assert codes == ["channel_swap", "implausible"]


def test_a_value_that_leans_on_its_prior_is_judged_by_what_it_was_free_to_do():
    """A value of u as large as its prior may not move: 0.6 of the prior is as far as 4.2 of one that is free."""
    off, prior = np.array([0.6, 0.6]), np.ones(2)
    (finding,) = beyond_prior(("a", "b"), off, np.array([0.999, 0.1]), prior, 1e-3)
    assert finding.harm == ("a",)


def test_chance_names_no_prior_more_often_than_its_risk():
    rng = np.random.default_rng(20)
    u, prior = rng.uniform(0.05, 0.9, (4000, 5)), np.ones(5)
    off = rng.normal(0.0, np.sqrt(1.0 - u**2))
    names = tuple("abcde")
    named = sum(
        bool(list(beyond_prior(names, row, size, prior, 0.02))) for row, size in zip(off, u, strict=True)
    )
    assert named < 4000 * 0.02 + 4.0 * np.sqrt(4000 * 0.02)
