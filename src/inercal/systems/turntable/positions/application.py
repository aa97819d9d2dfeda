"""Application of a calibration: what it needs beside coefficients, of stated terms, outputs, table and gravity."""

from __future__ import annotations

from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.rigs.chain import Fixed, Joint
from inercal.systems.turntable.model import stated_values
from inercal.systems.turntable.regression import Regression
from inercal.systems.turntable.settings import TurntableSettings


def in_use(fit: Regression, slope: Array, settings: TurntableSettings, unit: str) -> dict[str, Any]:
    """Keys of the result from which `inercal apply` rebuilds the instrument.

    Parameters
    ----------
    fit : Regression
    slope : (p, p)
        Change of the terms with the linear coefficients.
    settings : TurntableSettings
    unit : str
        SI unit of the outputs.

    Returns
    -------
    dict
        ``stated``: value, u and unit of each stated term, and the ``covariance`` (p,) of its error with those of the
        fitted terms; ``unit`` of the outputs by sensor; ``attitude``: joints and fixed rotations of the table, from the
        base; ``gravity_m_s2`` of the site.
    """
    gain = np.einsum("pq,qnc->pnc", slope, fit.gain)
    beside, columns = fit.model.beside(fit.angles, fit.c)
    # the true term is larger by e than stated: the fit finds its own terms larger by what e makes, so the signs differ
    moves = {
        each.term: -each.u * np.einsum("pnc,nc->p", gain, columns[..., k])
        for k, each in enumerate(beside)
        if each.term
    }
    typed = settings.instrument.coefficients_u
    stated = {}
    for fixed in fit.model.stated:
        values = stated_values(settings, fixed.channel)
        for symbol, value in zip(fixed.channel.symbols, values.tolist(), strict=True):
            u = float(typed.get(symbol, 0.0))
            move = moves.get(symbol, np.zeros(len(slope)))
            stated[symbol] = {
                "value": value,
                "u": u,
                "unit": TERMS[symbol].unit_for(unit),
                "covariance": (u * move).tolist(),
            }
    sensor = fit.model.channels[0].channel.partition("_")[0]
    attitude: list[dict[str, Any]] = []
    for element in fit.model.chain.elements:
        if isinstance(element, Joint):
            attitude.append({"joint": element.name, "axis": element.axis})
        elif isinstance(element, Fixed):
            attitude.append({"rotation": element.rotation.tolist()})
    return {
        "stated": stated,
        "unit": {sensor: unit},
        "attitude": attitude,
        "gravity_m_s2": settings.site.gravity,
    }
