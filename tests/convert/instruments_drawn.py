"""Random instruments for the conversions, and what a conversion there and back must keep."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from inercal.faces.convert.correct import ImuModel
from inercal.faces.convert.other_tools import CONVENTIONS
from inercal.foundation.findings import Status
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit

seeds = st.integers(0, 2**32 - 1)


def triad(rng: np.random.Generator, upper: bool) -> TriadModel:
    """Scale factors of any size and sign, misalignments to 0.2 rad, a bias of any size up to 100 SI units."""
    scale = 10.0 ** rng.uniform(-3, 4) * rng.uniform(0.9, 1.1, 3) * rng.choice([-1, 1], 3)
    off = rng.uniform(-0.2, 0.2, (3, 3))
    off = np.triu(off, 1) if upper else off - np.diag(np.diag(off))
    return TriadModel(scale, np.eye(3) + off, scale * rng.uniform(-100, 100, 3))


def instrument(seed: int, upper: bool = True, sensitive: bool = True) -> ImuModel:
    """An instrument with outputs in some unit."""
    rng = np.random.default_rng(seed)
    gyro = triad(rng, upper=False)
    G = np.abs(gyro.scale)[:, None] * rng.uniform(-1e-2, 1e-2, (3, 3)) if sensitive else np.zeros((3, 3))
    units = {
        "acc": str(rng.choice(["count", "m/s^2", "g", "V"])),
        "gyro": str(rng.choice(["count", "deg/s", "V"])),
    }
    return ImuModel(triad(rng, upper), gyro, G, units)


def corrected(model: ImuModel, motion: tuple[np.ndarray, np.ndarray], units: dict[str, str]):
    """What a model makes of samples given in ``units``, in its own units of them."""
    factors = [parse_unit(units[s]).factor / parse_unit(model.units[s]).factor for s in ("acc", "gyro")]
    return model.correct(*(samples * factor for samples, factor in zip(motion, factors, strict=True)))


def there_and_back(model: ImuModel, name: str) -> ImuModel:
    """Through the text of another tool's files, as a program that knows nothing else would."""
    from inercal.faces.convert.convention import in_si_outputs

    convention = CONVENTIONS[name]
    given = in_si_outputs(model) if convention.si else model
    texts = convention.render(convention.terms(given), given.units)
    terms, units = convention.parse([(name, text) for text in texts.values()])
    return convention.model(terms, units)


def assert_same_corrections(model: ImuModel, other: ImuModel, seed: int) -> None:
    """Equal corrections of random outputs, to rounding of what is subtracted in them."""
    rng = np.random.default_rng(seed)
    f, omega = rng.uniform(-20, 20, (50, 3)), rng.uniform(-5, 5, (50, 3))
    outputs = model.indicate(f, omega)
    for found, true in zip(corrected(other, outputs, model.units), (f, omega), strict=True):
        np.testing.assert_allclose(found, true, rtol=0, atol=1e-12 * 100)


def estimate_of(model: ImuModel, rng: np.random.Generator, relative_u: float = 1e-5) -> Estimate:
    """A calibration that says the model, with a full random covariance."""
    from inercal.faces.convert.other_tools import coefficients

    values = coefficients(model)
    x = np.array(list(values.values()))
    size = np.array([abs(v) if name[0] in "KSDG" else 1.0 for name, v in values.items()])
    A = rng.standard_normal((len(x), len(x))) / np.sqrt(len(x))
    covariance = relative_u**2 * np.outer(size, size) * (A @ A.T)
    return Estimate(
        "calibrate imu",
        tuple(values),
        ("1",) * len(x),
        x,
        covariance,
        np.full(len(x), 20.0),
        Status.OK,
        "made",
        result={"unit": dict(model.units)},
    )
