"""Columns to channels: the map as a table to choose in, beside its text; whoever shows the recording is told."""

from __future__ import annotations

import tomllib
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import ui

from inercal.bench.workbench.form import Widget, as_toml
from inercal.bench.workbench.pages.frame import button, copy, heading, refused, saved, table, told
from inercal.bench.workbench.sessions import MAP, Session, put
from inercal.faces.studies.text import changed, toml, with_keys
from inercal.foundation._files import read_bytes
from inercal.foundation.errors import InercalError
from inercal.foundation.records.channels import is_channel, nearest
from inercal.foundation.records.guess import columns_of

_NONE = ""
"""Choice of a column for a channel that is not in the file."""


@dataclass(frozen=True)
class FileColumns:
    """The columns of one file in a map: the ``table`` they stand in, the file, those that are there, and in use."""

    table: str
    path: Path
    there: tuple[str, ...]
    columns: Mapping[str, Any]


def parts_of(
    session: Session, data: Mapping[str, Any], there: Mapping[Path, tuple[str, ...]]
) -> Iterator[FileColumns]:
    """The parts of a map, of which one is of all recordings alike, or each of a file of its own."""
    files = [part for part in data.get("file", {}).items() if isinstance(part[1], dict)]
    if not files:
        path = session.recordings[0]
        yield FileColumns("columns", path, there.get(path, ()), data.get("columns", {}))
    for number, (name, part) in enumerate(files):
        named = [path for path in session.recordings if path.name == part.get("path")]
        path = (named or session.recordings)[min(number, len(session.recordings) - 1) if not named else 0]
        yield FileColumns(f"file.{name}.columns", path, there.get(path, ()), part.get("columns", {}))


def columns_there(session: Session) -> dict[Path, tuple[str, ...]]:
    """The columns of each recording as a map writes them; none where they cannot be told."""
    found = {}
    for path in session.recordings:
        with suppress(InercalError):
            found[path] = tuple(dict.fromkeys(_written(each) for each in columns_of(path)))
    return found


def _written(origin: Any) -> str:
    """The place of a channel in its file, as the map writes it."""
    return toml(origin)


class Columns:
    """The map of a session whose recordings have the columns ``there``; ``redrawn`` shows them anew after a change."""

    def __init__(
        self, session: Session, there: Mapping[Path, tuple[str, ...]], redrawn: Callable[[], Awaitable[None]]
    ) -> None:
        self.session, self.there, self.redrawn = session, there, redrawn
        heading("Columns to channels")
        self.place = ui.element("div").classes("w-full flex flex-col gap-2")
        self.fill()
        ui.label("What else a map can say is changed in its text:").classes("quiet")
        with ui.element("div").classes("w-full copies"):
            self.text = ui.textarea(value=self.written).classes("w-full command")
            self.text.props(f'outlined autogrow aria-label="text of {MAP}"')
            with ui.row().classes("items-center"):
                button(f"Save {MAP}", self.save)
                copy(f"copy {MAP}")
                saved(session, MAP)

    @property
    def written(self) -> str:
        """The map as it is."""
        return read_bytes(self.session.folder / MAP).decode(errors="replace")

    def fill(self) -> None:
        """The table of channels, a row each, and the row for one more."""
        self.place.clear()
        with self.place:
            try:
                data = tomllib.loads(self.written)
            except tomllib.TOMLDecodeError as error:
                refused(error)
                return
            for part in parts_of(self.session, data, self.there):
                rows = [
                    self.row(part, name, entry)
                    for name, entry in part.columns.items()
                    if isinstance(entry, dict) and is_channel(name)
                ]
                if part.table != "columns":
                    ui.label(part.path.name)
                table(["Channel", "From", "Unit", "Sign", "Kind"], rows)
                self.more(part)

    def row(self, part: FileColumns, name: str, entry: Mapping[str, Any]) -> list[Any]:
        """A channel of the map."""
        path = f"{part.table}.{name}"
        taken = _written(entry.get("from"))

        async def column(chosen: str) -> None:
            if chosen == _NONE:
                await self.write({path: ""})
                self.fill()
            else:
                await self.change(f"{path}.from", chosen, "value")

        def origin() -> None:
            columns = [_NONE, *dict.fromkeys([taken, *part.there])]
            of = {each: each.strip('"') or "not in the file" for each in columns}
            ui.select(of, value=taken, on_change=lambda event: column(event.value)).props(
                f'dense aria-label="column of {name}"'
            ).classes("w-40")

        def unit() -> None:
            field = ui.input(value=str(entry.get("unit", ""))).props(f'dense aria-label="unit of {name}"')
            field.classes("w-28")
            field.on("change", lambda: self.change(f"{path}.unit", field.value, "text"))

        def sign() -> None:
            ui.select(
                {1: "+", -1: "-"}, value=entry.get("sign", 1),
                on_change=lambda event: self.change(f"{path}.sign", str(event.value), "value"),
            ).props(f'dense aria-label="sign of {name}"')  # fmt: skip

        def kind() -> None:
            ui.select(
                ["rate", "increment"], value=entry.get("kind", "rate"),
                on_change=lambda event: self.change(f"{path}.kind", event.value, "text"),
            ).props(f'dense aria-label="kind of {name}"')  # fmt: skip

        return [name, origin, unit, sign, kind]

    def more(self, part: FileColumns) -> None:
        """One more channel, by its name, from a column that is not in use."""
        used = {_written(each.get("from")) for each in part.columns.values() if isinstance(each, dict)}
        left = [each for each in part.there if each not in used]
        if not left:
            return
        with ui.row().classes("items-center"):
            name = ui.input("One more channel", placeholder="temperature").props("dense").classes("w-40")
            column = ui.select({each: each.strip('"') for each in left}, label="From", value=left[0])
            column.props("dense").classes("w-40")
            unit = ui.input("Unit", placeholder="degC").props("dense").classes("w-28")
            button("Add", partial(self.add, part, name, column, unit))

    async def add(self, part: FileColumns, name: ui.input, column: ui.select, unit: ui.input) -> None:
        """Add a channel."""
        given = (name.value or "").strip()
        if not is_channel(given):
            ui.notify(f"{given or 'no name'} is no channel: {nearest(given)}", type="negative")
            return
        path = f"{part.table}.{given}"
        keys = {f"{path}.from": str(column.value)}
        if unit.value:
            keys[f"{path}.unit"] = as_toml(unit.value, "text")
        await self.write(keys)
        self.fill()

    async def change(self, path: str, value: str, widget: Widget) -> None:
        """One key of the map is changed."""
        with told():
            await self.keep(changed(self.written, path, as_toml(value, widget)))

    async def write(self, keys: Mapping[str, str]) -> None:
        """Keys of the map are set to their TOML, or taken out where that is empty."""
        with told():
            await self.keep(with_keys(self.written, keys))

    async def save(self) -> None:
        """The text of the map is taken as it was typed."""
        with told():
            tomllib.loads(self.text.value)
            await self.keep(self.text.value)
            self.fill()

    async def keep(self, text: str) -> None:
        """Write the map, and have the recording shown by it."""
        put(self.session, MAP, text)
        self.text.set_value(text)
        await self.redrawn()
