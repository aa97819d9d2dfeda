"""The recordings and studies that ship with inercal."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Example:
    """A recording with its study and map: file names in `FOLDER`, what it is, and its licence."""

    name: str
    title: str
    records: tuple[str, ...]
    study: str
    map: str
    licence: str

    @property
    def files(self) -> tuple[str, ...]:
        """All its files."""
        return (*self.records, self.study, self.map, self.licence)

    def command(self, folder: str = ".") -> str:
        """The command that calibrates from copies in ``folder``."""
        prefix = "" if folder == "." else f"{folder}/"
        records = " ".join(f"{prefix}{name}" for name in self.records)
        return f"inercal calibrate imu {records} --map {prefix}{self.map} --study {prefix}{self.study}"


EXAMPLES: dict[str, Example] = {
    example.name: example
    for example in (
        Example(
            "xsens",
            "Xsens MTi turned by hand through 38 poses, 511 s at 100 Hz (Tedaldi, Pretto, Menegatti, ICRA 2014)",
            ("xsens_acc.mat", "xsens_gyro.mat"),
            "xsens.toml",
            "xsens-map.toml",
            "licences/imu_tk.txt",
        ),
        Example(
            "mpu6050",
            "MPU-6050 held in only ten poses, 102 s at 100 Hz: too few, and inercal says which",
            ("mpu6050.csv.gz",),
            "mpu6050.toml",
            "mpu6050-map.toml",
            "licences/ImuCalibration.txt",
        ),
    )
}
