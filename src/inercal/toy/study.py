"""Studies of a toy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inercal._toml import Strict
from inercal.errors import StudyError


class ToyStudyFile(Strict):
    """Study of a toy."""

    toy: dict[str, float] = {}


@dataclass(frozen=True)
class ToySettings:
    """Settings of a toy: its true ``mean``, and the keys that were ``given``."""

    mean: float
    given: Mapping[str, Any]


def toy_study(data: Mapping[str, Any], path: str | Path) -> ToySettings:
    """Settings of a toy. Raises `StudyError`."""
    mean = data.get("toy", {}).get("mean")
    if not isinstance(mean, float):
        raise StudyError(path, f"toy.mean: found {mean!r}, expected a number")
    return ToySettings(mean, data)
