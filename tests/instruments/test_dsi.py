"""Units of digital certificates, and the reference types of coefficients."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inercal.foundation.errors import QuantityError
from inercal.foundation.instruments.dsi import (
    as_written,
    dsi,
    from_dsi,
    is_coherent,
    reference_type,
    reference_types,
    stated,
)
from inercal.foundation.instruments.terms import MODEL_TERMS, NOISE_TERMS, NUMBERED_TERMS, TERMS
from inercal.foundation.units import parse_unit
from rows import for_each


@for_each(
    ("unit", "text", "size"),
    [
        ("m/s^2", r"\metre\second\tothe{-2}", 1.0),
        ("rad/s", r"\radian\second\tothe{-1}", 1.0),
        ("1", r"\one", 1.0),
        ("count", r"\one", 1.0),
        ("deg/h", r"\radian\second\tothe{-1}", math.pi / 180 / 3600),
        ("(deg/s)/(rad/s)", r"\one", math.pi / 180),
        ("g/(m/s^2)", r"\one", 9.80665),
        ("mV/(m/s^2)^2", r"\volt\metre\tothe{-2}\second\tothe{4}", 1e-3),
        ("rad/s/sqrt(s)", r"\radian\second\tothe{-1.5}", 1.0),
        ("count*sqrt(s)", r"\second\tothe{0.5}", 1.0),
        ("(m/s^2)/K^2", r"\metre\second\tothe{-2}\kelvin\tothe{-2}", 1.0),
        ("degC", r"\degreecelsius", 1.0),
    ],
)
def test_units_by_hand(unit, text, size):
    assert dsi(unit) == (text, pytest.approx(size, rel=1e-15))


OTHERS = {
    r"\metre\per\second\tothe{2}": "m/s^2",
    r"\milli\metre": "mm",
    r"\degreecelsius": "degC",
    r"\one": "1",
    r"\second\tothe{-0.5}": "1/sqrt(s)",
    r"\bel": r"\bel",
    "mm Hg": "mm Hg",
}


@for_each(("text", "unit"), list(OTHERS.items()))
def test_units_of_others(text, unit):
    assert from_dsi(text) == unit


@for_each("unit", ["", "m s", "(m)(s)", "m//s^2", "(m", "m)", "parrot", "m^", "m s^2^^2", "^2"])
def test_what_is_no_unit_is_refused(unit):
    with pytest.raises(QuantityError):
        dsi(unit)
    assert stated(unit) is None


ATOMS = st.sampled_from(["m", "s", "rad", "K", "V", "count", "deg", "g", "h", "mV", "arcsec"])
UNITS = st.recursive(
    ATOMS,
    lambda inner: (
        st.tuples(inner, st.sampled_from("*/"), inner).map(lambda each: f"({each[0]}){each[1]}({each[2]})")
        | inner.map(lambda each: f"({each})^2")
        | inner.map(lambda each: f"sqrt({each})")
    ),
    max_leaves=5,
)


@given(UNITS)
def test_size_and_dimension_are_those_of_the_factors(unit):
    """Against numbers: each unit as its SI size times a power of a prime for its dimension, evaluated by Python."""
    primes = {"metre": 2.0, "second": 3.0, "radian": 5.0, "kelvin": 7.0, "volt": 11.0}
    bases = {"m": 2.0, "s": 3.0, "rad": 5.0, "deg": 5.0, "arcsec": 5.0, "K": 7.0, "V": 11.0, "mV": 11.0, "count": 1.0,
             "g": 2.0 / 9.0, "h": 3.0}  # fmt: skip
    known = {name: base * parse_unit(name).factor for name, base in bases.items()}
    expected = eval(unit.replace("^", "**"), {"sqrt": math.sqrt, **known})
    text, size = dsi(unit)
    for name, prime in primes.items():
        text = text.replace(f"\\{name}\\tothe{{", f"*{prime}**({{").replace(f"\\{name}", f"*{prime}")
    product = eval("1.0" + text.replace("\\one", "").replace("({", "(").replace("}", ")"))
    assert product * size == pytest.approx(expected, rel=1e-12)


def test_every_unit_of_the_terms_can_be_written_and_read():
    outputs = ("m/s^2", "rad/s", "count", "deg/s", "V", "g")
    terms = [*TERMS.values(), *MODEL_TERMS.values(), *NUMBERED_TERMS.values(), *NOISE_TERMS.values()]
    for unit in {term.unit_for(output) for term in terms for output in outputs}:
        text, size = dsi(unit)
        assert np.isfinite(size)
        assert dsi(f"({unit})/({from_dsi(text)})") == ("\\one", pytest.approx(size, rel=1e-15))
        assert (as_written(unit) == text) == is_coherent(unit) or unit == text


def test_a_reference_type_has_one_meaning():
    """Every term has a type, and terms of one type differ in axis, number or channel alone: unit and words agree."""
    types = reference_types()
    for name, term in {**TERMS, **MODEL_TERMS}.items():
        kind = reference_type(name)
        assert types[kind][1] == term.unit, name
    names = [
        "M_xy",
        "N_gyro_x",
        "b_2",
        "K0_x_T1",
        "acc_x_hyst",
        "S_2",
        "S_x",
        "G_xy",
        "G_xyz",
        "eta_pz",
        "k_x",
        "K_gyro_z",
    ]
    kinds = ["M", "N", "b", "K0_T1", "output_hyst", "S_number", "S", "G", "G2", "eta", "k", "K"]
    assert [reference_type(name) for name in names] == [f"inertial_{kind}" for kind in kinds]
    assert reference_type("parrot") is None
    assert types["inertial_M"][0] == "misalignment: response of accelerometer i to specific force along j"
