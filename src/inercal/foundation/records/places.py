"""Counts, places and names in words: ``3 gaps``, ``line 17``, ``rows 102-118, 240 and 3 more``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

_SHOWN = 3


def counted(count: int, noun: str) -> str:
    """The count with its noun, in the plural unless it is one."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def counted_names(names: Sequence[str], most: int = 5) -> str:
    """The first few names, and how many more: ``a, b, c and 4 more``."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def shortened(name: str, most: int = 80) -> str:
    """A name of a file's own, at most so many characters of it; what is not printable, such as a line end, is a �."""
    name = "".join(character if character.isprintable() else "\ufffd" for character in name[: 2 * most])
    return name if len(name) <= most else f"{name[: most - 3]}..."


def places(word: str, numbers: ArrayLike) -> str:
    """Numbers (ascending, counted from 1) as ranges: the first few, and how many ranges more."""
    rows = np.asarray(numbers, dtype=np.int64)
    if rows.size == 0:
        return ""
    breaks = np.flatnonzero(np.diff(rows) > 1)
    starts, ends = rows[np.r_[0, breaks + 1]], rows[np.r_[breaks, -1]]
    shown = zip(starts[:_SHOWN].tolist(), ends[:_SHOWN].tolist(), strict=True)
    text = ", ".join(str(start) if start == end else f"{start}-{end}" for start, end in shown)
    more = f" and {len(starts) - _SHOWN} more" if len(starts) > _SHOWN else ""
    return f"{word}{'' if rows.size == 1 else 's'} {text}{more}"
