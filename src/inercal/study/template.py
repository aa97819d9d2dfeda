"""The commented studies that ``inercal new`` writes."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path

_IMU = """\
# Study for `inercal calibrate imu`. Replace what is not so; take the "# " from keys that you know.
# Quantities are texts with a unit; "9.81744(2) m/s^2" is 9.81744 with a standard uncertainty of 0.00002.
#
# Next: inercal calibrate imu {files}

schema = 1                          # version of this format

[site]                              # its gravity is what the accelerometers are calibrated against
latitude = "45(26) deg"             # north positive [deg]; replace it: this is anywhere on Earth
height = "0(300) m"                 # above sea level [m]; replace it: this is most inhabited places
# gravity = "9.81744(2) m/s^2"      # local gravity if known [m/s^2]; wins over latitude and height

[imu]                               # how to calibrate
method = "multiposition"            # many poses held still by hand, no turntable
# static_start = "50 s"             # length of the still period at the start [s]; found if absent
# g_sensitivity = true              # also estimate how gyro drift depends on specific force [true, false]
# time_base = "20 ppm"              # relative standard uncertainty of the record's clock; 0 if absent

[traceability]                      # free texts that go with the result
# instrument = "model, serial no."  # the instrument
# operator = "name"                 # who made the recording
# date = "2026-01-31"               # when it was made
# reference = "order or report"     # number of the order, report or standard

[conditions]                        # during the recording
# temperature = "23 degC"           # temperature of the instrument [degC]
"""


def imu_template(
    record_paths: Iterable[str | Path] = (),
    study_path: str | Path = "STUDY.toml",
    map_path: str | Path | None = None,
) -> str:
    """A study for ``inercal calibrate imu`` with every key in it, each explained.

    It loads as it is; its latitude and height then stand for anywhere on Earth, with the uncertainty of
    gravity that goes with it.

    Parameters
    ----------
    record_paths : iterable of str or Path
        The recordings that the next command in the header names.
    study_path, map_path : str or Path
        The study and, if there is one, the column map that it names.
    """
    records = [str(path) for path in record_paths] or ["RECORD.csv"]
    column_map = [] if map_path is None else ["--map", str(map_path)]
    files = shlex.join([*records, *column_map, "--study", str(study_path)])
    files = files.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    return _IMU.replace("{files}", "".join(c if c.isprintable() else "?" for c in files))
