"""The table of terms: the names and units that are a contract."""

import re

from inercal.foundation.instruments.by_angle import CHANNELS, EXTRA, channel_model
from inercal.foundation.instruments.terms import ACCELEROMETER_TRIAD, GYRO_G_SENSITIVITY, GYRO_TRIAD, TERMS
from rows import for_each


def test_names_of_the_contract():
    """interfaces.md: K0_x, K1_x, M_xy.. (accelerometer triad), D_F_x, S_x, T_xy.. (gyro triad)."""
    assert ACCELEROMETER_TRIAD == (
        "K0_x", "K0_y", "K0_z", "K1_x", "K1_y", "K1_z", "M_xy", "M_xz", "M_yz",
    )  # fmt: skip
    assert GYRO_TRIAD == (
        "D_F_x", "D_F_y", "D_F_z", "S_x", "S_y", "S_z", "T_xy", "T_xz", "T_yx", "T_yz", "T_zx", "T_zy",
    )  # fmt: skip
    assert tuple(f"G_{i}{j}" for i in "xyz" for j in "xyz") == GYRO_G_SENSITIVITY


def test_every_term_once_and_in_the_order_of_results():
    triads = ACCELEROMETER_TRIAD + GYRO_TRIAD + GYRO_G_SENSITIVITY
    assert tuple(TERMS)[: len(triads)] == triads
    for symbol, term in TERMS.items():
        assert term.symbol == symbol
        assert term.symbol.startswith("tau_") or re.search(r"\b[xyzXYZ]\b", term.name)


def test_every_term_of_an_instrument_on_a_table_is_in_the_table():
    for kind, channels in CHANNELS.items():
        symbols = [symbol for channel in channels for symbol in channel_model(kind, channel).symbols]
        assert len(set(symbols)) == len(symbols)
        assert set(symbols) <= set(TERMS)
    assert set(EXTRA) <= set(TERMS)


def test_the_names_of_the_terms_are_told_apart():
    assert len({term.name for term in TERMS.values()}) == len(TERMS)


@for_each(
    ("symbol", "output", "unit"),
    [
        ("K0_x", "m/s^2", "m/s^2"),
        ("K0_x", "count", "count"),
        ("K1_y", "count", "count/(m/s^2)"),
        ("K1_y", "m/s^2", "(m/s^2)/(m/s^2)"),
        ("M_xy", "count", "rad"),
        ("D_F_z", "deg/s", "deg/s"),
        ("S_z", "V", "V/(rad/s)"),
        ("S_z", "deg/s", "(deg/s)/(rad/s)"),
        ("T_zx", "deg/s", "rad"),
        ("G_xz", "deg/h", "(deg/h)/(m/s^2)"),
    ],
)
def test_units_by_the_unit_of_the_output(symbol, output, unit):
    """Biases in the output's unit, scale factors per SI unit, misalignments in rad."""
    assert TERMS[symbol].unit_for(output) == unit
