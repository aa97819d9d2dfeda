"""Tables of texts: columns stand below each other, words from the left and numbers to the right."""

from inercal.foundation.results.shown import Table, aligned, heads

ROWS = (("", "value", "unit"), ("K0_x", "-1.25", "µg"), ("K1", "3", "1"))


def test_words_begin_at_the_left_and_numbers_end_at_the_right():
    assert aligned(ROWS, (0, 2)) == ["      value  unit", "K0_x  -1.25  µg", "K1        3  1"]
    assert aligned(ROWS[1:], (0, 1, 2), " ") == ["K0_x -1.25 µg", "K1   3     1"]
    assert aligned([]) == []


def test_a_table_is_aligned_below_its_heads():
    table = Table("", "", heads("case", "time [s]"), (("a", "1.5"), ("longer", "20")))
    assert table.text().splitlines() == ["case    time [s]", "a            1.5", "longer        20"]
    assert Table("", "", heads("case"), ()).text() == ""
