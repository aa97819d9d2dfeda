"""Run the campaign: a line of JSON for each record.

    python -m benchmarks.held_out.run --half development --draws 2 --seed 1 --out FOLDER
    python -m benchmarks.held_out.run --half sound --draws 20 --seed 1 --out FOLDER

Of a fault a record is first made without it, then with a size that is raised or lowered in a few trials until the
worst affected value is shifted by what was drawn: 2 to 20 of its u in the sound record, evenly over orders of
magnitude. What was reached is in the line, for harm may saturate.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from .kinds import Kind, check, kinds
from .systems import METHODS, fault_of, scene_of
from .trial import Act, Array, Case, Outcome, Scene, outcome, pattern

TRIALS = 4
"""Most sizes that are tried for a shift."""


def seed_of(*words: object) -> int:
    """A seed that depends on all words, and on nothing else."""
    return zlib.crc32("/".join(map(str, words)).encode())


def shifts(made: Outcome, sound: Outcome) -> Array:
    """How far each value is from that of the sound record, over its u there; nan where that has none."""
    before = {
        name: (value, u) for name, value, u in zip(sound.names, sound.value, sound.u, strict=True) if u > 0
    }
    none = (np.nan, np.nan)
    found = [
        abs(value - before.get(name, none)[0]) / before.get(name, none)[1]
        for name, value in zip(made.names, made.value, strict=True)
    ]
    return np.array(found, float)


def shift(made: Outcome, sound: Outcome) -> float:
    """The largest of these shifts; nan where nothing is comparable."""
    found = shifts(made, sound)
    return float(np.nanmax(found)) if np.isfinite(found).any() else float("nan")


def sized(
    scene: Scene, act: Act, nominal: float, wanted: float, sound: Outcome
) -> tuple[float, float, Case, Outcome]:
    """The size by which a fault shifts a value by about what is wanted, that shift, its case and its outcome."""
    size, tried = nominal, []
    for _ in range(TRIALS):
        case = scene.case(act, size)
        made = outcome(case)
        reached = shift(made, sound)
        tried.append((abs(np.log(reached / wanted)) if reached > 0 else np.inf, size, reached, case, made))
        if tried[-1][0] < np.log(1.3):
            break
        factor = wanted / reached if reached > 0 else (0.1 if np.isnan(reached) else 10.0)
        size *= float(np.clip(factor, 0.02, 50.0))
    _, size, reached, case, made = min(tried, key=lambda trial: trial[0])
    return size, reached, case, made


def line(system: str, method: str, kind: Kind | None, draw: int, seed: int) -> dict[str, Any]:
    """What is written of one record."""
    begun = time.process_time()
    name = kind.name if kind else "sound"
    rng = np.random.default_rng(seed_of(seed, system, method, name, draw))
    scene = scene_of(system, method, rng)
    first = scene.case()
    sound = outcome(first)
    row: dict[str, Any] = {"system": system, "method": method, "kind": name, "draw": draw, "seed": seed}
    made, case, size, wanted, reached = sound, first, 0.0, 0.0, 0.0
    if kind:
        act, nominal = fault_of(kind)
        wanted = float(np.exp(rng.uniform(np.log(2.0), np.log(20.0))))
        size, reached, case, made = sized(scene, act, nominal, wanted, sound)
        found = reached if np.isfinite(reached) else None
        row |= {"size": size, "wanted": wanted, "reached": found, "sound_status": sound.status}
        row |= {
            "pattern_z": pattern(case, first),
            "sound_codes": [finding["code"] for finding in sound.findings],
        }
    row |= {"status": made.status, "message": made.message, "findings": made.findings}
    if made.names:
        ratios = [np.abs(made.error) / np.where(width > 0, width, np.inf) for width in (made.u, made.U)]
        moved = shifts(made, sound)
        row["worst"] = made.names[int(np.nanargmax(ratios[0]))]
        row["error_over_u"] = float(np.nanmax(ratios[0]))
        row["named"] = any(row["worst"].split("@")[0] in finding["harm"] for finding in made.findings)
        rounded = np.round(np.stack([made.error / made.u, ratios[1], moved], axis=1), 4)
        row["values"] = dict(
            zip(made.names, np.where(np.isfinite(rounded), rounded, 0.0).tolist(), strict=True)
        )
    return row | {"processor_s": round(time.process_time() - begun, 2)}


def main() -> None:
    """Run what the command line asks for."""
    reader = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    reader.add_argument("--half", choices=("development", "held-out", "sound"), required=True)
    reader.add_argument("--draws", type=int, default=1)
    reader.add_argument("--seed", type=int, default=1)
    reader.add_argument("--out", type=Path, required=True, help="folder, for a file of lines for each method")
    reader.add_argument("--only", default="", help="methods whose system/method begins so, such as imu/")
    reader.add_argument("--kind", default="", help="one kind by its name")
    asked = reader.parse_args()
    check()
    asked.out.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")
    for system, method in METHODS:
        if not f"{system}/{method}".startswith(asked.only):
            continue
        listed = [None] if asked.half == "sound" else kinds(asked.half)
        with (asked.out / f"{asked.half}-{system}-{method}.jsonl").open("a") as file:
            for kind in listed:
                if kind and (
                    (kind.system, kind.method) != (system, method) or asked.kind not in ("", kind.name)
                ):
                    continue
                for draw in range(asked.draws):
                    row = line(system, method, kind, draw, asked.seed)
                    file.write(json.dumps(row) + "\n")
                    file.flush()


if __name__ == "__main__":
    main()
