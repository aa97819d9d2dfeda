"""Draws the pictures of docs/published/zhao-2023.md: into this folder, or into the one given."""

import sys
from pathlib import Path

import numpy as np

from inercal.foundation.rigs.outputs import table_outputs
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import averages, exact
from inercal.systems.turntable.figures.sensitivity import maps, mean_indices

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
chain = turntable("two_axis_turntable", uniform(np.radians(2.0 / 60.0)))
outputs = table_outputs(("ax", "ay", "az", "wx", "wy"), gravity=9.8, latitude=np.radians(39.1))
indices = exact.analyse(chain, outputs, grid((36, 36)).angles)
for name, picture in (
    ("zhao-2023-figure-4.svg", mean_indices(indices, averages.mean(indices))),
    ("zhao-2023-figure-5.svg", maps(indices, chain.joints, ())),
):
    (folder / name).write_text(picture.svg, encoding="utf-8")
