"""``inercal validate``."""

from __future__ import annotations

from dataclasses import replace

from inercal.cli import process_age
from inercal.cli.options import ResultOutput, reading
from inercal.cli.outcome import WHOLE, hand_over


def validate(*, output: ResultOutput = ResultOutput()) -> int:  # noqa: B008  (frozen)
    """Rerun the published and closed-form cases."""
    from inercal.faces.report.validation import page, table
    from inercal.faces.validate.run import executor
    from inercal.faces.validate.run import validate as run
    from inercal.foundation._jit import compiling

    output.check(WHOLE)
    with compiling("validate", output.say), reading(output, "validating") as progress:
        estimate = run(executor(), progress)
    estimate = replace(estimate, timing={**estimate.timing, "total": process_age()})
    return hand_over(estimate, [table(estimate)], lambda: page(estimate), output, "record")
