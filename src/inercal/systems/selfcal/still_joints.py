"""Joints that stand still, and the states of a rig that nobody can then tell from others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import BETA
from inercal.systems.selfcal.platform.kinematics import axes_of
from inercal.systems.selfcal.platform.rig import JOINTS
from inercal.systems.selfcal.platform.states import ALL, STATES, twins
from inercal.systems.selfcal.settings import SelfcalSettings


def still_joints(settings: SelfcalSettings, th: Array) -> tuple[int, ...]:
    """Joints 0, 1, 2 that are fixed, or stand still along angles ``th`` (n, 3) [rad]."""
    still = np.nanmax(th, axis=0) - np.nanmin(th, axis=0) < LIMITS.still_joint
    return tuple(sorted({*settings.unread, *np.flatnonzero(still).tolist()}))


def told_apart(
    settings: SelfcalSettings, still: Sequence[int], th: Array
) -> tuple[SelfcalSettings, tuple[Finding, ...]]:
    """The study without states that nobody can tell from others where joints ``still`` do not turn from angles ``th``
    (3,) [rad]; ``at_prior`` names them. What is known of them is added to the prior of the others, about each axis."""
    left = twins(settings.kinds, still, axes_of(th, settings.gimbals.index, settings.gimbals.sign).tolist())
    if not left:
        return settings, ()
    joints = ", ".join(JOINTS[joint] for joint in still)
    verb = "stands" if len(still) == 1 else "stand"
    others = " and ".join(sorted({*left.values()}))
    text = f"{', '.join(left)}: {joints} {verb} still, they cannot be told from {others} and are left out"
    priors, model = settings.priors, settings.model
    prior, stated = settings.prior.copy(), dict(model.stated)
    for name, kind in left.items():
        u = float(priors[ALL.index(name)])
        if kind == "beta":
            prior[BETA] = np.hypot(prior[BETA], u)
        else:
            for other in STATES[kind].parameters:
                value, own = stated.get(other, (0.0, float(priors[ALL.index(other)])))
                stated[other] = value, math.hypot(own, u)
    model = replace(model, left_out=tuple(left), stated=stated)
    return replace(settings, model=model, prior=prior), (Finding("at_prior", text),)


def without_fixed(settings: SelfcalSettings) -> tuple[SelfcalSettings, tuple[Finding, ...]]:
    """`told_apart` where the joints that the study states as fixed do not turn."""
    return told_apart(settings, settings.unread, settings.fixed_angles)
