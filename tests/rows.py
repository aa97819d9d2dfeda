"""Tables of small cases: one test that goes through all rows and reports each that fails."""

import functools
import inspect

import pytest


def for_each(names, rows):
    """Go through all rows in one test, as `pytest.mark.parametrize` would in many; fixtures are those of the one test.

    ``names`` are those of the columns, separated by commas or in a tuple; rows of one column hold the value itself.
    """
    columns = names.replace(",", " ").split() if isinstance(names, str) else list(names)
    cases = [dict(zip(columns, row if len(columns) > 1 else (row,), strict=True)) for row in rows]

    def over(test):
        @functools.wraps(test)
        def go_through(*args, **fixtures):
            wrong = []
            for case in cases:
                try:
                    test(*args, **fixtures, **case)
                except (Exception, pytest.fail.Exception) as error:
                    error.add_note(f"row: {case}")
                    wrong.append(error)
            if wrong:
                raise BaseExceptionGroup(f"{len(wrong)} of {len(cases)} rows are wrong", wrong)

        asked = inspect.signature(test)
        others = [each for name, each in asked.parameters.items() if name not in columns]
        go_through.__signature__ = asked.replace(parameters=others)
        return go_through

    return over
