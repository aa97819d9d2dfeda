"""Every fault of every system: its shift in u, the verdict, and what is said. The catalogue of the book.

    python benchmarks/faults.py --draws 10 --sound 60 --workers 2 --checkpoint build/faults.jsonl
    python benchmarks/faults.py --table build/faults.jsonl

Recordings come from simulators that share no code with inercal (`independent/`), with a fault and without, of the same
noise where the fault allows it. One row for each recording goes into the checkpoint, in one format for all systems
(`catalogue/fault.py`); rows that are there are not made again. The result is kept in docs/uncertainty/faults.md.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.stats import beta

SYSTEMS = ("imu", "strapdown", "turntable", "selfcal", "aoa")
HARMFUL = 2.0
"""A shift [U/2, which is u but for few degrees of freedom] from which a fault does harm."""


def module(system: str):
    """The faults of a system."""
    return importlib.import_module(f"catalogue.{system}")


def made(system: str, name: str, draw: int) -> dict:
    """One row; the empty name is a sound recording."""
    of = module(system)
    if not name:
        from catalogue.fault import Fault

        return of.sound(draw).row(system, "", draw, Fault(of.sound))
    fault = of.faults()[name]
    return fault.make(draw).row(system, name, draw, fault)


def upper(count: int, of: int) -> float:
    """The upper 95 % limit (Clopper and Pearson) of a share."""
    return 1.0 if count >= of else float(beta.ppf(0.95, count + 1, of - count))


def share(count: int, of: int) -> str:
    """A share with its limit."""
    return f"{count} of {of} (at most {100.0 * upper(count, of):.1f} %)" if of else "none"


def read(path: Path) -> list[dict]:
    """The rows of a checkpoint, each once."""
    if not path.exists():
        return []
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.endswith("}")]
    return list({(each["system"], each["fault"], each["draw"]): each for each in rows}.values())


def wanted(systems, draws: int, sound: int, only: str) -> Iterator[tuple[str, str, int]]:
    """What is to be made: first one draw of everything, then the next."""
    names = {system: [name for name in module(system).faults() if only in name] for system in systems}
    for draw in range(max(draws, sound)):
        for system in systems:
            if draw < draws:
                yield from ((system, name, draw) for name in names[system])
            if draw < sound and not only:
                yield system, "", draw


def campaign(tasks: list[tuple[str, str, int]], workers: int, path: Path) -> None:
    """Make the rows that lack, and append each as it comes."""
    done = {(each["system"], each["fault"], each["draw"]) for each in read(path)}
    tasks = [task for task in tasks if task not in done]
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file, ProcessPoolExecutor(workers) as pool:
        waiting = [pool.submit(made, *task) for task in tasks]
        for number, future in enumerate(as_completed(waiting)):
            file.write(json.dumps(future.result()) + "\n")
            file.flush()
            print(f"\r{number + 1} of {len(tasks)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def judged(rows: list[dict]) -> dict[str, int]:
    """Counts: recordings with a fault, of them those that shift a value by more than 2 u, of these those that end ok
    untold though data could show it, told, and such as no data can show; sound recordings, and those not ok."""
    sound = [each for each in rows if not each["fault"]]
    harmed = [each for each in rows if each["fault"] and each["shift"] > HARMFUL]
    refused = [each for each in rows if each["fault"] and each["status"] == "refused"]
    ok = [each for each in harmed if each["status"] == "ok"]
    seen = [each for each in harmed if not each["blind"]]
    return {
        "all": len(rows) - len(sound), "refused": len(refused), "harmed": len(seen),
        "untold": sum(not each["told"] and not each["blind"] for each in ok),
        "told": sum(each["told"] and not each["blind"] for each in ok),
        "blind": sum(each["blind"] for each in ok),
        "sound": len(sound), "not_ok": sum(each["status"] != "ok" for each in sound),
    }  # fmt: skip


def summary(rows: list[dict]) -> str:
    """Markdown of the headline, a row for each system."""
    lines = [
        "| system | with a fault | shifted by more than 2 u | of these `ok`, unsaid | `ok`, said | no data can show "
        "| sound, not `ok` |",
        "|---|---|---|---|---|---|---|",
    ]
    parts = {system: [each for each in rows if each["system"] == system] for system in SYSTEMS}
    for name, part in {**parts, "all": rows}.items():
        if part:
            n = judged(part)
            lines.append(
                f"| {name} | {n['all']} | {n['harmed']} | {share(n['untold'], n['harmed'])} | {n['told']} "
                f"| {n['blind']} | {share(n['not_ok'], n['sound'])} |"
            )
    return "\n".join(lines)


def catalogue(rows: list[dict]) -> str:
    """Markdown of every fault."""
    lines = []
    for system in SYSTEMS:
        of: dict[str, list[dict]] = defaultdict(list)
        for each in sorted(rows, key=lambda row: row["draw"]):
            if each["system"] == system and each["fault"]:
                of[each["fault"]].append(each)
        if of:
            lines += [
                f"\n### {system}\n",
                "| fault | shift [u] | ended `ok` | what is said |",
                "|---" * 4 + "|",
            ]
            faults = module(system).faults()
            lines += [entry(name, of[name], faults[name].blind) for name in faults if name in of]
    return "\n".join(lines)


def entry(name: str, rows: list[dict], blind: str) -> str:
    """One fault as a row."""
    numbers = [each["shift"] for each in rows if each["status"] != "refused" and each["of"]]
    size = f"{np.sqrt(np.mean(np.square(numbers))):.2g}" if numbers else "–"
    ok = [each for each in rows if each["status"] == "ok"]
    return f"| {name} | {size} | {len(ok)} of {len(rows)} | {said(rows, ok, blind)} |"


def said(rows: list[dict], ok: list[dict], blind: str) -> str:
    """What inercal says of a fault: found and by which names, in u, said though not found, or not seen."""
    codes = Counter(code for each in rows for code in each["named"] or [each["status"]] if each not in ok)
    names = ", ".join(f"`{code}`" for code, _ in codes.most_common(2))
    off = [each for each in ok if each["shift"] > HARMFUL]
    if blind:
        return f"no data can show it: {blind}" + ("; said" if any(each["told"] for each in rows) else "")
    if not ok:
        return f"found: {names}"
    else_in_u = "in u" if not codes else f"found in {len(rows) - len(ok)}: {names}; else in u"
    if not off:
        return else_in_u
    hidden = f"{len(off)} beyond 2 u, up to {max(each['shift'] for each in off):.2g} u"
    told = "hides, and is said" if all(each["told"] for each in off) else "**not seen**"
    return f"{told}: {hidden}" + (f"; found in {len(rows) - len(ok)}: {names}" if codes else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=10, help="of each fault")
    parser.add_argument("--sound", type=int, default=60, help="sound recordings of each system")
    parser.add_argument("--systems", nargs="+", choices=SYSTEMS, default=SYSTEMS)
    parser.add_argument("--only", default="", help="part of the fault's name")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--checkpoint", type=Path, default=Path("build/faults.jsonl"))
    parser.add_argument("--table", type=Path, help="print what a checkpoint holds")
    given = parser.parse_args()
    if not given.table:
        asked = list(wanted(given.systems, given.draws, given.sound, given.only))
        campaign(asked, given.workers, given.checkpoint)
    rows = read(given.table or given.checkpoint)
    print(summary(rows))
    print(catalogue(rows))


if __name__ == "__main__":
    main()
