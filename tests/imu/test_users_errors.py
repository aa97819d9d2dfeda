"""Errors of users in files of sides and rates: each ends other than ok, and names the file and the axis."""

from dataclasses import replace

import numpy as np
import pytest
from turned_units import SIDES, Bench, Unit

from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.inputs import Source
from inercal.foundation.records.record import record_of
from inercal.foundation.units import parse_unit
from inercal.systems.imu.sections.outcome import calibrate_from_sections
from inercal.systems.imu.settings import ImuSettings, SectionsSettings

WORDS = {"+": "up", "-": "down"}
RATES = {f"{axis}_{word}30dps": (axis, sign * np.radians(30.0)) for axis in "xyz" for word, sign in
         (("", 1.0), ("-", -1.0))}  # fmt: skip
NOISE = {"acc": 0.02, "gyro": 2e-3}


class Files:
    """Files by name, each a list of the means, with noise, of accelerometers and gyro in its time."""

    def __init__(self, seed, unit="m/s^2"):
        self.rng = np.random.default_rng(seed)
        self.unit, self.acc = Unit(self.rng), unit
        bench = Bench(self.unit)
        self.held = {}
        for side, up in SIDES.items():
            rest = bench.rest(up)
            self.held[f"{side[1]}_{WORDS[side[0]]}.csv"] = [(rest.acc, rest.gyro)]
        for name, (axis, rate) in RATES.items():
            up = SIDES[f"+{axis}"]
            attitude = self.unit.stand(bench.tilted(up, bench.placing))
            f, e = self.unit.felt(attitude)
            self.held[f"{name}.csv"] = [(self.unit.accelerometers(f), self.unit.gyro(rate * up + e, f))]

    def changed(self, name, acc=lambda y: y, gyro=lambda y: y):
        """Outputs of one file changed by functions."""
        self.held[name] = [(acc(a), gyro(g)) for a, g in self.held[name]]

    def exchanged(self, one, other):
        self.held[one], self.held[other] = self.held[other], self.held[one]

    def estimate(self, rows=()):
        method = SectionsSettings(rows=rows)
        settings = ImuSettings(Site(self.unit.gravity, (), self.unit.latitude), method=method)
        records = []
        for name, parts in self.held.items():
            samples = 1200 // len(parts)
            read = [np.concatenate([np.tile(part[k], (samples, 1)) for part in parts]) for k in (0, 1)]
            read = [
                y + self.rng.normal(0.0, noise, y.shape)
                for y, noise in zip(read, NOISE.values(), strict=True)
            ]
            factor = parse_unit(self.acc).factor
            columns = [
                (f"{sensor}_{axis}", parse_unit(unit), values[:, i] / size)
                for sensor, unit, values, size in (
                    ("acc", self.acc, read[0], factor),
                    ("gyro", "rad/s", read[1], 1.0),
                )
                for i, axis in enumerate("xyz")
            ]
            record = record_of(columns, np.arange(len(read[0])) / 100.0)
            records.append(replace(record, sources=(Source(name, ""),)))
        return calibrate_from_sections(records, settings, method).estimate


def said(estimate):
    """What a user reads: the message, and the findings that harm."""
    return " ".join([estimate.message, *(finding.line for finding in estimate.findings if finding.harm)])


def named(files, *words, rows=()):
    """The files end other than ok, and all these words are said."""
    estimate = files.estimate(rows)
    assert estimate.status is not Status.OK
    text = said(estimate)
    for word in words:
        assert word in text, (word, text)


def test_sound_files_are_ok():
    for seed in range(3):
        estimate = Files(seed).estimate()
        assert estimate.status is Status.OK, said(estimate)


@pytest.mark.parametrize("unit", ["m/s^2", "g"])
@pytest.mark.parametrize("axis", "xyz")
def test_the_files_of_an_axis_up_and_down_are_exchanged(axis, unit):
    files = Files(11, unit)
    files.exchanged(f"{axis}_up.csv", f"{axis}_down.csv")
    named(files, f"{axis}_up", f"{axis}_down", f"-{axis}")


@pytest.mark.parametrize("pair", ["xy", "yz", "zx"])
def test_files_of_two_axes_are_exchanged(pair):
    files = Files(12)
    for word in WORDS.values():
        files.exchanged(f"{pair[0]}_{word}.csv", f"{pair[1]}_{word}.csv")
    named(files, *(f"{axis}_{word}" for axis in pair for word in WORDS.values()))


def test_one_file_of_two_axes_is_exchanged():
    files = Files(13)
    files.exchanged("x_up.csv", "z_down.csv")
    named(files, "x_up", "z_down")


def test_columns_of_two_axes_are_exchanged():
    files = Files(14)
    for name in files.held:
        files.changed(name, acc=lambda y: y[[0, 2, 1]])
    named(files, "y_up stands on +z", "z_up stands on +y")


@pytest.mark.parametrize("name", ["x_up.csv", "y_down.csv"])
def test_a_side_is_taken_twice(name):
    files = Files(15)
    other = name.replace("up", "DOWN").replace("down", "up").replace("DOWN", "down")
    files.held[name] = [(y + 0.03, w) for y, w in files.held[other]]
    named(files, name.partition(".")[0], other.partition(".")[0], "same side")


@pytest.mark.parametrize("factor", [9.80665, 1.0 / 9.80665, 1e3 / 9.80665, 0.5, 16384.0 / 9.80665])
def test_the_accelerometers_of_a_file_are_in_another_unit(factor):
    files = Files(16)
    files.changed("y_up.csv", acc=lambda y: factor * y)
    named(files, "y_up")


@pytest.mark.parametrize("factor", [57.29578, 0.01745329, 2.0])
def test_the_gyro_of_a_file_is_in_another_unit(factor):
    files = Files(17)
    files.changed("z_30dps.csv", gyro=lambda w: factor * w)
    named(files, "z_30dps")


def test_the_gyro_of_all_files_is_in_another_unit():
    files = Files(18)
    for name in files.held:
        files.changed(name, gyro=lambda w: 57.29578 * w)
    named(files, "57.3 times")


@pytest.mark.parametrize("name", ["x_down.csv", "z_up.csv"])
def test_a_side_turns_while_it_rests(name):
    """At 20 deg/s about the vertical: the accelerometers rest."""
    files = Files(19)
    files.changed(name, gyro=lambda w: w + np.radians(20.0) * SIDES[f"+{name[0]}"])
    named(files, name.partition(".")[0])


def test_a_side_is_tilted_bit_by_bit_while_it_rests():
    """From the side to 20 deg off it within its file, never still for long."""
    files = Files(20)
    up, across = SIDES["+y"], SIDES["+x"]
    parts = [np.cos(a) * up + np.sin(a) * across for a in np.linspace(0.0, np.radians(20.0), 60)]
    gyro = files.held["y_up.csv"][0][1]
    files.held["y_up.csv"] = [(files.unit.accelerometers(9.81 * part), gyro + 0.03) for part in parts]
    named(files, "y_up")


def test_a_side_stands_off_by_a_quarter_of_a_right_angle():
    files = Files(21)
    off = np.cos(0.4) * SIDES["-x"] + np.sin(0.4) * SIDES["+y"]
    files.changed("x_down.csv", acc=lambda _: files.unit.accelerometers(9.81 * off))
    named(files, "x_down")


@pytest.mark.parametrize("axis", "xyz")
def test_a_rate_has_the_wrong_sign(axis):
    files = Files(22)
    name = f"{axis}_-30dps.csv"
    files.held[name] = files.held[f"{axis}_30dps.csv"]
    named(files, name.partition(".")[0], f"about {axis}")


def test_a_channel_of_the_gyro_has_the_wrong_sign():
    files = Files(23)
    for name in files.held:
        files.changed(name, gyro=lambda w: w * [1.0, -1.0, 1.0])
    named(files, "y_30dps", "y_-30dps", "about y")


def test_rates_about_two_axes_are_exchanged():
    files = Files(24)
    files.exchanged("x_30dps.csv", "y_30dps.csv")
    named(files, "x_30dps turns about y", "y_30dps turns about x")


def test_a_rest_that_is_stated_holds_a_motion():
    """The last third of the stated time on the side is on the way to the next one, 10 deg off."""
    files = Files(26)
    up, across = SIDES["+z"], SIDES["+y"]
    gyro = files.held["z_up.csv"][0][1]
    angles = np.radians([0.0, 0.0, 10.0])
    files.held["z_up.csv"] = [
        (files.unit.accelerometers(9.81 * (np.cos(a) * up + np.sin(a) * across)), gyro) for a in angles
    ]
    rows = tuple(
        {"section": name.partition(".")[0], "file": name, "up": side}
        for side, name in zip(SIDES, list(files.held)[:6], strict=True)
    )
    named(files, "z_up is not used: specific force drifts in it", rows=rows)


def test_a_file_holds_nothing_but_one_number():
    files = Files(25)
    files.changed("z_down.csv", acc=lambda y: 0.0 * y, gyro=lambda w: 0.0 * w)
    named(files, "z_down")
