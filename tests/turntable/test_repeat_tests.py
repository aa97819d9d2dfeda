"""Repeat runs of a table: the part that changes from run to run, and the errors of the table that all have."""

import json

import numpy as np
import pytest
from scipy import stats
from turntable_studies import ARCMIN, DEG_H, LATITUDE, TUMBLE, WHEEL_X, references, study, wheel_output

from inercal.cli import run
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.results.repeat import combine_runs
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.task import calibrate_positions

NOISE, TURN_ON = 0.01 * DEG_H, 0.2 * DEG_H
REDRAWN, CONSTANT = ("dphi_y1", "dalpha_x2"), ("deps_y", "dtheta_z")
SIZE = 0.5 * ARCMIN
CHAIN = turntable("two_axis_turntable", None, dict.fromkeys((*REDRAWN, *CONSTANT), normal(SIZE)))
SETTINGS = study(TUMBLE, CHAIN, coefficients=WHEEL_X, noise=NOISE, earth_rate="stated")


def drawn_run(number, fixed, rng):
    """One test of a wheel whose fixed drift comes back different; constant errors of the table handed in."""
    angles = TUMBLE.angles
    errors = fixed | {name: rng.normal(0.0, SIZE, len(angles)) for name in REDRAWN}
    wheel = WHEEL_X | {"DX_F": WHEEL_X["DX_F"] + rng.normal(0.0, TURN_ON)}
    y = wheel_output("x", wheel, *references(angles, errors)) + rng.normal(0.0, NOISE, len(angles))
    source, t = Source(f"run{number}.csv", ""), np.arange(float(len(angles)))
    columns = {"phi1": ("rad", angles[:, 0]), "phi2": ("rad", angles[:, 1]), "y_x": ("rad/s", y)}
    return Record(
        {name: Column(name, parse_unit(unit), values, t, source) for name, (unit, values) in columns.items()},
        sources=(source,),
    )


@pytest.mark.slow
@pytest.mark.parametrize("times", [20, pytest.param(60, marks=pytest.mark.campaign)])
def test_combined_runs_cover_what_changes_and_what_does_not(times):
    """Four runs on one table, many times: DX_F that changes at turn-on, DX_X that the constant errors shift in all."""
    rng, ratios = np.random.default_rng(20261122), []
    held = dict.fromkeys(("DX_F", "DX_X", "DX_Y", "DX_XX"), 0)
    for _ in range(times):
        fixed = {name: rng.normal(0.0, SIZE) for name in CONSTANT}
        runs = [calibrate_positions(drawn_run(k, fixed, rng), SETTINGS).estimate for k in range(4)]
        both = combine_runs(runs)
        for name in held:
            low, high = both[name].interval(0.95)
            held[name] += low <= WHEEL_X[name] <= high
        ratios.append([both[name].u / runs[0][name].u for name in ("DX_X", "DX_XX", "DX_F")])
    low, high = (stats.binom.ppf(q, times, 0.95) for q in (5e-4, 1.0))
    assert all(low <= count <= high for count in held.values()), held
    of_constant, of_redrawn, of_changing = np.median(ratios, axis=0)
    assert of_constant > 0.6 > of_redrawn
    assert of_changing > 2.0
    assert both["DX_F"].dof == pytest.approx(3.0, rel=0.1)
    assert both.result["between"]["DX_F"]["s"] == pytest.approx(TURN_ON, rel=0.9)


def test_the_command_combines_runs(tmp_path, capsys):
    """Three simulated tumbles, the second with another fixed drift."""
    (tmp_path / "table.toml").write_text(
        f"""
[site]
latitude = "{np.degrees(LATITUDE)} deg"
[rig]
kind = "two_axis_turntable"
[rig.errors]
default = {{ normal = "5 arcsec" }}
[positions]
plan = "24-position"
[instrument]
kind = "gyrowheel"
noise = "0.01 deg/h"
earth_rate = "stated"
unit = "deg/h"
[instrument.coefficients]
k_x = 1
DX_F = "10 deg/h"
"""
    )
    files, where = [], str(tmp_path / "table.toml")
    for k, drift in enumerate((10, 12, 9.5)):
        files.append(str(tmp_path / f"run{k}.csv"))
        more = [
            "--set",
            f'instrument.coefficients.DX_F="{drift} deg/h"',
            "--seed",
            str(k),
            "--out",
            files[-1],
        ]
        assert run(["simulate", "turntable", where, *more, "--quiet"]) == 0
    capsys.readouterr()
    page = tmp_path / "page.html"
    assert run(["calibrate", "turntable", *files, "--study", where, "--json", "--report", str(page)]) == 0
    said = json.loads(capsys.readouterr().out)
    drift = next(each for each in said["parameters"] if each["name"] == "DX_F")
    assert drift["value"] / DEG_H == pytest.approx(10.5, abs=0.05)
    assert drift["u"] / DEG_H == pytest.approx(np.std([10, 12, 9.5], ddof=1) / np.sqrt(3.0), rel=0.05)
    assert {each["code"] for each in said["findings"]} == {"stated_exact", "blind", "between_runs"}
    assert "The runs about their combined value" in page.read_text("utf-8")
    assert run(["calibrate", "turntable", *files, "--study", where]) == 0
    shown = capsys.readouterr().out
    assert "from 3 runs" in shown
    assert "deg/h" in shown
