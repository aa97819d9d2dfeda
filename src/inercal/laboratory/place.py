"""The place of a store: a folder with ``store.db`` and ``objects``, or the URL of a database."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from inercal.foundation.addresses import shown_address
from inercal.foundation.errors import InputError

VARIABLE = "INERCAL_STORE"
"""Variable of the environment that says where the store is."""


@dataclass(frozen=True)
class Place:
    """A store as it may be ``shown``, without secrets, and the URL of its database; ``folder`` where it is one."""

    shown: str
    url: str = field(repr=False)
    folder: Path | None

    @property
    def given(self) -> str:
        """The text by which another process finds the same place; it may hold a secret, and is shown nowhere."""
        return self.url if self.folder is None else str(self.folder.absolute())


def place_of(given: str | None, environment: Mapping[str, str] = os.environ) -> Place:
    """The place that is given, else that of the environment, else ``store`` in the user's data folder.

    Raises `InputError` for an empty text.
    """
    text = given if given is not None else environment.get(VARIABLE)
    if text is None:
        from platformdirs import user_data_path

        text = str(user_data_path("inercal", appauthor=False) / "store")
    if not text.strip() or "\0" in text:
        raise InputError("--store", f"found {text!r}, expected a folder or the URL of a database")
    if "://" in text:
        return Place(shown_address(text), text, None)
    if re.match(r"[A-Za-z][\w+.-]+:", text) and "@" in text:
        raise InputError(
            "--store", "found an address without ://, expected one such as postgresql://host/database"
        )
    folder = Path(text).expanduser()
    return Place(str(folder), f"sqlite:///{folder.absolute() / 'store.db'}", folder)
