"""How the benchmarks measure: works in turn, ratios of the same round, and one row for each figure.

Ours and the peers run one after the other within a round, and a ratio is taken within its round: what else the
machine does in that minute meets both. A row has the median over the rounds, with the least and the largest.
"""

import argparse
import json
import os
import platform
import resource
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version

from inercal import __version__

#: processes that are started find modules compiled to bytecode, as those of an installed package are
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

#: seconds of this process on its processors, and seconds on the wall
PROCESSOR, WALL = time.process_time, time.perf_counter


def of_processes() -> float:
    """Seconds that ended processes of ours took on their processors: what one waits where nothing else runs."""
    spent = os.times()
    return spent.children_user + spent.children_system


@dataclass(frozen=True)
class Spread:
    """Median, least and largest of several rounds."""

    median: float
    low: float
    high: float

    def times(self, factor: float) -> "Spread":
        """In another unit."""
        return Spread(self.median * factor, self.low * factor, self.high * factor)

    def __str__(self) -> str:
        if self.low == self.high:
            return f"{self.median:.3g}"
        return f"{self.median:.3g} ({self.low:.3g} to {self.high:.3g})"


@dataclass(frozen=True)
class Row:
    """One figure: a time or an error of ours, and that of a peer beside it; less is better.

    Attributes
    ----------
    what, size : str
        The work, and how much of it.
    unit : str
        Of ``ours`` and ``theirs``.
    ours : Spread
    peer : str
        Name and version of the peer; empty without one.
    theirs, ratio : Spread or None
        The peer's figure, and it over ours in the same round: above 1 ours is better.
    at_most, at_least : float or None
        What is promised of ``ours`` (at most) or of ``ratio`` (at least), by its median.
    """

    what: str
    size: str
    unit: str
    ours: Spread
    peer: str = ""
    theirs: Spread | None = None
    ratio: Spread | None = None
    at_most: float | None = None
    at_least: float | None = None

    @property
    def holds(self) -> bool | None:
        """Whether what is promised holds; None where nothing is."""
        if self.at_most is not None:
            return self.ours.median <= self.at_most
        if self.at_least is not None and self.ratio is not None:
            return self.ratio.median >= self.at_least
        return None

    @property
    def promised(self) -> str:
        """What is promised, and whether it holds."""
        if self.holds is None:
            return ""
        unit = "" if self.unit == "1" else f" {self.unit}"
        what = f"≤ {self.at_most:.3g}{unit}" if self.at_most is not None else f"ratio ≥ {self.at_least:.3g}"
        return f"{what}: {'holds' if self.holds else '**does not hold**'}"


def named(package: str) -> str:
    """A peer's name with its version."""
    return f"{package} {version(package)}"


def spread(values: Sequence[float]) -> Spread:
    """Median, least and largest."""
    return Spread(statistics.median(values), min(values), max(values))


def in_turn(
    works: Mapping[str, Callable[[], object]],
    rounds: int,
    clock: Callable[[], float] = PROCESSOR,
    least: float = 0.0,
) -> dict[str, list[float]]:
    """Seconds of each work in each round, one work after the other.

    Before several rounds goes one that compiles, loads and warms up, and is not counted. A short work is repeated until
    ``least`` seconds are over, and has the mean.
    """
    warm = int(rounds > 1)
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds + warm):
        for name, work in works.items():
            calls, began = 0, clock()
            while calls == 0 or clock() - began < least:
                work()
                calls += 1
            seconds[name].append((clock() - began) / calls)
    return {name: each[warm:] for name, each in seconds.items()}


def row(
    what: str,
    size: str,
    unit: tuple[str, float],
    ours: Sequence[float],
    peer: str = "",
    theirs: Sequence[float] | None = None,
    **promised: float,
) -> Row:
    """A row of times in seconds, shown in ``unit`` (its name, and how many make a second)."""
    name, factor = unit
    mine = spread(ours).times(factor)
    if theirs is None:
        return Row(what, size, name, mine, **promised)
    ratio = spread([b / a for a, b in zip(ours, theirs, strict=True)])
    return Row(what, size, name, mine, peer, spread(theirs).times(factor), ratio, **promised)


def table(rows: Sequence[Row]) -> str:
    """Rows as a Markdown table."""
    lines = [
        "| Work | Size | Ours | Peer | Its figure | Peer / ours | Promised |",
        "|---|---|---|---|---|---|---|",
    ]
    for each in rows:
        theirs, ratio = ("" if x is None else str(x) for x in (each.theirs, each.ratio))
        unit = "" if each.unit == "1" else f" {each.unit}"
        beside = f"{theirs}{unit}" if theirs else ""
        cells = (each.what, each.size, f"{each.ours}{unit}", each.peer, beside, ratio, each.promised)
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def as_objects(rows: Sequence[Row]) -> list[dict]:
    """Rows as plain objects, with whether what is promised holds."""
    return [asdict(each) | {"holds": each.holds} for each in rows]


def machine() -> dict[str, object]:
    """Machine and versions."""
    packages = ("numpy", "scipy", "numba", "AllanTools", "filterpy", "imucal", "SALib")
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "system": platform.platform(),
        "processors": os.cpu_count(),
        "load": load,
        "python": platform.python_version(),
        "versions": {"inercal": __version__} | {name: version(name) for name in packages},
    }


def yardstick() -> float:
    """Milliseconds of the processor that a fixed piece of work takes just now: how fast the machine is."""
    began = PROCESSOR()
    sum(k * k for k in range(1_000_000))
    return 1e3 * (PROCESSOR() - began)


def peak() -> float:
    """Largest memory of this process so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def alone(rows: Callable[[bool], list[Row]], text: str | None) -> None:
    """The main function of a script: its rows as a table, or as JSON."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="little work, once; no figure is to be judged")
    parser.add_argument("--json", action="store_true", help="objects in place of a table")
    options = parser.parse_args()
    found = rows(options.quick)
    print(json.dumps(as_objects(found)) if options.json else table(found))
