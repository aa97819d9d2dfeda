"""What results of all systems say alike: by which rule, and in which words."""

import numpy as np

from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.inference.identifiability import learned
from inercal.foundation.results.budget import TypeB, combine
from inercal.foundation.results.remarks import (
    at_prior,
    at_prior_together,
    exact_gravity,
    exact_inputs,
    missed,
    reached,
    ruled_by_site,
    singular,
)


def texts(findings):
    return [(each.code, each.message) for each in findings]


def test_each_coefficient_at_its_prior_has_its_part_and_its_hint():
    said = at_prior({"a": 0.834, "b": 0.6}, {"b": "turn about z"})
    assert texts(said) == [
        ("at_prior", "a: 83 % of its prior is left"),
        ("at_prior", "b: 60 % of its prior is left; turn about z"),
    ]
    assert texts(at_prior_together(["a", "b"], "; more")) == [
        ("at_prior", "a, b: more than half of the prior is left; more")
    ]
    assert not at_prior_together([])


def test_a_goal_is_met_up_to_the_wanted_u_and_said_in_units_of_the_field():
    """Goals of what is no coefficient are nobody's."""
    wanted = {"kg0_x": 1e-6, "ka0_x": 2e-3, "other": 1.0}
    goals = reached(("kg0_x", "ka0_x", "free"), np.array([1e-6, 4e-3, 1.0]), wanted)
    assert goals == {
        "kg0_x": {"wanted": 1e-6, "u": 1e-6, "met": True},
        "ka0_x": {"wanted": 2e-3, "u": 4e-3, "met": False},
    }
    said = missed(goals, {"kg0_x": "rad/s", "ka0_x": "m/s^2"}, {"kg0_x": "of no use"})
    assert texts(said) == [("goal_missed", "ka0_x: u = 4.1e+02 ug, wanted 2e+02 ug")]


def test_only_what_has_no_uncertainty_is_taken_as_exact():
    assert not exact_gravity(Site(9.8, (GravityInput("gravity", 1e-3, "m/s^2", 1.0),)), "K1 is off")
    ((code, text),) = texts(exact_gravity(Site(9.8), "K1 is off"))
    assert code == "stated_exact"
    assert text.startswith(
        "gravity is taken as exactly 9.8 m/s^2, and K1 is off: State it with its uncertainty"
    )
    assert not exact_inputs({})
    (found,) = exact_inputs({"heading": "2 deg of kg0_x", "latitude": "1 deg of ds_x"})
    assert found.code == "stated_exact"
    assert (
        found.headline
        == "heading, latitude are taken as exact, and the errors listed shift a coefficient by its u"
    )
    assert found.action == "State them with uncertainties."
    assert found.table[1] == [("heading", "2 deg of kg0_x"), ("latitude", "1 deg of ds_x")]


def test_the_site_rules_what_would_be_less_than_half_without_it():
    """u of ``a`` is by the site but for a tenth, that of ``b`` half by it, that of ``c`` not at all."""
    sources = [
        TypeB("latitude", 1.0, "rad", np.array([10.0, 1.0, 0.0])),
        TypeB("noise", 1.0, "1", np.eye(3)),
    ]
    budget = combine(("a", "b", "c"), sources).budget
    ((code, text),) = texts(ruled_by_site(("a", "b", "c"), budget, ("latitude", "gravity"), 2.0))
    assert code == "uncertain_site"
    assert text.startswith("u of a is mostly of what [site] states (latitude)")
    assert not ruled_by_site(("a", "b", "c"), budget, ("gravity",), 2.0)


def test_a_covariance_that_is_singular_but_for_rounding_is_ill_conditioned():
    prior = np.ones(2)
    assert singular(learned(np.diag([1.0, 1e-6]), prior, ("a", "b")), "turn more") is None
    status, text = singular(learned(np.diag([1.0, 1e-18]), prior, ("a", "b")), "turn more")
    assert status is Status.ILL_CONDITIONED
    assert "a is known too weakly beside the rest; turn more" in text
