"""The place of a store: a folder with ``store.db`` and ``objects``, or the URL of a database."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from inercal.errors import InputError

VARIABLE = "INERCAL_STORE"
"""Variable of the environment that says where the store is."""


@dataclass(frozen=True)
class Place:
    """A store as it was named, without passwords, and the URL of its database; ``folder`` where it is one."""

    shown: str
    url: str
    folder: Path | None


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
        return Place(_without_password(text), text, None)
    folder = Path(text).expanduser()
    return Place(str(folder), f"sqlite:///{folder.absolute() / 'store.db'}", folder)


def _without_password(url: str) -> str:
    """A URL that may be shown."""
    scheme, _, rest = url.partition("://")
    user, at, host = rest.rpartition("@")
    return f"{scheme}://{user.partition(':')[0]}{at}{host}"
