"""Quantities as typed: units, dimensions, uncertainties, and nothing but `QuantityError` for junk."""

import math
import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from inercal.faces.report.style import plain_unit
from inercal.foundation.errors import QuantityError
from inercal.foundation.units import _TABLE, STANDARD_GRAVITY, parse_quantity, parse_unit, shown
from rows import for_each

UNITS = [(unit, dimension) for dimension, (_, factors) in _TABLE.items() for unit in factors]


@for_each(
    ("text", "dimension", "si"),
    [
        ("1 deg/h", "rate", 4.84813681e-6),
        ("1 deg/sqrt(h)", "angle random walk", 2.90888209e-4),
        ("1 ug", "acceleration", 9.80665e-6),
        ("1 g", "acceleration", 9.80665),
        ("1 arcmin", "angle", 2.90888209e-4),
        ("1 arcsec", "angle", 4.84813681e-6),
        ("10 ppm", "number", 1e-5),
        ("20 degC", "temperature", 20.0),
        ("293.15 K", "temperature", 20.0),
        ("68 degF", "temperature", 20.0),
    ],
)
def test_pins(text, dimension, si):
    assert parse_quantity(text, dimension, "key").value == pytest.approx(si, rel=1e-9)


def test_the_unit_g_is_no_gravity_of_a_site():
    assert STANDARD_GRAVITY == 9.80665


@for_each(
    ("text", "value", "u"),
    [
        ("9.81744(2) m/s^2", 9.81744, 2e-5),
        ("9.81(25) m/s^2", 9.81, 0.25),
        ("981(2) cm/s²", 9.81, 0.02),
        ("9.81(0.5) m/s^2", 9.81, 0.5),
        ("9.81 ± 0.02 m/s^2", 9.81, 0.02),
        ("9.81+/-2e-2 m/s2", 9.81, 0.02),
        ("98.1(3)e-1 m/s^2", 9.81, 0.03),
        ("1(1) mg", 9.80665e-3, 9.80665e-3),
        ("-.5 m/s^2", -0.5, 0.0),
        ("9.8m/s/s", 9.8, 0.0),
    ],
)
def test_uncertainty_in_the_last_digits_or_after_plus_minus(text, value, u):
    quantity = parse_quantity(text, "acceleration", "key")
    assert quantity.value == pytest.approx(value, rel=1e-12)
    assert quantity.u == pytest.approx(u, rel=1e-12)
    assert quantity.text == text


@given(
    unit_of=st.sampled_from(UNITS), value=st.floats(-1e12, 1e12).filter(lambda x: x == 0.0 or abs(x) > 1e-30)
)
def test_format_and_parse_round_trip(unit_of, value):
    unit, dimension = unit_of
    quantity = parse_quantity(f"{value!r} {unit}", dimension, "key")
    assert quantity.unit.symbol == unit
    scale = max(abs(value) * quantity.unit.factor, abs(quantity.unit.zero))
    assert quantity.value == pytest.approx(
        value * quantity.unit.factor + quantity.unit.zero, abs=1e-15 * scale
    )
    assert parse_quantity(quantity.text, dimension, "key") == quantity


@for_each(
    ("typed", "meant"),
    [
        ("deg / h", "deg/h"),
        ("°/√h", "deg/sqrt(h)"),
        ("µg", "ug"),
        ("m/s**2", "m/s^2"),
        ("ug s", "ug*s"),
        ("LSB", "count"),
        ("mdps", "mdeg/s"),
        ("Grad/s", "deg/s"),
        ("", "1"),
        ("m·s⁻²", "m/s^2"),
        ("m s^-2", "m/s^2"),
        ("rad·s⁻¹", "rad/s"),
        ("rad s^-1", "rad/s"),
        ("º/s", "deg/s"),  # U+00BA, which European keyboards have
        ("° s⁻¹", "deg/s"),
        ("m/s³", "m/s^3"),
        ("°C", "degC"),
        ("°F", "degF"),
        ("µg/√(Hz)", "ug/sqrt(Hz)"),
        ("°/h/√Hz", "deg/h/sqrt(Hz)"),
    ],
)
def test_spellings(typed, meant):
    assert parse_unit(typed) == parse_unit(meant)


@for_each("unit", [unit for unit, _ in UNITS])
def test_units_are_read_as_pages_write_them(unit):
    """What a report states, as N in deg/√h, can be copied into a study."""
    assert parse_unit(plain_unit(unit)) == parse_unit(unit)
    if "deg" in unit:
        assert parse_unit(plain_unit(unit).replace("deg", "°")) == parse_unit(unit)


def test_white_noise_of_a_rate_is_a_random_walk_of_its_angle():
    """60 deg/h/sqrt(Hz) = 60 deg/h sqrt(s) = 60 deg/h sqrt(h)/60 = 1 deg/sqrt(h)."""
    assert parse_quantity("60 deg/h/√Hz", "angle random walk", "N").value == pytest.approx(
        parse_quantity("1 deg/√h", "angle random walk", "N").value, rel=1e-12
    )


@for_each(
    ("unit", "dimension", "factor"),
    [
        ("inch", "length", 0.0254),
        ("m s^-2", "acceleration", 1.0),
        ("rad s^-1", "rate", 1.0),
        ("MHz", "frequency", 1e6),
        ("1/s", "frequency", 1.0),
        ("kV", "voltage", 1e3),
        ("turn/min", "rate", 2 * math.pi / 60),
        ("knot", "velocity", 1852 / 3600),
    ],
)
def test_rare_units_are_looked_up_in_pint(unit, dimension, factor):
    found = parse_unit(unit)
    assert (found.dimension, found.factor) == (dimension, pytest.approx(factor))


@for_each("unit", ["furlongs per", "dB", "degR", "m*9^9^9^9", "kg", "m+m", "a" * 3000, "("])
def test_no_unit(unit):
    with pytest.raises(QuantityError, match=r"found the unit .* expected one such as"):
        parse_unit(unit)


@pytest.mark.parametrize(
    ("unit", "meant"),
    [("MG", "mg"), ("milli-g", "mg"), ("micro g", "ug"), ("Deg/S", "deg/s"), ("M/S^2", "m/s^2")],
)
def test_a_unit_in_other_letters_is_asked_for(unit, meant):
    with pytest.raises(QuantityError, match=rf"found the unit .* did you mean {re.escape(meant)}\?"):
        parse_unit(unit)


@pytest.mark.parametrize("sign", ["m°/s", "mGrad/s", "mdps"])
def test_thousandths_of_a_degree_are_written_in_many_ways(sign):
    assert parse_unit(sign).factor == pytest.approx(math.pi / 180e3, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5 deg", "found '5 deg', which is of angle, expected a quantity with a unit of time"),
        ("5", "found '5' without a unit"),
        (5, "found '5' without a unit"),
        ("50 sss", "found the unit 'sss', expected a unit of time: s, ms, us, ns, min, h$"),
        ("9.8.1 s", "found '9.8.1 s', expected a quantity"),
        ("1e400 s", "out of range"),
        ("1.0(5) ± 0.2 s", "expected a quantity"),
        (True, "found True, expected"),
        (None, "found None, expected"),
        (["5 s"], "found .* expected"),
        (float("nan"), "found nan, expected"),
        pytest.param(10**5000, "too large to print, expected", id="huge"),
    ],
)
def test_wrong_quantities_say_what_was_found_and_expected(text, message):
    with pytest.raises(QuantityError, match=message) as caught:
        parse_quantity(text, "time", "imu.static_start")
    assert caught.value.where == "imu.static_start"
    assert len(str(caught.value)) < 250


def test_a_bare_number_is_a_dimensionless_quantity():
    assert parse_quantity(2e-5, "number", "key").value == 2e-5
    assert parse_quantity("3", "number", "key").value == 3.0


@settings(deadline=None)  # pint is loaded on the way
@given(text=st.text() | st.from_regex(r"[0-9.()eE+±\-/ a-zµ°^*]{1,30}", fullmatch=True))
@example("1" * 50_000 + "\n1")
@example("1 " + " " * 5_000 + "\n1")
@example("1 m*9^9^9^9")
def test_junk_is_a_quantity_or_a_quantity_error(text):
    for dimension in ("acceleration", "number"):
        try:
            quantity = parse_quantity(text, dimension, "key")
        except QuantityError:
            continue
        assert math.isfinite(quantity.value)
        assert 0.0 <= quantity.u < math.inf


def test_shown_values_stay_short():
    assert shown("5 s") == "'5 s'"
    assert len(shown("x" * 1000)) == 80
