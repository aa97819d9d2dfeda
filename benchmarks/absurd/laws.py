"""What holds for every run, however absurd: a sound result, an honest verdict, or a refusal in one sentence."""

import json
import math

import numpy as np

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.results.files import to_json
from inercal.foundation.results.result import Estimate

FAR = 1000.0
"""Standard uncertainties by which the result of a run that obeys its study must not be off, where it is called ok."""


UNKNOWN = ("condition", "nis_mean")
"""Statistics that may be unknown in a result that is ok: the condition of positions that leave open what was not asked
for, the NIS of a recording of less than 2 s."""


def of_refusal(error):
    """What is wrong with a refusal: it is one sentence of an `InputError`."""
    text = str(error)
    if not isinstance(error, InputError):
        return [f"refused by {type(error).__name__}: {text[:200]}"]
    if not text or "\n" in text or len(text) > 800 or "nan" in text.lower().replace("nan_", "").split():
        return [f"the refusal is no sentence: {text[:200]!r}"]
    return []


def of_estimate(estimate: Estimate):
    """What is wrong with an estimate."""
    wrong = []
    p = len(estimate.names)
    arrays = {
        "values": (estimate.values, (p,)),
        "covariance": (estimate.covariance, (p, p)),
        "k": (estimate.k, (p,)),
    }
    if estimate.common is not None:
        arrays["common"] = (estimate.common, (p, p))
    for name, (array, shape) in arrays.items():
        if np.shape(array) != shape:
            wrong.append(f"{name} has the shape {np.shape(array)}")
        elif not np.isfinite(array).all():
            wrong.append(f"{name} is not finite")
    if not (np.asarray(estimate.dof) > 0.0).all():
        wrong.append("dof is not above zero")
    wrong = wrong or of_covariance(estimate.covariance, "covariance")
    if wrong:
        return wrong
    if not isinstance(estimate.status, Status):
        wrong.append(f"the status is {estimate.status!r}")
    if not estimate.message or "\n" in estimate.message:
        wrong.append(f"the message is no sentence: {estimate.message!r}")
    for item in estimate.budget:
        if not math.isfinite(item.u) or item.u < 0.0:
            wrong.append(f"budget: u of {item.source} is {item.u}")
        if not all(math.isfinite(share) and share >= -1e-6 for share in item.share.values()):
            wrong.append(f"budget: a share of {item.source} is no part")
    for finding in estimate.findings:
        if not finding.message or "\n" in finding.message:
            wrong.append(f"finding {finding.code}: {finding.message!r}")
    if any(
        "nan" in words.split() for words in (estimate.message, *(each.message for each in estimate.findings))
    ):
        wrong.append("a sentence says nan")
    if estimate.status is Status.OK:
        wrong += [
            f"statistics: {name} is {value}, and the status ok"
            for name, value in estimate.statistics.items()
            if not math.isfinite(value) and name not in UNKNOWN
        ]
    json.dumps(to_json(estimate), allow_nan=False)
    estimate.table()
    return wrong


def of_covariance(P, name):
    """What is wrong with a covariance: it is symmetric, and no combination has a negative variance beyond rounding."""
    variance = np.diag(P)
    if (variance < 0.0).any():
        return [f"{name}: a variance is negative"]
    u = np.sqrt(variance)
    u[u == 0.0] = 1.0
    with np.errstate(under="ignore"):
        R = P / u[:, None] / u[None, :]
    if not np.isfinite(R).all():
        return [f"{name}: a covariance is beyond its variances"]
    if np.abs(R - R.T).max(initial=0.0) > 1e-9:
        return [f"{name}: not symmetric"]
    lowest = np.linalg.eigvalsh(0.5 * (R + R.T)).min(initial=0.0)
    return [f"{name}: lowest eigenvalue of the correlations {lowest:.1e}"] if lowest < -1e-6 else []


def of_truth(values, u, truth, names):
    """What is wrong with values of a run that obeys its study: none is off by many of its u."""
    off = np.abs(np.asarray(values) - truth) / np.maximum(u, 1e-300)
    rounding = np.abs(np.asarray(values) - truth) <= 1e-9 * np.abs(truth)
    return [
        f"{name} is off by {each:.3g} of its u, and the status ok"
        for name, each, small in zip(names, off, rounding, strict=True)
        if each > FAR and not small
    ]


def of_angles(angles):
    """What is wrong with angles: each has its uncertainty, or is unknown, and then so is that."""
    wrong = []
    for name, values, u in (("theta", angles.theta, angles.u), ("rate", angles.rate, angles.rate_u)):
        known = np.isfinite(values)
        if np.isinf(values).any():
            wrong.append(f"{name} of {angles.method} is infinite")
        if not (np.isfinite(u[known]).all() and (u[known] >= 0.0).all()):
            wrong.append(f"u of a known {name} of {angles.method} is no number")
        if np.isfinite(u[~known]).any():
            wrong.append(f"u of an unknown {name} of {angles.method} is a number")
    return wrong
