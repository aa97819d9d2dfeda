"""A toy in Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from inercal.estimate.result import without_coefficients
from inercal.face.recordings import record
from inercal.face.result import Result, loaded
from inercal.face.study import Study
from inercal.records.record import Record


def calibrate(records: Sequence[Record], study: Study, compare: bool, say: Callable[[str], None]) -> Result:
    """The mean of the channel ``acc_x``."""
    mean = float(records[0]["acc_x"].values.mean())
    return loaded(without_coefficients("calibrate toy", f"a mean of {mean:.4g}", {"mean": mean}))


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A record of noise about the true mean."""
    return record(acc_x=study.settings.mean + rng.standard_normal(1000), rate=100.0)
