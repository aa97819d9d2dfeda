"""A table of cases in one test: every row is tried, and each that fails is told."""

import pytest

from rows import for_each


def test_every_row_is_tried_and_each_wrong_one_is_told(tmp_path):
    tried = []

    @for_each("number, square", [(1, 1), (2, 5), (3, 9), (4, 0)])
    def check(folder, number, square):
        tried.append((folder, number))
        if number == 4:
            pytest.fail("four")
        assert number**2 == square

    with pytest.raises(BaseExceptionGroup, match="2 of 4 rows are wrong") as caught:
        check(folder=tmp_path)
    assert tried == [(tmp_path, number) for number in (1, 2, 3, 4)]
    notes = [note for error in caught.value.exceptions for note in error.__notes__]
    assert notes == ["row: {'number': 2, 'square': 5}", "row: {'number': 4, 'square': 0}"]


@for_each("value", ["a", "b"])
def test_fixtures_stay_fixtures(value, tmp_path):
    (tmp_path / value).touch()
    assert value in ("a", "b")
