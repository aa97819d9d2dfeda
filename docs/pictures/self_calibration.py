"""Draws the pictures of self-calibration in docs/published: into this folder, or into the one given."""

import sys
from pathlib import Path

import numpy as np

from inercal.foundation.geometry.earth import Site, gravity
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.figures import relative_errors
from inercal.systems.selfcal.figures.filters import attitude_errors, changes_of_turn
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.plan import path
from inercal.systems.selfcal.settings import Noise, SelfcalSettings
from inercal.systems.selfcal.simulate import experiment, simulate

DEG_H, ARCSEC, UG = (parse_unit(unit).factor for unit in ("deg/h", "arcsec", "ug"))
SIZES = np.repeat([DEG_H, ARCSEC, ARCSEC, ARCSEC, UG, 1e-6, 1e-6, ARCSEC], 3)
TRUTH = SIZES * [
    *(0.08, -0.06, 0.10, 60, -90, 120, 60, -45, 90, -75, 50, -100),
    *(100, -150, 200, 500, -300, 800, 0, 0, 0, 0, 0, 0),
]
PRIOR = SIZES * np.repeat([0.3, 300, 300, 300, 500, 1500, 100, 60], 3)
NOMINAL = Noise(5e-4 * parse_unit("deg/sqrt(h)").factor, 10 * UG, 2 * ARCSEC)

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
latitude = np.radians(40.0)
for name, figure in (("paper", 2), ("paper two turns", 4)):
    site = Site(float(gravity(latitude)), latitude=latitude)
    study = SelfcalSettings(site, NOMINAL, PRIOR, plan=path(name), truth=TRUTH)
    made = simulate(experiment(study), np.random.default_rng(1))
    quaternion, gimbal = (
        estimate(made.recording, problem(study), kind).history for kind in ("svd-qukf", "gimbal-ukf")
    )
    t = made.recording.t
    changes = changes_of_turn(t, made.recording.th)
    models = {"quaternion model": quaternion.attitude, "gimbal-angle model": gimbal.attitude}
    drawn = {f"self-calibration-figure-{figure}.svg": attitude_errors(t, made.attitude, models, changes)}
    if figure == 2:
        drawn["self-calibration-figure-3.svg"] = relative_errors(t, quaternion, TRUTH)
    for file, picture in drawn.items():
        (folder / file).write_text(picture.svg, encoding="utf-8")
