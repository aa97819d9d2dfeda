"""Instruments: those of the store, and the history of each coefficient of one."""

from __future__ import annotations

import asyncio
import shlex
from functools import partial
from typing import Any
from urllib.parse import urlencode

from nicegui import ui

from inercal.errors import InercalError
from inercal.workbench.bench import Bench
from inercal.workbench.pages.frame import PATIENCE, command, framed, refused, table


def add(bench: Bench) -> None:
    """Add the pages."""

    @ui.page("/instruments", response_timeout=PATIENCE)
    async def show() -> None:
        with framed("Instruments"):
            try:
                found = await asyncio.to_thread(_instruments, bench)
            except InercalError as error:
                refused(error)
                ui.label("The first result that is kept needs a store; make one with:").classes("quiet")
                command(
                    shlex.join(
                        ["inercal", "store", "init", *(["--store", bench.store] if bench.store else [])]
                    )
                )
                return
            if not found:
                ui.label("No result was kept yet.").classes("quiet")
            table(
                ["Maker", "Model", "Serial", "Results", "Last"],
                [
                    [
                        row["maker"],
                        row["model"],
                        partial(
                            ui.link, row["serial"], f"/instrument?{urlencode({'serial': row['serial']})}"
                        ),
                        str(row["results"]),
                        str(row["last"] or "")[:10],
                    ]
                    for row in found
                ],
            )

    @ui.page("/instrument", response_timeout=PATIENCE)
    async def one(serial: str) -> None:
        from inercal.face.laboratory import history

        with framed("Instruments"):
            try:
                result = await asyncio.to_thread(history, serial, store=bench.store)
                page = await asyncio.to_thread(result.view.page)
            except InercalError as error:
                refused(error)
                return
            ui.label(f"{result.status.value}: {result.message}").classes("verdict")
            frame = (
                ui.element("iframe")
                .props('title="history" sandbox="allow-scripts allow-popups"')
                .classes("report")
            )
            frame.props["srcdoc"] = page
            words = ["inercal", "history", serial, "--report", "history.html"]
            command(shlex.join([*words, *(["--store", bench.store] if bench.store else [])]))


def _instruments(bench: Bench) -> list[dict[str, Any]]:
    """The instruments of the store."""
    from inercal.laboratory.catalog import instruments
    from inercal.laboratory.store import open_store

    return instruments(open_store(bench.store))
