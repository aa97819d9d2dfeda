"""Lines of a text that are no rows of cells, recognised: what they are, and the names and units of their numbers."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from inercal.foundation.records.read.rewriting import (
    NUMBER,
    PLACE,
    STAMP,
    documents,
    fields_of,
    flat,
    json_object,
    shape_of,
)
from inercal.foundation.records.read.table import FileOptions
from inercal.foundation.records.recognise.words import said, unit_of

_LOOKED_AT = 400
_FEWEST = 20  # lines of a message
_PATTERNS = 40  # lines of one row at most
_NUMBERS = 60  # of a row with words
_WORDED = re.compile(rf"[^\W\d][^:=(\[]*[:=(\[]\s*{NUMBER}")  # a word and its number in one cell
_CELL = re.compile(rf"\"?(?:{STAMP}|{NUMBER}|{NUMBER},\d+|nan)\"?", re.IGNORECASE)

#: fields of messages that the manuals of their makers define, behind the word
_MESSAGES = {
    "VNIMU": "mag_x mag_y mag_z acc_x[m/s^2] acc_y[m/s^2] acc_z[m/s^2] gyro_x[rad/s] gyro_y[rad/s] gyro_z[rad/s] "
    "temperature[degC] pressure",
    **dict.fromkeys(("RAWIMUA", "RAWIMUSA"), "week time[s] status acc_z -acc_y acc_x gyro_z -gyro_y gyro_x"),
    **dict.fromkeys(
        ("RAWIMUXA", "RAWIMUSXA"), "info type week time[s] status acc_z -acc_y acc_x gyro_z -gyro_y gyro_x"
    ),
}


@dataclass(frozen=True)
class LinesFound:
    """Lines that are no rows of cells: the keys of ``[file]`` that read them, and names (k,) and units (k,) of the
    numbers, empty where nothing says them; columns go by their ``names`` if they are of objects or documents."""

    options: FileOptions
    names: tuple[str, ...]
    units: tuple[str | None, ...] = ()

    @property
    def named(self) -> tuple[str, ...]:
        """The names by which the columns are found, none where they are found by number."""
        return self.names if self.options.lines else ()


def lines_found(lines: Sequence[str]) -> LinesFound | None:
    """The lines of a text whose first are given, where they are no rows of cells; None where they are, or nothing."""
    full = [line.rstrip() for line in lines[:_LOOKED_AT] if line.strip()]
    if len(full) < _FEWEST:
        return None
    if sum(line.lstrip().startswith(("{", "[{")) for line in full) > 0.8 * len(full):
        return _objects(full)
    if sum(line.strip() == "---" for line in full) > max(3, len(full) / 100):
        return _documents(lines)
    stamped = sum(re.match(rf"\s*\[?{STAMP}\]?\s*->", line) is not None for line in full)
    alone = sum(re.fullmatch(rf"\s*\[?{STAMP}\]?\s*", line) is not None for line in full)
    if stamped > 0.8 * len(full) or len(full) / 3 <= alone < 0.7 * len(full):
        return _patterns(full)
    return _messages(full) or (_patterns(full) if _worded(full) else None)


def _objects(lines: Sequence[str]) -> LinesFound | None:
    """Objects of JSON."""
    return _of_records([flat(found) for line in lines if (found := json_object(line)) is not None], "json")


def _documents(lines: Sequence[str]) -> LinesFound | None:
    """Documents between lines of three dashes."""
    document = documents()
    found = [held for line in lines[: 40 * _LOOKED_AT] if (held := document(line)) is not None]
    return _of_records(found, "documents")


def _of_records(records: Sequence[dict[str, str]], what: str) -> LinesFound | None:
    """Records with the names that most of them have."""
    counts = Counter(name for record in records for name in record)
    names = tuple(name for name, count in counts.items() if 2 * count > len(records))
    if len(records) < 5 or len(names) < 2:
        return None
    return LinesFound(FileOptions(lines=what), names)


def _messages(lines: Sequence[str]) -> LinesFound | None:
    """The message, of several that begin with a word each, whose names speak most of sensors, or the longest."""
    rows: dict[tuple[str, int], int] = {}
    for line in lines:
        if re.match(r"[%$#]?[A-Za-z]", line):
            fields = fields_of(line)
            numbers = sum(re.fullmatch(rf"\s*{NUMBER}\s*", field) is not None for field in fields[1:])
            if (
                len(fields) > 3
                and 2 * numbers >= len(fields) - 1
                and re.fullmatch(r"[A-Za-z][\w/]*", fields[0])
            ):
                key = fields[0], len(fields)
                rows[key] = rows.get(key, 0) + 1
    groups = {key: count for key, count in rows.items() if count >= _FEWEST}
    firsts = [re.split(r"[\s,;]", line.strip(), maxsplit=1)[0] for line in lines]
    changes = sum(one != other for one, other in pairwise(firsts))
    if len(groups) > 1 and len({width for _, width in groups}) == 1 and changes < 4 * len(groups):
        return None  # labels of parts, one after the other, are no messages
    if not groups or 2 * sum(groups.values()) < len(lines):
        return None
    if (
        len(groups) == 1
        and sum(groups.values()) > 0.9 * len(lines)
        and "*" not in lines[-1]
        and ";" not in lines[-1]
    ):
        (key,) = groups
        if key[0] not in _MESSAGES:
            return None  # one word before all rows is a column of labels
    named = {key: _names_of_message(key, lines) for key in groups}
    word, width = max(groups, key=lambda key: (_speaking(named[key]), key[1]))
    names = named[word, width]
    return LinesFound(FileOptions(message=word), ("", *names) if names else ())


def _names_of_message(key: tuple[str, int], lines: Sequence[str]) -> tuple[str, ...]:
    """The names of the fields of a message: as manuals define them, or as a line says that holds its word."""
    word, width = key
    if word in _MESSAGES:
        return (*_MESSAGES[word].split(), *[""] * width)[: width - 1]
    for line in lines:
        fields = [field.strip() for field in re.split(r"[,\t]", line.strip().lstrip("#%$ "))]
        titles = fields[fields.index(word) + 1 :] if word in fields else []
        worded = [title for title in titles if title and not re.fullmatch(NUMBER, title)]
        if len(titles) >= width - 1 and len(worded) == len(titles):
            return tuple(titles[1 - width :])
    return ()


def _speaking(names: Sequence[str]) -> int:
    """The number of names that speak of an accelerometer or a gyro."""
    return sum(said(name).sensor in ("acc", "gyro") for name in names)


def _worded(lines: Sequence[str]) -> bool:
    """True where words stand between numbers: no mark parts the lines into cells of which most are numbers."""
    later = lines[len(lines) // 3 :]
    for mark in ("\t", ";", ",", "|", None):
        if mark and sum(any(map(_WORDED.search, line.split(mark))) for line in later) > 0.9 * len(later):
            continue
        cells = [cell.strip() for line in later for cell in line.split(mark) if cell.strip()]
        good = sum(_CELL.fullmatch(cell) is not None for cell in cells)
        if cells and good >= 0.55 * len(cells) and len(cells) > 1.5 * len(later):
            return False
    return True


def _patterns(lines: Sequence[str]) -> LinesFound | None:
    """Lines with words before numbers, one or several for a row, and the names that the words are."""
    shapes = [shape_of(line) for line in lines]
    counts = Counter(shape for shape in shapes if PLACE in shape)
    if not counts:
        return None
    often = counts.most_common(1)[0][1]
    kinds = [shape for shape, count in counts.items() if 2 * count > often]
    width = sum(shape.count(PLACE) for shape in kinds)
    if (
        often < 10
        or len(kinds) > _PATTERNS
        or not 2 <= width <= _NUMBERS
        or often * len(kinds) < 0.5 * len(lines)
    ):
        return None
    names: list[str] = []
    units: list[str | None] = []
    for shape in kinds:
        titles, measured = _titles(shape)
        names += titles
        units += measured
    if not any(names):
        names = _names_above(lines, shapes, kinds, width)
    return LinesFound(FileOptions(pattern=tuple(kinds)), tuple(names) if any(names) else (), tuple(units))


def _titles(shape: str) -> tuple[list[str], list[str | None]]:
    """Names and units of the numbers of a pattern, by the words before and behind them."""
    titles: list[str] = []
    measured: list[str | None] = []
    sensor, beside = "", ""
    axes = 0
    for before, after in pairwise(shape.split(PLACE)):
        own = re.split(r"[,;|\]]", before)[-1]
        label = own.strip(" \t:=>-[").strip()
        if not label and (of_all := re.split(r"[;|\]]", before)[-1].strip(" \t:=>,-[")):
            label = of_all
        if re.fullmatch(r"[xyzXYZ]", label) and sensor:
            label = f"{sensor} {label}"
        elif label and re.fullmatch(r".*[xyzXYZ]", label) and said(label).axis:
            sensor = re.sub(r"[\s_.]*[xyzXYZ]$", "", label)
        elif label:
            sensor, axes = label, 0
            bracket = re.search(r"[(\[]([^)\]]+)[)\]]?\s*$", label)
            beside = unit_of(bracket[1]) if bracket else ""
            if said(label).sensor in ("acc", "gyro", "mag") and not said(label).axis:
                label, axes = f"{label} x", 1
        elif sensor and 0 < axes < 3:
            label, axes = f"{sensor} {'xyz'[axes]}", axes + 1
        titles.append(label)
        unit = unit_of(re.split(r"[,;|]", after)[0].strip(" ()[]:="))
        measured.append(unit or beside or None)
    places = range(len(titles))
    for k in places:
        # a unit behind the last axis of a sensor is that of all three
        if (
            k >= 2
            and measured[k]
            and not measured[k - 1]
            and not measured[k - 2]
            and said(titles[k]).axis == "z"
        ):
            measured[k - 2 : k] = [measured[k]] * 2
    return titles, measured


def _names_above(lines: Sequence[str], shapes: Sequence[str], kinds: Sequence[str], width: int) -> list[str]:
    """The names in a line before the rows; the stamp in front of each line has none."""
    for line, shape in zip(lines, shapes, strict=True):
        if shape in kinds:
            break
        plain = re.sub(rf"^\s*\[?{STAMP}\]?\s*(?:->)?", "", line)
        cells = [
            cell.strip()
            for cell in re.split(r"[,;\t]" if re.search(r"[,;\t]", plain) else r"\s+", plain.strip())
        ]
        if len(cells) in (width, width - 1) and all(re.search(r"[^\W\d]", cell) for cell in cells):
            return ["time", *cells][-width:]
    return [""] * width
