"""A record as lines of a stream, and what comes out of an estimator row by row."""

import io

import numpy as np

from inercal.faces.stream.lines import Lines
from inercal.faces.stream.run import run
from inercal.foundation.records.write import number


def lines_of(record, say):
    """The rows of a record as a stream has them."""
    names = list(record.columns)
    t = record[names[0]].t
    head = ",".join(["t [s]", *(f"{name} [{record[name].unit.symbol}]" for name in names)])
    rows = np.column_stack([t, *(record[name].values for name in names)]).tolist()
    text = "\n".join([head, *(",".join(map(number, row)) for row in rows)]) + "\n"
    return Lines(io.BytesIO(text.encode()), "standard input", None, say)


def streamed(make, record):
    """Columns and rows of numbers, NaN for nothing, that ``make(lines, say)`` gives; and all codes of its alarms."""
    codes, out = [], []

    def say(finding):
        codes.append(finding.code)

    lines = lines_of(record, say)
    estimator = make(lines, say)
    run(estimator, lines, out.append)
    head, *rows = out
    values = [[float(cell) if cell else np.nan for cell in row.split(",")] for row in rows]
    return head.split(","), np.array(values, dtype=float).reshape(len(values), head.count(",") + 1), codes
