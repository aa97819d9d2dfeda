"""What a calibration of a strapdown unit is used for: `apply` to files and streams, `compare`, other tools."""

import json

import numpy as np
import pytest

import inercal as ic
from inercal.cli import run

TRUTH = {
    "D_F_x": "5 deg/h", "S_y": "1.002", "T_xy": "200 arcsec", "K0_z": "2 mg", "M_xy": "100 arcsec", "K1_x": "0.999",
    "K2_x": "90 ug/g^2", "r_xx": "3 cm", "r_xy": "-2 cm", "r_yz": "4 cm", "tau_a": "7.3 ms", "S_asym_z": "200 ppm",
    "G_zx": "20 deg/h/g",
}  # fmt: skip
SITE = ["--set", "site.latitude=34 deg", "--set", "site.gravity=9.7965(1) m/s^2"]
TERMS = 'strapdown.terms=["k2", "size", "delay", "asymmetry", "g_sensitivity"]'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study with a wobbling unit, and its record without noise, with and without its errors."""
    path = tmp_path_factory.mktemp("use")
    study = str(path / "unit.toml")
    plan = ["--set", "plan.dwell=6 s", "--set", "plan.first_dwell=12 s", "--set", "plan.turn_time=1.2 s"]
    plan += ["--set", "plan.sample_rate=200 Hz", "--set", "motion.wobble=3 deg", "--set", TERMS]
    assert run(["new", "strapdown", "--out", study, "--quiet", *SITE, *plan]) == 0
    settings = ic.study(study, truth=TRUTH).settings
    from inercal.systems.strapdown.model.coefficients import SIZE, array_of
    from inercal.systems.strapdown.simulate import simulated, to_record

    pairs = (("run", array_of(settings.truth, "upper")), ("true", np.zeros(SIZE)))
    for name, c in pairs:
        from inercal.foundation.records.write import write_record

        samples = simulated(settings, c, np.random.default_rng(7), noise=False)
        write_record(to_record(samples), path / f"{name}.csv")
    return path


@pytest.fixture(scope="module")
def calibration(folder):
    """A calibration that has found the truth: a fit of the record, with the true values in place of its own."""
    found = ic.calibrate(ic.read(folder / "run.csv"), folder / "unit.toml")
    found.save(folder / "cal.json")
    data = json.loads((folder / "cal.json").read_text())
    truth = ic.study(folder / "unit.toml", truth=TRUTH).settings.truth
    for each in data["parameters"]:
        each["value"] = truth.get(
            each["name"],
            1.0 if each["name"].startswith(("S_", "K1_")) and "asym" not in each["name"] else 0.0,
        )
    (folder / "cal.json").write_text(json.dumps(data))
    return folder / "cal.json"


def apart(one, two, sensor, which=slice(None)):
    """Largest difference of a triad between two records."""
    return max(np.abs(one[f"{sensor}_{i}"].si() - two[f"{sensor}_{i}"].si())[which].max() for i in "xyz")


def test_a_file_is_freed_of_everything(folder, calibration, capsys):
    """Rate and force of the perfect unit, at the stamps, to what a cubic through four samples leaves; and back."""
    out = folder / "out.npz"
    assert run(["apply", str(calibration), str(folder / "run.csv"), "--out", str(out)]) == 0
    assert "not_held" not in capsys.readouterr().err
    found, true, raw = ic.read(out), ic.read(folder / "true.csv"), ic.read(folder / "run.csv")
    assert apart(found, true, "gyro") < 1e-6
    assert apart(found, true, "acc") < 2e-3 < 0.05 * apart(raw, true, "acc", slice(2400, None))
    again = folder / "again.npz"
    assert (
        run(["apply", str(calibration), str(folder / "true.csv"), "--invert", "--out", str(again), "--quiet"])
        == 0
    )
    assert apart(ic.read(again), raw, "gyro") < 1e-6
    assert apart(ic.read(again), raw, "acc") < 2e-3


def test_a_stream_gives_the_digits_of_a_file(folder, calibration, capsys, monkeypatch):
    lines = (folder / "run.csv").read_bytes().splitlines(keepends=True)
    some = b"".join(lines[:1] + lines[2300:2800])
    (folder / "some.csv").write_bytes(some)
    assert (
        run(
            [
                "apply",
                str(calibration),
                str(folder / "some.csv"),
                "--out",
                str(folder / "some-out.csv"),
                "--quiet",
            ]
        )
        == 0
    )
    capsys.readouterr()
    assert run(["apply", str(calibration), str(folder / "some.csv"), "--stream", "--quiet"]) == 0
    assert capsys.readouterr().out.splitlines() == (folder / "some-out.csv").read_text().splitlines()


@pytest.mark.slow
def test_a_stream_goes_on_where_it_was_stopped(folder, calibration, capsys):
    lines = (folder / "run.csv").read_bytes().splitlines(keepends=True)
    for name, part in (("one", lines[:2500]), ("all", lines[:3000])):
        (folder / f"{name}.csv").write_bytes(b"".join(part))
    command = ["apply", str(calibration), "--stream", "--quiet"]
    capsys.readouterr()
    assert run([*command, str(folder / "all.csv")]) == 0
    whole = capsys.readouterr().out.splitlines()
    saved = ["--checkpoint", str(folder / "state")]
    assert run([*command, str(folder / "one.csv"), *saved]) == 0
    first = capsys.readouterr().out.splitlines()
    assert run([*command, str(folder / "all.csv"), *saved]) == 0
    second = capsys.readouterr().out.splitlines()
    # the rows that waited for others at the end of the first are given again
    rows = {line.partition(",")[0]: line for line in (*first, *second)}
    assert list(rows.values()) == whole


def test_beside_a_gap_places_and_delay_are_left_out(folder, calibration, capsys):
    lines = (folder / "run.csv").read_bytes().splitlines(keepends=True)
    (folder / "gap.csv").write_bytes(b"".join(lines[:1] + lines[2300:2500] + lines[2530:2800]))
    command = ["apply", str(calibration), str(folder / "gap.csv")]
    assert run([*command, "--out", str(folder / "gap-out.csv")]) == 0
    assert (
        "beside uneven steps of time: places of the accelerometers and delay are not applied there"
        in capsys.readouterr().err
    )
    assert run([*command, "--stream"]) == 0
    captured = capsys.readouterr()
    assert "beside uneven steps of time" in captured.err
    assert captured.out.splitlines() == (folder / "gap-out.csv").read_text().splitlines()


def test_u_of_corrected_values_holds_places_too(folder, calibration):
    """u of the force is larger while the unit turns."""
    out = folder / "u.npz"
    some = folder / "some.csv"
    lines = (folder / "run.csv").read_bytes().splitlines(keepends=True)
    some.write_bytes(b"".join(lines[:1] + lines[2300:2700]))
    assert run(["apply", str(calibration), str(some), "--uncertainty", "--out", str(out), "--quiet"]) == 0
    u = ic.read(out)["u_acc_x"].values
    assert u[200:300].max() > 2.0 * u[:60].max() > 0.0


def test_two_runs_are_compared(folder, calibration, capsys):
    again = ic.calibrate(ic.read(folder / "run.csv"), folder / "unit.toml")
    again.save(folder / "second.json")
    capsys.readouterr()
    run(["compare", str(calibration), str(folder / "second.json"), "--json"])
    data = json.loads(capsys.readouterr().out)
    assert {"r_xx", "tau_a", "K2_x", "S_asym_z"} <= {each["name"] for each in data["parameters"]}


def test_psins_and_back_loses_only_the_asymmetry(folder, calibration, capsys):
    out = folder / "clbt.m"
    assert run(["convert", str(calibration), "--to", "psins", "--out", str(out)]) == 0
    said = capsys.readouterr().err
    assert "psins has no place for S_asym_x, S_asym_y, S_asym_z: left out" in said
    text = out.read_text()
    for name in ("Ka2", "rx", "ry", "tGA"):
        assert f"clbt.{name} = [" in text
    assert "clbt.rz" not in text
    assert run(["convert", str(out), "--from", "psins", "--out", str(folder / "back.json"), "--quiet"]) == 0
    back, whole = ic.load(folder / "back.json"), ic.load(calibration)
    for name in whole.names:
        if not name.startswith("S_asym"):
            assert back.values.get(name, 0.0) == pytest.approx(whole.values[name], rel=1e-9, abs=1e-15), name


def test_a_text_of_clbtfile_states_its_own_units(folder, capsys):
    """As PSINS writes it: deg/h, ug, ug/g^2, cm, ms; places from rz on."""
    eye = "[\n\t1 0 0\n\t0 1 0\n\t0 0 1\n\t]"
    (folder / "text.m").write_text(
        f"Kg = {eye};\neb = [\n\t1 2 3\n\t]; \t% deg/h\nKa = {eye};\ndb = [\n\t10 20 30\n\t]; \t% ug\n"
        "Ka2 = [\n\t10 20 30\n\t]; \t% ug/g^2\nKap = [\n\t0 0 0\n\t]; \t% ppm\nrx = [\n\t1 2 3\n\t]; \t% cm\n"
        "ry = [\n\t4 5 6\n\t]; \t% cm\nrz = [\n\t0 0 1\n\t]; \t% cm\ntGA = [\n\t1.5\n\t]; \t% ms\n"
    )
    assert (
        run(
            ["convert", str(folder / "text.m"), "--from", "psins", "--out", str(folder / "t.json"), "--quiet"]
        )
        == 0
    )
    values = ic.load(folder / "t.json").values
    assert values["K2_y"] == pytest.approx(20e-6 / 9.7803267715)
    assert [values[f"r_x{j}"] for j in "xyz"] == pytest.approx([0.01, 0.02, 0.02])
    assert values["r_yz"] == pytest.approx(0.05)
    assert values["tau_a"] == pytest.approx(1.5e-3)


@pytest.mark.parametrize("tool", ["kalibr", "imu_tk", "imucal"])
def test_other_tools_are_told_what_they_do_not_hold(tool, calibration, capsys):
    assert run(["convert", str(calibration), "--to", tool]) == 0
    assert "K2_z, r_xx, r_xy, r_xz, r_yx, r_yy, r_yz, tau_a" in capsys.readouterr().err
