"""Findings: what is suspicious about a recording or a result, said and left to the user to decide."""

from __future__ import annotations

from dataclasses import dataclass

#: code -> what it means. Codes are a contract; more may be added.
CODES: dict[str, str] = {
    "gap": "samples are missing",
    "duplicate_time": "a time stamp is repeated",
    "backward_time": "time runs backward",
    "nan": "values are missing or not numbers",
    "bad_row": "rows that cannot be read as numbers",
    "truncated": "the file ends within a row",
    "file_changed": "a file was written to while it was read",
    "saturation": "a sensor sits at an extreme of its range",
    "dead_channel": "a channel never changes",
    "rate_change": "the sample rate changes",
    "other_clock": "channels have clocks of their own",
    "unit_suspect": "the values do not fit the stated unit",
    "sign_suspect": "an axis looks reversed",
    "channel_swap": "axes look exchanged",
    "stuck_encoder": "an angle stands still while the instrument turns",
    "command_shift": "commanded and measured motion are shifted in time",
    "wrap_2pi": "an angle jumps by a full turn",
    "at_prior": "a parameter is no better known than before the measurement",
    "gimbal_lock": "two axes of the gimbals come close to each other",
    "outlier": "single samples far from their neighbours",
    "contradiction": "sensors contradict each other",
    "gyro_missing": "there are no gyro channels, or they cannot be calibrated",
    "gyro_restless": "the gyro is too restless in the holds to help in finding them",
    "g_sensitivity": "the gyro output changes with the pose",
    "bias_drift": "a bias drifts over the recording",
    "between_runs": "a coefficient changes from run to run by more than its uncertainty",
    "stated_exact": "a quantity of the study was stated without an uncertainty",
    "unused_labels": "labels of a recording that were of no use",
    "hysteresis": "values on rising and on falling temperature differ",
    "outside_range": "a value is stated outside the range it was measured over",
    "excess_scatter": "the scatter of the residuals exceeds what the sensor noise explains",
    "few_degrees_of_freedom": "hardly more data than unknowns",
    "resolution": "steps of the output hide its noise, or numbers have more digits than can be kept",
    "poor_section": "a section of the recording does not hold what it should",
    "turn_cut": "a turn goes on beyond its section",
    "turn_doubtful": "which motion is a turn is not certain",
    "skipped_turn": "a turn was left out of the fit",
    "stated_earth_rate": "earth rate is subtracted and its terms are not fitted",
    "uncertain_site": "gravity or earth rate is known so badly that it rules the uncertainties",
    "whole_turns": "the angle of a turning axis is not known, and whole turns are taken for granted",
    "weak_term": "a term is hardly known",
    "noise_misfit": "the noise is not of the kinds that are fitted",
    "large_errors": "errors of the table are so large that their squares matter",
    "not_stated": "a file does not state what a calibration should",
    "not_held": "something of a calibration is not taken along",
    "other_frame": "the axes are not those of the calibration",
    "no_coefficients": "nothing is known of the instrument by which table errors act",
    "not_at_rest": "the instrument moves, or is disturbed, where it should be at rest",
    "bad_verdict": "a calibration that is used ended with a bad verdict",
    "other_model": "two calibrations are not of the same kind",
    "same_recording": "two calibrations rest on the same recording",
    "goal_missed": "a coefficient is less well known than wanted",
    "flexure": "the support of the model shakes its sensors",
    "unmodelled": "the recording shows errors that the model leaves out",
    "site_suspect": "earth rate or gravity does not fit the stated site",
    "low_scatter": "the scatter of the residuals is below what the stated noise explains",
    "prior_suspect": "a value is far outside what its prior allows",
    "filter_fails": "an estimator fails on a sound recording",
    "perhaps_common": "sources that may act alike in two calibrations",
    "failed_case": "a case of the validation did not pass",
}


@dataclass(frozen=True)
class Finding:
    """One thing worth knowing: a code of `CODES`, a sentence, and where it was seen."""

    code: str
    message: str
    where: str = ""

    def __post_init__(self) -> None:
        """Refuse a code that is not in the table."""
        if self.code not in CODES:
            raise ValueError(f"unknown finding code {self.code!r}")
