"""Are the logs of many makers recognised without a word? Each dialect is written, guessed, read and compared.

    python benchmarks/dialect_files.py --half development [--only NAME] [--show]

Outcomes: `right` (all channels that are there, in their units, none that is not), `part` (right, but not all), `asked`
(the map has a question), `nothing`, `wrong` (a channel or a unit that is not so, without a word), `refused` (not read).
"""

import argparse
import tempfile
import zlib
from collections import Counter
from pathlib import Path

import numpy as np
from dialects.motion import truth
from dialects.split import HALVES, half

from inercal.foundation.errors import InercalError
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map


def outcome(dialect, folder, show=False):
    """The outcome of a dialect in a word, and why."""
    rng = np.random.default_rng(zlib.crc32(dialect.name.encode()))
    true = truth(dialect.motion, dialect.rate, 40.0, rng)
    path = Path(folder) / dialect.file
    path.write_bytes(dialect.make(true))
    rate = None if dialect.t else f"{dialect.rate:g} Hz"
    try:
        try:
            text = guess_map(path, rate=rate)
        except InercalError as error:
            if rate is None or "column of times" not in str(error):
                raise
            text = guess_map(path)
        (Path(folder) / "map.toml").write_text(text)
        if show:
            print(text)
        if "[columns" not in "\n".join(line for line in text.splitlines() if not line.startswith("#")):
            return ("nothing", "") if dialect.acc or dialect.gyro else ("right", "")
        if 'grade = "guess"' in text:
            return "asked", ""
        record = read(path, Path(folder) / "map.toml")
    except InercalError as error:
        return ("refused", str(error)) if dialect.acc or dialect.gyro else ("right", "")
    return compared(dialect, true, record)


def compared(dialect, true, record):
    """The outcome of a record that was read."""
    wanted = {f"{sensor}_{axis}" for sensor in ("acc", "gyro") if getattr(dialect, sensor) for axis in "xyz"}
    if "single" in dialect.name:
        wanted = {"gyro_z"}
    found = {name for name in record.columns if name.startswith(("acc_", "gyro_"))}
    if found - wanted:
        return "wrong", f"{', '.join(sorted(found - wanted))} that is not there"
    for name in sorted(found):
        sensor, axis = name.split("_")
        values = record[name].values
        real = (true.acc if sensor == "acc" else true.gyro)[:, "xyz".index(axis)]
        if len(values) != len(real):
            return "wrong", f"{name}: {len(values)} of {len(real)} rows"
        size = np.max(np.abs(real - real.mean())) + 1e-9
        if dialect.counts and record[name].unit.symbol == "count":
            fit = np.corrcoef(values, real)[0, 1]
            if fit < 0.99:
                return "wrong", f"{name} is another column"
        elif record[name].unit.symbol == "count":
            return "wrong", f"{name} is in counts"
        elif np.max(np.abs((si := record[name].si()) - real)) > 0.01 * size + 0.006 * np.max(np.abs(real)):
            return "wrong", f"{name}: {si[5]:.4g} for {real[5]:.4g}"
        t = record[name].t
        if dialect.t and np.max(np.abs((t - t[0]) - (true.t - true.t[0]))) > 2e-3:
            return "wrong", f"times: {t[-1] - t[0]:.6g} s for {true.t[-1]:.6g} s"
    return (
        ("right", "")
        if found == wanted
        else ("part" if found else "nothing", ", ".join(sorted(wanted - found)))
    )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--half", choices=HALVES, required=True)
    parser.add_argument("--only", help="dialects whose name holds this")
    parser.add_argument("--show", action="store_true", help="print the maps")
    asked = parser.parse_args()
    counts = {True: Counter(), False: Counter()}
    for dialect in half(asked.half):
        if asked.only and asked.only not in dialect.name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            word, why = outcome(dialect, folder, asked.show)
        counts[dialect.acc or dialect.gyro][word] += 1
        if word != "right":
            print(f"{dialect.name}: {word} {why[:150]}")
    for sensor, count in counts.items():
        print("with a sensor:" if sensor else "without:", dict(count))


if __name__ == "__main__":
    main()
