"""The commented studies that ``inercal new`` writes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from inercal.rigs.plans import NAMED
from inercal.rigs.tables import Slot, slots
from inercal.studies.template_aoa import AOA
from inercal.studies.template_instrument import instrument_lines
from inercal.studies.template_selfcal import SELFCAL
from inercal.units import Unit

_HEAD = """\
# Study {what}. Replace what is not so; take the "# " from keys that you know.
# Quantities are texts with a unit; "9.81744(2) m/s^2" is 9.81744 with a standard uncertainty of 0.00002.
#
# Next: inercal {next}
"""

_IMU = """\

schema = 1                          # version of this format

[site]                              # its gravity is what the accelerometers are calibrated against
latitude = "45(26) deg"             # north positive [deg]; replace it: this is anywhere in the north
height = "0(300) m"                 # above sea level [m]; replace it: this is most inhabited places
# gravity = "9.81744(2) m/s^2"      # local gravity if known [m/s^2]; wins over latitude and height

[imu]                               # how to calibrate
method = "multiposition"            # many poses by hand; or "ferraris", six sides; or "aided", a table
# static_start = "50 s"             # length of the still period at the start [s]; found if absent
# g_sensitivity = true              # also estimate how gyro drift depends on specific force [true, false]
# bias_drift = true                 # also estimate how the gyro's bias drifts with time [true, false]
# time_base = "20 ppm"              # relative standard uncertainty of the record's clock; 0 if absent

# [imu.ferraris]                    # method "ferraris": each axis up and down, and a turn about each axis
# turn = "360(0.5) deg"             # angle of the turns, right-handed [deg]; 360 deg if absent
# alignment = "0.5 deg"             # uncertainty of their directions [deg]; by their scatter if absent

# [imu.ferraris.sections]           # start and end, as times or samples; by labels or detected if absent
# x_p = ["5.2 s", "12.4 s"]         # +x up; likewise x_a (-x up), y_p, y_a, z_p, z_a
# x_rot = ["70 s", "76 s"]          # the turn about x, from rest to rest; likewise y_rot, z_rot

# [imu.aided]                       # method "aided": the record has the table's angles phi1, phi2 (phi3)
# mounting = ["+x", "+y", "+z"]     # table axes, at zero angles, along which x, y, z of the instrument lie

# [imu.aided.rig]                   # the table; its errors and base as in a study of a turntable
# kind = "two_axis_turntable"       # outer axis y, inner z; or three_axis_turntable: z, y, x
"""

_TURNTABLE = """
schema = 1                          # version of this format

[site]                              # gravity and earth rate, in which the instrument turns
latitude = "45(26) deg"             # north positive [deg]; replace it: this is anywhere in the north
height = "0(300) m"                 # above sea level [m]; replace it: this is most inhabited places
# gravity = "9.81744(2) m/s^2"      # local gravity if known [m/s^2]; wins over latitude and height

[rig]                               # the turntable
kind = "two_axis_turntable"         # outer axis y, inner z; or three_axis_turntable: z, y, x

# An error is uniform, triangular or two_point (by its half width) or normal (by its standard deviation).
# Its scope is how long a value lasts: sample, position, run (a mounting) or rig (for good).
[rig.errors]                        # of the table; without a default only the named ones
default = { uniform = "2 arcmin" }  # [arcmin]; of every error below but the optional ones
{errors}
[rig.base]                          # known attitude of the base: level, and outer axis to the west, if absent
# azimuth = "0 deg"                 # about up, north to west positive [deg]
# tilt_north = "0 arcsec"           # about north [arcsec]
# tilt_west = "0 arcsec"            # about west [arcsec]

[rig.limits]                        # ranges of the axes; whole circles if absent
# phi1 = ["-90 deg", "90 deg"]      # lowest and highest outer angle [deg]
# phi2 = ["-180 deg", "180 deg"]    # of the next axis [deg]; phi3 of the inner axis of three

[positions]                         # where to stop: grid, plan, list or file
grid = { phi1 = 36, phi2 = 36, offset = "half" }  # numbers of angles; offset "none" starts at zero
# plan = "24-position"              # instead: {plans}
# list = [["0 deg", "45 deg"]]      # instead: the angles of each position
# file = "positions.csv"            # instead: a CSV as `inercal design positions` writes it, beside the study

[analysis]                          # of the sensitivity
outputs = ["ax", "ay", "az", "wx", "wy"]  # gravity and earth rate on the instrument's axes; wz too
method = "exact"                    # or "sampled", "local" (derivatives alone)
# sampling = "sobol"                # for sampled: scrambled Sobol points, or "random"
# samples = 1024                    # for sampled: rows at each position
# seed = 1                          # for sampled: of the random numbers

{instrument}
[design]                            # search for positions
positions = 24                      # how many
criterion = "D"                     # all coefficients together; "A" their mean variance, "I" of prediction
# table_errors = true               # judge with the errors of the table [true, false]
# candidates = { phi1 = 36, phi2 = 36, offset = "none" }  # to choose from
# compare = ["24-position"]         # named plans to set beside; all the table can take if absent
# sensitivity = { factors = ["dtheta_x"], outputs = ["ax"], below = 0.3 }  # only where these are below
# seed = 1                          # of the random starts

# [rate_test]                       # take the "# " from this line too where the table turns at rates (gyro)
# joint = "phi2"                    # axis that turns
# full_scale = "100 deg/s"          # what non-linearity is stated against [deg/s]; the largest if absent
# order = 1                         # 1 scale factor alone; 2, 3 with S2 and S3
# rates = ["-10 deg/s", "10 deg/s"] # of a simulation [deg/s]
# rate_uncertainty = "20 ppm"       # relative standard uncertainty of the table's rate; 0 if absent
# at = { phi1 = "90 deg" }          # angles of a simulation, where each stay begins; 0 if absent
"""

_COMMON = """
[traceability]                      # free texts that go with the result
# instrument = "model, serial no."  # the instrument
# operator = "name"                 # who made the recording
# date = "2026-01-31"               # when it was made
# reference = "order or report"     # number of the order, report or standard

[conditions]                        # during the recording
# temperature = "23 degC"           # temperature of the instrument [degC]
"""


def imu_template(
    record_paths: Sequence[str | Path] = (),
    study_path: str | Path = "STUDY.toml",
    map_path: str | Path | None = None,
    channels: Iterable[str] = (),
) -> str:
    """A study for ``inercal calibrate imu`` with every key in it, each explained.

    It loads as it is; its latitude and height then stand for anywhere in the north, with the uncertainty of
    gravity that goes with it.

    Parameters
    ----------
    record_paths : sequence of str or Path
        The recordings that the next command in the header names.
    study_path, map_path : str or Path
        The study and, if there is one, the column map that it names.
    channels : iterable of str
        Those of the recordings: a table's angles and labelled sections tell the method.
    """
    files = _files(record_paths or ["RECORD.csv"], study_path, map_path)
    found = set(channels)
    method = "aided" if "phi1" in found else "ferraris" if "label" in found else "multiposition"
    body = re.sub('(?m)^method = "multiposition"', f'method = "{method}"'.ljust(24), _IMU)
    return _HEAD.format(what="for `inercal calibrate imu`", next=f"calibrate imu {files}") + body + _COMMON


def turntable_template(
    record_paths: Sequence[str | Path] = (),
    study_path: str | Path = "STUDY.toml",
    map_path: str | Path | None = None,
    channels: Mapping[str, Unit | None] | None = None,
) -> str:
    """A study of a turntable with every key in it, each explained; arguments as for `imu_template`.

    ``channels`` are those of the recordings with their units, where known: they tell the kind of instrument. It
    loads as it is, with eleven errors of 2 arcmin and a latitude that stands for anywhere in the north.
    """
    following = f"sensitivity {_words([study_path])}"
    if record_paths:
        following = f"calibrate turntable {_files(record_paths, study_path, map_path)}"
    body = _TURNTABLE.replace("{errors}", "".join(map(_error_line, slots("two_axis_turntable"))))
    body = body.replace("{plans}", " ".join(NAMED)).replace("{instrument}", instrument_lines(channels or {}))
    if "rate" in (channels or {}):
        body = re.sub(r"# \[rate_test\] .*", f"{'[rate_test]':35s} # the table turns at rates", body)
    return _HEAD.format(what="of a turntable", next=following) + body + _COMMON


def selfcal_template(
    record_paths: Sequence[str | Path] = (),
    study_path: str | Path = "STUDY.toml",
    map_path: str | Path | None = None,
) -> str:
    """A study of a self-calibration with every key in it, each explained; arguments as for `imu_template`.

    It loads as it is: the paper's path and platform, at a latitude that stands for anywhere in the north.
    """
    following = f"simulate selfcal {_words([study_path])} --out simulated.csv"
    if record_paths:
        following = f"selfcal {_files(record_paths, study_path, map_path)}"
    return _HEAD.format(what="of a self-calibration", next=following) + SELFCAL + _COMMON


def aoa_template(
    record_paths: Sequence[str | Path] = (),
    study_path: str | Path = "STUDY.toml",
    map_path: str | Path | None = None,
) -> str:
    """A study of an angle of attack with every key in it, each explained; arguments as for `imu_template`.

    It loads as it is: the paper's three axes, pitching by 10 deg, at a latitude that stands for anywhere in the north.
    """
    following = f"simulate aoa {_words([study_path])} --out simulated.csv"
    if record_paths:
        following = f"aoa {_files(record_paths, study_path, map_path)}"
    return _HEAD.format(what="of an angle of attack", next=following) + AOA + _COMMON


def _error_line(slot: Slot) -> str:
    """One error of a table, commented out."""
    size = "10 um" if slot.is_offset else "1 arcmin"
    note = ", optional" if slot.optional else ""
    text = f'# {slot.name} = {{ normal = "{size}" }}'
    return f"{text:38s}# {slot.what} [{size.split()[1]}]; {slot.scope.value}{note}\n"


def _files(record_paths: Sequence[str | Path], study_path: str | Path, map_path: str | Path | None) -> str:
    """Recordings, map and study as on a command line."""
    column_map = [] if map_path is None else ["--map", map_path]
    return _words([*record_paths, *column_map, "--study", study_path])


def _words(words: Iterable[str | Path]) -> str:
    """Words of a command line, printable in a comment."""
    text = shlex.join(map(str, words)).encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    return "".join(c if c.isprintable() else "?" for c in text)
