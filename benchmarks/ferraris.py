"""The Ferraris calibration of the shipped session in physical units beside imucal.

    python benchmarks/ferraris.py [--quick]

Both get the data in memory and the same sections. Ours is the fit of all sections, with the covariance of the
coefficients, the budget and the verdict; its closed form alone, which is what imucal does, is beside it.
"""

import os
import tomllib

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import imucal
import numpy as np
import pandas as pd
from measure import Row, Spread, alone, in_turn, named, row

from inercal.examples import FOLDER
from inercal.faces.studies.ferraris import FerrarisTable, ferraris_settings
from inercal.foundation.geometry.earth import Site
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.systems.imu.ferraris.calibration import calibrate_ferraris
from inercal.systems.imu.ferraris.closed_form import imucal_coefficients
from inercal.systems.imu.ferraris.nine import nine_sections
from inercal.systems.imu.sections.cutting.proposal import RecordedTriads
from inercal.systems.imu.settings import ImuSettings

NAME, RATE, GRAVITY = "ferraris-si", 102.4, 9.81


def rows(quick: bool) -> list[Row]:
    study = tomllib.loads((FOLDER / f"{NAME}.toml").read_text())
    told = ferraris_settings(FerrarisTable.model_validate(study["imu"]["ferraris"]))
    settings = ImuSettings(Site(GRAVITY))
    record = read([FOLDER / f"{NAME}.csv.gz"], read_map(FOLDER / f"{NAME}-map.toml"))
    data = pd.read_csv(FOLDER / f"{NAME}.csv.gz")
    spans = pd.DataFrame({name: {"start": a, "end": b} for name, (a, b) in told.sections.items()}).T
    whole = calibrate_ferraris(record, settings, told)

    def theirs():
        regions = imucal.ferraris_regions_from_section_list(data, spans)
        return imucal.FerrarisCalibration(grav=GRAVITY, expected_angle=np.degrees(told.turn)).compute(
            regions, RATE, from_acc_unit="m/s^2", from_gyr_unit="deg/s"
        )

    def closed_form():
        triads, nine = RecordedTriads.of(NAME, record), nine_sections(record, NAME, told)
        stretches = {row.section: (triads.stretch(row),) for row in nine.rows}
        return imucal_coefficients(stretches, told.turn, GRAVITY)

    seconds = in_turn(
        {
            "theirs": theirs,
            "whole": lambda: calibrate_ferraris(record, settings, told),
            "values": closed_form,
        },
        1 if quick else 30,
    )
    info = theirs()
    ours = whole.estimate.result["imucal"]
    away = float(
        np.max(np.abs([ours[f"K1_{i}"] / (info.K_a @ info.R_a)[k, k] - 1 for k, i in enumerate("xyz")]))
    )
    what, size, peer, unit = "Ferraris calibration", f"{len(data)} rows", named("imucal"), ("ms", 1e3)
    return [
        row(f"{what}, with uncertainties", size, unit, seconds["whole"], peer, seconds["theirs"]),
        row(f"{what}, closed form", size, unit, seconds["values"], peer, seconds["theirs"]),
        Row(
            f"{what}, relative difference",
            "diagonal of K_a R_a",
            "1",
            Spread(away, away, away),
            peer,
            at_most=1e-9,
        ),
    ]


if __name__ == "__main__":
    alone(rows, __doc__)
