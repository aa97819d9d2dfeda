"""Calibrations of units turned by hand, of known truth, by the program's own simulator."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "tests" / "strapdown"))

import numpy as np
from grades import GRADES, drawn

from inercal.foundation.records.record import record_of
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.strapdown.model.coefficients import stated
from inercal.systems.strapdown.settings import ESTIMABLE, StrapdownSettings
from inercal.systems.strapdown.simulate import simulated
from inercal.systems.strapdown.task import calibrate

UNITS = {"acc": parse_unit("m/s^2"), "gyro": parse_unit("rad/s")}


def studies(settings: StrapdownSettings) -> dict[str, StrapdownSettings]:
    """The study, with the filter beside the batch; where biases walk without, and one that leaves walks and turns to
    the recording."""
    if not settings.noise.walks:
        return {"stated": replace(settings, filter="error-state")}
    noise = replace(settings.noise, gyro_walk=0.0, accelerometer_walk=0.0, estimate=ESTIMABLE)
    return {"stated": settings, "estimated": replace(settings, noise=noise)}


def apart(estimate: Estimate) -> float:
    """Largest difference of filter and batch over u."""
    batch, of_filter = (estimate.result["compare"][name] for name in ("batch", "error-state"))
    return max(abs(of_filter[name]["value"] - each["value"]) / each["u"] for name, each in batch.items())


@dataclass(frozen=True)
class Calibration:
    """Calibrations of a grade by their numbers, with one of its `studies`."""

    grade: str
    study: str
    seed: int

    def __call__(self, number: int) -> dict[str, object]:
        """Errors over u of the fit and as stated, NEES, chi-square over its degrees of freedom, u over bounds, the
        largest difference of filter and batch (empty without the filter), and the verdict. Where the noise was found,
        errors and NEES are of the stated u alone, which has what the sizes of the noise leave open."""
        true = GRADES[self.grade]
        settings = studies(true)[self.study]
        rng = np.random.default_rng([self.seed, number])
        c = drawn(true, rng)
        samples = simulated(true, c, rng)
        columns = [
            (f"{sensor}_{axis}", UNITS[sensor], values[:, i])
            for sensor, values in (("acc", samples.force), ("gyro", samples.rate))
            for i, axis in enumerate("xyz")
        ]
        made = calibrate(record_of(columns, samples.ts * np.arange(1, len(samples.rate) + 1)), settings)
        of, fit = made.estimate, made.fit
        u = np.array([of[name].u for name in of.names])
        error = np.array([of[name].value for name in of.names]) - stated(c, true.terms, true.frame)
        found = settings.noise != true.noise
        off, covariance = (error, of.covariance) if found else ((fit.c - c)[fit.free], fit.covariance)
        return {
            "z": (off / np.sqrt(np.diag(covariance))).tolist(),
            "z_stated": (error / u).tolist(),
            "nees": float(off @ np.linalg.solve(covariance, off)),
            "square": float(fit.chi2 / fit.dof),
            "growth": (u / np.array([of.result["bounds"][name] for name in of.names])).tolist(),
            "apart": [apart(of)] if settings.filter == "error-state" else [],
            "verdict": of.status.value,
        }
