"""Tables of what `run.py` wrote.

    python -m benchmarks.held_out.table FOLDER

Of faults: *harmful* are records of which some value is off by more than 3 U / 2, and is shifted by more than 2 u.
Of these *unsaid* ended ok with no finding about the fault, *said* ended ok with one: it is new against the sound
record, or it is in both and has a word of the fault's theme. The others are not ok. *Faint* are those of the unsaid
whose pattern in the readings is below 3 of their noise: no test of the data can show them.
Of sound records: those that are not ok, and the upper 95 % bound of their share (Clopper and Pearson).
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

Rows = list[dict[str, Any]]
HARM = 1.5
"""Error over U from which a record is harmful."""
SHIFT = 2.0
"""Shift over u from which a record is harmful."""
FAINT = 3.0
"""Size of a pattern below which no test can be asked to see it."""


def read(folder: Path) -> Rows:
    """All lines of a folder."""
    return [
        json.loads(text) for file in sorted(folder.glob("*.jsonl")) for text in file.read_text().splitlines()
    ]


def bound(count: int, of: int) -> float:
    """Upper 95 % bound of a share, one-sided (Clopper and Pearson)."""
    return 1.0 if count >= of else float(beta.ppf(0.95, count + 1, of - count))


def harmed(row: dict[str, Any]) -> list[str]:
    """Values that are off by more than 3 U / 2, and by the fault; the worst first."""
    rows = [
        (-over_U, name)
        for name, (_, over_U, moved) in row.get("values", {}).items()
        if over_U > HARM and moved > SHIFT
    ]
    return [name for _, name in sorted(rows)]


def named(row: dict[str, Any]) -> bool:
    """True where a finding says that the worst of the harmed values may be off."""
    return any(harmed(row)[0].split("@")[0] in finding["harm"] for finding in row["findings"])


THEMES = {
    r"disc|chuck|lobed|unbalanced_table": r"harmonic|encoder",
    r"clock": r"clock|sample rate|time stamps|time_base",
    r"gravity": r"gravity",
    r"latitude": r"latitude",
    r"heading|azimuth|zero_set": r"heading|azimuth|zero",
    r"backlash|coupling|memory|sticking": r"hysteresis|backlash|sense",
    r"tilts|settles|tilted|trunnion|sags": r"tilt|level|perpendicular",
    r"k2": r"K2|second-order|square",
    r"cubic|bend": r"K3|third|linear",
    r"weight_on_gyro|feels_force|tilted_platter": r"specific force|g-sens|gravity",
    r"warm|drift|heats|sun|creep|switched|restart|wanders|settl": r"drifts?\b(?! of)|warm|trend|ramp|walk",
    r"supply|scale|droops|wheel_speed": r"scale",
    r"magnet|field": r"field",
    r"axis_turned|bracket": r"axis of|turned",
    r"place|pivot": r"position|lever|place",
    r"mistyped|exchanged|lost|moved": r"outl|exchanged|mistyped|single",
    r"clip|limit": r"satur|clip|short of|range",
    r"unequal|asymm": r"asymm|for positive",
    r"yaw|roll": r"yaw|roll",
    r"late": r"late|delay",
    r"mount|slipped": r"mount|slip",
}
"""Words in the name of a kind of fault, and words by which a finding would be about it."""


def said(row: dict[str, Any]) -> bool:
    """True where a finding is about the fault: new against the sound record, or with a word of its theme."""
    words = "|".join(words for names, words in THEMES.items() if re.search(names, row["kind"]))
    codes = Counter(finding["code"] for finding in row["findings"]) - Counter(row["sound_codes"])
    return bool(codes) or any(
        words and re.search(words, json.dumps(finding), re.IGNORECASE) for finding in row["findings"]
    )


def faint(row: dict[str, Any]) -> bool:
    """True where the readings hardly show the fault."""
    return row.get("pattern_z") is not None and row["pattern_z"] < FAINT


def groups(rows: Rows) -> Iterable[tuple[str, Rows]]:
    """Rows by system and method, and all of them."""
    names = list(dict.fromkeys(f"{row['system']}/{row['method']}" for row in rows))
    for name in names:
        yield name, [row for row in rows if f"{row['system']}/{row['method']}" == name]
    yield "all", rows


def main() -> None:
    """Print the tables of a folder."""
    rows = read(Path(sys.argv[1]))
    made = [row for row in rows if row["kind"] != "sound"]
    faults = [row for row in made if row["sound_status"] == "ok"]
    sound = [row for row in rows if row["kind"] == "sound"]
    if faults:
        print(
            "| method | records | harmful | ok, unsaid | of these faint | ok, said | not ok | of these named |"
        )
        print("| --- | --- | --- | --- | --- | --- | --- | --- |")
        for name, group in groups(faults):
            hurt = [row for row in group if harmed(row)]
            fine = [row for row in hurt if row["status"] == "ok"]
            unsaid = [row for row in fine if not said(row)]
            bad = [row for row in hurt if row["status"] != "ok"]
            counts = [
                len(group),
                len(hurt),
                len(unsaid),
                sum(map(faint, unsaid)),
                len(fine) - len(unsaid),
                len(bad),
            ]
            print(f"| {name} | {' | '.join(map(str, counts))} | {sum(map(named, bad))} |")
        print(f"\nleft out, for their sound record is not ok: {len(made) - len(faults)}")
        print("\nharmful and ok, unsaid:")
        for row in faults:
            if harmed(row) and row["status"] == "ok" and not said(row):
                z, name = row["pattern_z"], f"{row['system']}/{row['method']}/{row['kind']}"
                over_u, over_U, moved = row["values"][harmed(row)[0]]
                size = f"{abs(over_u):.1f} u ({over_U:.1f} U, shifted by {moved:.1f} u) of {harmed(row)[0]}"
                print(f"  {name}: {size}, pattern {'-' if z is None else round(z, 1)}")
    if sound:
        print("\n| method | sound records | not ok | share at most | rms of error over u | largest |")
        print("| --- | --- | --- | --- | --- | --- |")
        for name, group in groups(sound):
            bad = sum(row["status"] != "ok" for row in group)
            z = np.array([value for row in group for value, _, _ in row.get("values", {}).values()], float)
            z = z[np.isfinite(z)]
            figures = f"{np.sqrt(np.mean(z**2)):.2f} | {np.abs(z).max():.1f}" if len(z) else "- | -"
            print(f"| {name} | {len(group)} | {bad} | {100 * bound(bad, len(group)):.1f} % | {figures} |")


if __name__ == "__main__":
    main()
