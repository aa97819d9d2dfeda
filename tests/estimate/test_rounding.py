"""Numbers as texts: two digits of the uncertainty, whatever the magnitude."""

from decimal import Decimal, localcontext

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from inercal.foundation.results.shown import rounded

MAGNITUDES = st.builds(
    lambda digits, power: float(f"{digits}e{power}"), st.floats(1.0, 9.9), st.integers(-320, 307)
)
POSITIVE = MAGNITUDES | st.floats(0.0, exclude_min=True, allow_infinity=False)


@given(st.builds(lambda sign, size: sign * size, st.sampled_from((-1.0, 0.0, 1.0)), POSITIVE), POSITIVE)
@example(5.0, 1e8)
@example(1.7976931348623157e308, 1e307)
@example(5e-324, 5e-324)
@example(9.996, 0.01)
def test_a_value_is_rounded_to_two_digits_of_its_uncertainty(value, u):
    """Or to the 17 digits that a float has, where u is smaller than these."""
    shown, own = rounded(value, u)
    with localcontext(prec=1500):
        assert abs(Decimal(own) - Decimal(u)) <= Decimal("0.05").scaleb(Decimal(u).adjusted())
        last = Decimal(1).scaleb(Decimal(f"{u:.1e}").adjusted() - 1)
        last = max(last, Decimal(1).scaleb(Decimal(value).adjusted() - 16) if value else last)
        error = abs(Decimal(shown) - Decimal(value))
        assert error <= last / 2
        if u > 1e-300:  # below, a float has no such digits itself
            assert Decimal(shown) % last == 0


@pytest.mark.parametrize(
    ("value", "u", "texts"),
    [
        (1.23456, 0.0123, ("1.235", "0.012")),
        (1.0, 0.0996, ("1.00", "0.10")),
        (-0.001, 0.5, ("0.00", "0.50")),
        (0.99999047, 2.2e-7, ("0.99999047", "2.2e-07")),
        (5.0, 1e8, ("0e+00", "1.0e+08")),
        (123456789.0, 1e8, ("1.2e+08", "1.0e+08")),
        (float("nan"), 1.0, ("–", "1")),
        (2.5, 0.0, ("2.5", "0")),
        (2.0**997, 1.0, ("1.3393857589828342e+300", "1.0e+00")),
    ],
)
def test_texts(value, u, texts):
    assert rounded(value, u) == texts
