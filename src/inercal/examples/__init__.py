"""The recordings and studies that ship with inercal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from inercal.foundation.inputs import Source

FOLDER = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Example:
    """A recording with its study and map: file names in `FOLDER`, what it is, and its licence, if not inercal's own."""

    name: str
    title: str
    records: tuple[str, ...]
    licence: str | None = None
    map: str | None = None
    study: str | None = None
    verb: str = "calibrate imu"

    @property
    def files(self) -> tuple[str, ...]:
        """All its files."""
        return tuple(filter(None, (*self.records, self.study, self.map, self.licence)))

    def command(self, folder: str = ".") -> str:
        """The command that uses copies in ``folder``."""
        prefix = "" if folder == "." else f"{folder}/"
        words = [f"inercal {self.verb}", *(f"{prefix}{name}" for name in self.records)]
        words += [f"--map {prefix}{self.map}"] if self.map else []
        words += [f"--study {prefix}{self.study}"] if self.study else []
        return " ".join(words)


def shipped(file: str) -> Source:
    """A file of `FOLDER` as an input of a result: by its name in the package, which is the same wherever that lies."""
    from inercal.foundation.records.read import source_of

    return replace(source_of(FOLDER / file), path=f"{FOLDER.name}/{file}")


_DAYS = tuple(date(2021, 1, 20) + k * timedelta(days=91) for k in range(20))
"""Days of the calibrations of the example `five-years`."""

EXAMPLES: dict[str, Example] = {
    example.name: example
    for example in (
        Example(
            "xsens",
            "Xsens MTi turned by hand through 38 poses, 511 s at 100 Hz (Tedaldi, Pretto, Menegatti, ICRA 2014)",
            ("xsens_acc.mat", "xsens_gyro.mat"),
            "licences/imu_tk.txt",
            "xsens-map.toml",
            "xsens.toml",
        ),
        Example(
            "mpu6050",
            "MPU-6050 held in only ten poses, 102 s at 100 Hz: too few, and inercal says which",
            ("mpu6050.csv.gz",),
            "licences/ImuCalibration.txt",
            "mpu6050-map.toml",
            "mpu6050.toml",
        ),
        Example(
            "ferraris",
            "IMU set on its six sides and turned about its three axes, sections labelled, 205 Hz (imucal)",
            ("ferraris.csv.gz",),
            "licences/imucal.txt",
            "ferraris-map.toml",
            "ferraris.toml",
        ),
        Example(
            "ferraris-si",
            "the same kind of session in m/s^2 and deg/s, sections by their times, 102 Hz (imucal)",
            ("ferraris-si.csv.gz",),
            "licences/imucal.txt",
            "ferraris-si-map.toml",
            "ferraris-si.toml",
        ),
        Example(
            "table",
            "IMU on a two-axis turntable with known angles, 265 s at 100 Hz, simulated by pyins",
            ("table.npz",),
            "licences/pyins.txt",
            study="table.toml",
        ),
        Example(
            "strapdown",
            "strapdown unit in 19 positions, turned by 90 deg between them, 982 s at 100 Hz, simulated by PSINS",
            ("strapdown.bin.gz",),
            "licences/PSINS.txt",
            "strapdown-map.toml",
            "strapdown.toml",
            verb="calibrate strapdown",
        ),
        Example(
            "lasergyro",
            "ring-laser IMU at rest, 31 min at 100 Hz, angles and velocities gained per sample (PSINS)",
            ("lasergyro.txt.gz",),
            "licences/PSINS.txt",
            "lasergyro-map.toml",
            verb="allan",
        ),
        Example(
            "thermal",
            "MEMS IMU at rest in a climatic chamber, -18 to 74 degC",
            ("thermal.csv.gz",),
            "licences/tofupilot.txt",
            "thermal-map.toml",
            verb="temperature",
        ),
        Example(
            "tumble",
            "three accelerometers on a two-axis turntable, 24 positions of 20 s at 2 Hz, simulated",
            ("tumble.csv.gz",),
            study="tumble.toml",
            verb="calibrate turntable",
        ),
        Example(
            "five-years",
            "gyrowheel tumbled on a table four times a year from 2021 to 2025, simulated: one drift ages, one wanders",
            tuple(f"gyro-{day}.csv" for day in _DAYS),
            study="gyro.toml",
            verb="calibrate turntable",
        ),
        Example(
            "selfcal",
            "platform in three gimbals that turns for 540 s and calibrates itself, 5 Hz, simulated",
            ("selfcal.csv.gz",),
            study="selfcal.toml",
            verb="selfcal",
        ),
        Example(
            "sting",
            "wind-tunnel model on a sting that pitches by steps of 5 deg and is shaken, 42 s at 250 Hz, simulated",
            ("sting.csv.gz",),
            study="sting.toml",
            verb="aoa",
        ),
    )
}
