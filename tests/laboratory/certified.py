"""A laboratory, and results to certify."""

import datetime
from dataclasses import replace

import numpy as np
from made import result as made

from inercal.laboratory.certificate.lab import read_lab
from inercal.laboratory.certificate.written import certificate

DAY = datetime.date(2026, 2, 1)
LAB = """
persons = [{ name = "A. Smith", role = "head of laboratory", signs = true }, { name = "B. Jones" }]
[laboratory]
name = "Acme Calibration"
street = "Long Street 1"
post_code = "10115"
city = "Berlin"
country = "DE"
code = "D-K-1"
[customer]
name = "Flight Test"
city = "Bremen"
[order]
number = "A-17"
begin = 2026-01-30
end = 2026-01-31
[item]
maker = "Maker"
model = "Model"
serial = "17"
[conditions]
temperature = "23.0(5) degC"
humidity = "45(5) %"
[statements]
traceability = "Gravity is traceable to the gravity network."
remarks = ["Calibrated as received."]
"""


def lab_of(folder, text=LAB):
    """The laboratory of a text."""
    path = folder / "lab.toml"
    path.write_text(text)
    return read_lab(path)


def with_units(estimate, *units):
    """The result with other units, the numbers as they are."""
    return replace(estimate, units=units)


def certified(folder, *estimates, **more):
    """A certificate in a file: of a result in counts and SI unless others are given."""
    path = folder / "certificate.xml"
    given = estimates or (mixed(),)
    path.write_bytes(certificate(given, lab_of(folder), "C-1", DAY, **more))
    return path


def mixed(**more):
    """A result of which some units are no SI units, all digits of its numbers in use."""
    names = ("K0_x", "K1_x", "M_xy", "D_F_x", "N_gyro_x", "K2_x")
    units = ("count", "count/(m/s^2)", "rad", "deg/s", "rad/sqrt(s)", "1/(m/s^2)")
    found = with_units(made(names=names, **more), *units)
    conditions = {"temperature": {"value": 22.5, "u": 0.25, "unit": "degC"}, "site": {"gravity_m_s2": 9.8128}}
    return replace(
        found,
        conditions=conditions,
        model="y = K1 f + K0; f in m/s^2",
        dof=np.array([3.5, 12, 40, 1e3, np.inf, 7.0]),
    )
