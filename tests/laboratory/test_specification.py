"""Tolerances and decision rules of ILAC-G8, checked against the normal distribution."""

import math

import pytest
from scipy.stats import norm
from scipy.stats import t as student

from inercal.foundation.errors import InputError
from inercal.laboratory.specification import conformity, specification_of


def judged(rule, value, u=1.0, dof=math.inf):
    specification = specification_of({"decision": rule, "K0": "3 m/s^2"}, "spec.toml")
    k = 2.0
    return conformity(specification, (-3.0, 3.0), value, u, k * u, dof)


@pytest.mark.parametrize(
    ("rule", "value", "verdict"),
    [
        ("simple acceptance", 2.9, "conform"),
        ("simple acceptance", -3.1, "not conform"),
        ("guard band", 0.9, "conform"),
        ("guard band", 1.1, "not conform"),
        # one-sided 2 % of a normal distribution is at 2.05 u
        ("risk 2 %", 0.9, "conform"),
        ("risk 2 %", 1.0, "not conform"),
        ("risk 20 %", 2.1, "conform"),
        ("risk 20 %", 2.2, "not conform"),
    ],
)
def test_rules(rule, value, verdict):
    found = judged(rule, value)
    assert found.verdict == verdict
    assert found.probability == pytest.approx(norm.cdf(3 - value) - norm.cdf(-3 - value))


def test_probabilities_are_those_of_student_where_degrees_are_few():
    assert judged("simple acceptance", 1.0, dof=4).probability == pytest.approx(
        student.cdf(2, 4) - student.cdf(-4, 4)
    )
    assert judged("simple acceptance", 1.0, u=0.0).probability == 1.0


def test_limits_are_in_any_unit_of_the_kind():
    specification = specification_of(
        {
            "K0": "1 mg",
            "K0_y": ["-2 mg", "1 mg"],
            "D_F": "1 deg/h",
            "K1_x": ["208 count/(m/s^2)", "209 count/(m/s^2)"],
        },
        "s",
    )
    g = 9.80665
    assert specification.of("K0_x", "m/s^2") == pytest.approx((-1e-3 * g, 1e-3 * g))
    assert specification.of("K0_y", "m/s^2") == pytest.approx((-2e-3 * g, 1e-3 * g))
    assert specification.of("D_F_z", "rad/s")[1] == pytest.approx(math.radians(1) / 3600)
    assert specification.of("K1_x", "count/(m/s^2)") == (208.0, 209.0)
    assert specification.of("M_xy", "rad") is None
    with pytest.raises(InputError, match="expected one like rad/s"):
        specification.of("K0_x", "rad/s")


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"decision": "perhaps"}, "simple acceptance"),
        ({"decision": "risk 60 %"}, "simple acceptance"),
        ({"decision": 2}, "simple acceptance"),
        ({"K0": 3.0}, "expected limits"),
        ({"K0": ["1 mg", "2 mg", "3 mg"]}, "expected limits"),
        ({"K0": ["2 mg", "1 mg"]}, "lower limit first"),
        ({"K0": "wide"}, "a number with its unit"),
        ({"K0": "1e999 mg"}, "a number with its unit"),
    ],
)
def test_bad_tables_are_one_sentence(table, said):
    with pytest.raises(InputError, match=said):
        specification_of(table, "spec.toml")
