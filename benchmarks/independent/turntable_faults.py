"""Faults of a turntable test, size by size: shift of the values in u, verdict, and name.

    python benchmarks/independent/turntable_faults.py --draws 50 --out build/faults.json
    python benchmarks/independent/turntable_faults.py --before main.json --after build/faults.json
    python benchmarks/independent/turntable_faults.py --sound 500

The first makes a campaign with the product that is installed, the second sets two of them side by side, as Markdown,
and the third calibrates sound tests.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import inercal as ic
from turntable import ARCSEC, Faults, grid, recorded, shuffled, tumble

SEED = 20261123
STUDY = """
[site]
latitude = "45.00 deg"
gravity = "9.8 m/s^2"
[rig]
kind = "two_axis_turntable"
[rig.errors]
default = {{ uniform = "{arcsec} arcsec" }}
[instrument]
kind = "{kind}"
unit = "{unit}"
{more}
"""
ALL_TERMS = [f"{k}_{i}" for i in "xyz" for k in ("K0", "K1")] + [
    "M_xy",
    "M_xz",
    "M_yz",
    "M_yx",
    "M_zx",
    "M_zy",
]
UG = 9.8e-6

#: name -> kind, positions, noise [unit of the output], stated or not, table's half width [arcsec]
TESTS = {
    "gyrowheel, 6 x 6 in order": ("gyrowheel", grid(6), 0.04, False, 120.0),
    "gyrowheel, 6 x 6 shuffled, noise stated": ("gyrowheel", shuffled(6), 0.04, True, 120.0),
    "accelerometers, 24-position tumble": ("accelerometer", tumble(), 10 * UG, False, 5.0),
}
ARCMIN, DEG = 60.0 * ARCSEC, np.pi / 180.0
OF_GYROS = {
    "heading": [(f"{d} deg", Faults(heading=d * DEG)) for d in (0.5, 2, 10, 90)],
    "ramp": [(f"{r} deg/h", Faults(ramp=r)) for r in (0.05, 0.1, 0.2, 0.4)],
    "warm-up": [(f"{r} deg/h", Faults(warm_up=r)) for r in (0.1, 0.3, 1.0)],
    "scale drift": [(f"{r} ppm", Faults(scale_drift=r * 1e-6)) for r in (500, 2000, 8000)],
    "tilt": [(f"{r} arcmin", Faults(tilt_north=r * ARCMIN, tilt_west=0.5 * r * ARCMIN)) for r in (2, 10, 40)],
    "harmonic 1 of phi1": [(f"{r} arcmin", Faults(harmonic={(1, 1): r * ARCMIN})) for r in (4, 12)],
    "harmonic 2 of phi2": [(f"{r} arcmin", Faults(harmonic={(2, 2): r * ARCMIN})) for r in (4, 12)],
    "backlash": [(f"{r} arcmin", Faults(backlash=r * ARCMIN)) for r in (2, 10)],
    "hysteresis": [(f"{r} deg/h", Faults(hysteresis=r)) for r in (0.05, 0.2)],
    "field": [(f"{r} deg/h", Faults(field=r)) for r in (0.1, 0.5)],
}
OF_FORCE = {
    "ramp": [(f"{r} ug", Faults(ramp=r * UG)) for r in (10, 20, 50, 100)],
    "warm-up": [(f"{r} ug", Faults(warm_up=r * UG)) for r in (20, 50, 200)],
    "scale drift": [(f"{r} ppm", Faults(scale_drift=r * 1e-6)) for r in (10, 20, 50)],
    "tilt": [(f"{r} arcsec", Faults(tilt_north=r * ARCSEC, tilt_west=0.5 * r * ARCSEC)) for r in (5, 20, 60)],
    "harmonic 1 of phi1": [(f"{r} arcsec", Faults(harmonic={(1, 1): r * ARCSEC})) for r in (10, 40)],
    "harmonic 2 of phi2": [(f"{r} arcsec", Faults(harmonic={(2, 2): r * ARCSEC})) for r in (10, 40)],
    "backlash": [(f"{r} arcsec", Faults(backlash=r * ARCSEC)) for r in (5, 20)],
    "hysteresis": [(f"{r} ug", Faults(hysteresis=r * UG)) for r in (10, 40)],
    "field": [(f"{r} ug", Faults(field=r * UG)) for r in (20, 100)],
}


def study(name: str) -> str:
    """The study of a test, as a file would have it."""
    kind, _, noise, stated, arcsec = TESTS[name]
    unit = "deg/h" if kind == "gyrowheel" else "m/s^2"
    more = f'noise = "{noise} {unit}"\n' if stated else ""
    more += 'earth_rate = "fitted"' if kind == "gyrowheel" else f"terms = {json.dumps(ALL_TERMS)}"
    return STUDY.format(kind=kind, unit=unit, arcsec=arcsec, more=more)


def calibrated(name: str, seed: list[int], faults: Faults, path: Path):
    """The result of one test; the same seed has the same noise and table whatever the faults."""
    kind, angles, noise, _, arcsec = TESTS[name]
    y = recorded(np.random.default_rng(seed), kind, angles, noise, arcsec * ARCSEC, faults)
    names = ["y_x [deg/h]", "y_y [deg/h]"] if kind == "gyrowheel" else [f"acc_{i} [m/s^2]" for i in "xyz"]
    deg = np.degrees(angles)
    rows = np.column_stack([np.arange(1, len(angles) + 1), deg, y])
    record = path / "record.csv"
    np.savetxt(record, rows, delimiter=",", header=",".join(["position [1]", "phi1 [deg]", "phi2 [deg]", *names]),
               comments="", fmt="%.12g")  # fmt: skip
    return ic.calibrate(ic.read(record), path / "study.toml")


def campaign(draws: int, folder: Path, only: str, fault_only: str, out: Path) -> None:
    """All faults of all tests, each drawn so often, into a file that grows row by row."""
    folder.mkdir(parents=True, exist_ok=True)
    results = {}
    for number, name in enumerate(TESTS):
        if only not in name:
            continue
        (folder / "study.toml").write_text(study(name))
        sound = [calibrated(name, [SEED, number, k], Faults(), folder).estimate for k in range(draws)]
        faults = OF_GYROS if TESTS[name][0] == "gyrowheel" else OF_FORCE
        for fault, sizes in faults.items():
            if fault_only not in fault:
                continue
            for size, what in sizes:
                done = [calibrated(name, [SEED, number, k], what, folder).estimate for k in range(draws)]
                results[f"{name}|{fault}|{size}"] = summary(sound, done)
                out.write_text(json.dumps(results, indent=1))


def says_blind(estimate) -> bool:
    """True where a finding says that the plan hides faults."""
    return any(finding.code == "blind" for finding in estimate.findings)


def of_sound(draws: int, folder: Path, only: str) -> None:
    """Print the verdicts of sound tests, and by how much faults in doubt enlarge the u of the most enlarged value."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(TESTS):
        if only not in name:
            continue
        (folder / "study.toml").write_text(study(name))
        done = [calibrated(name, [SEED, number, k], Faults(), folder).estimate for k in range(draws)]
        ratios = [enlarged(each) for each in done]
        codes = [each.status.value + "".join(f" {f.code}" for f in each.findings if f.harm) for each in done]
        quantiles = ", ".join(f"{q:.2f}" for q in np.quantile(ratios, [0.5, 0.9, 0.99, 1.0]))
        print(
            f"{name}: {draws - codes.count('ok')} of {draws} not ok, u larger by {quantiles} (50, 90, 99, 100 %)"
        )
        print("   ", {code: codes.count(code) for code in codes if code != "ok"}, flush=True)


def enlarged(estimate) -> float:
    """The largest ratio of u to u without faults in doubt."""
    doubts = [item.share for item in estimate.budget if "not excluded" in item.source]
    parts = [sum(share.get(name, 0.0) for share in doubts) for name in estimate.names]
    return float(np.sqrt(1.0 / (1.0 - max(parts))))


def summary(sound, done) -> dict:
    """Rms shift over u of the coefficient with the largest, verdicts, the names of what does harm, and of those
    that end ok the share in which a finding says that the plan hides faults."""
    kept = [k for k, each in enumerate(done) if len(each.names)]
    shift = np.array([(done[k].values - sound[k].values) / done[k].u for k in kept])
    ok = np.array([done[k].status.value == "ok" for k in kept])
    rms = np.sqrt(np.mean(np.square(shift), axis=0))
    worst = int(np.argmax(rms))
    verdicts, codes = {}, {}
    for each in done:
        verdicts[each.status.value] = verdicts.get(each.status.value, 0) + 1
        for code in {finding.code for finding in each.findings if finding.harm}:
            codes[code] = codes.get(code, 0) + 1
    return {
        "told": float(
            np.mean([says_blind(done[k]) for k, each in zip(kept, ok, strict=True) if each] or [1.0])
        ),
        "name": done[kept[0]].names[worst],
        "rms": float(rms[worst]),
        "sound_u": float(np.mean([sound[k].u[worst] / done[k].u[worst] for k in kept])),
        "ok": float(np.mean(ok)),
        "rms_of_ok": float(np.sqrt(np.mean(np.square(shift[ok][:, worst])))) if ok.any() else 0.0,
        "verdicts": verdicts,
        "codes": codes,
    }


def table(before: dict, after: dict) -> str:
    """Markdown of two campaigns."""
    lines = []
    for test_name in TESTS:
        titles = [
            "fault",
            "size",
            "shift before",
            "ok before",
            "shift after",
            "ok after",
            "shift of those ok",
            "told",
            "named",
        ]
        lines += [f"\n**{test_name}**\n", "| " + " | ".join(titles) + " |", "|---" * len(titles) + "|"]
        for key, new in after.items():
            own, fault, size = key.split("|")
            if own != test_name:
                continue
            old = before.get(key)
            codes = ", ".join(f"{c} {n}" for c, n in sorted(new["codes"].items(), key=lambda item: -item[1]))
            was = f"{old['rms']:.1f} u of {old['name']} | {100 * old['ok']:.0f} %" if old else "|"
            now = f"{new['rms']:.1f} u of {new['name']} | {100 * new['ok']:.0f} % | "
            now += f"{new['rms_of_ok']:.1f} u" if new["ok"] else ""
            said = f"{100 * new['told']:.0f} %" if new["rms"] > 2.0 and new["ok"] > 0.02 else ""
            lines.append(f"| {fault} | {size} | {was} | {now} | {said} | {codes} |")
    return "\n".join(lines)


def main() -> None:
    """Make a campaign, or a table of two."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--out", type=Path, default=Path("build/faults.json"))
    parser.add_argument("--only", default="")
    parser.add_argument("--fault", default="")
    parser.add_argument("--before", type=Path)
    parser.add_argument("--after", type=Path)
    parser.add_argument("--sound", type=int)
    given = parser.parse_args()
    if given.sound:
        of_sound(given.sound, given.out.parent / f"{given.out.stem}-sound", given.only)
        return
    if given.after:
        print(table(json.loads(given.before.read_text()), json.loads(given.after.read_text())))
        return
    campaign(given.draws, given.out.parent / f"{given.out.stem}-files", given.only, given.fault, given.out)


if __name__ == "__main__":
    main()
