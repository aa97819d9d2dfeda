"""Instruments: those of the store, and the history of each coefficient of one."""

from __future__ import annotations

import asyncio
import shlex
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, urlencode

from nicegui import ui

from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.pages.frame import PATIENCE, command, framed, heading, refused, table
from inercal.foundation.addresses import shown_address
from inercal.foundation.errors import InercalError
from inercal.laboratory.catalog import SHORT

if TYPE_CHECKING:
    from inercal.laboratory.catalog import Listed


def add(bench: Bench) -> None:
    """Add the pages."""

    @ui.page("/instruments", response_timeout=PATIENCE)
    async def show() -> None:
        with framed("Instruments"):
            try:
                found = await asyncio.to_thread(bench.instruments)
            except InercalError as error:
                refused(error)
                ui.label("The first result that is kept needs a store; make one with:").classes("quiet")
                command(
                    shlex.join(
                        [
                            "inercal",
                            "store",
                            "init",
                            *(["--store", shown_address(bench.store)] if bench.store else []),
                        ]
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

    @ui.page("/instrument")
    async def one(serial: str) -> None:
        with framed("Instruments"):
            place, spinner = ui.element("div").classes("w-full flex flex-col gap-3"), ui.spinner()
            await ui.context.client.connected()  # charts of many years take a moment
            with place:
                try:
                    _kept(*await asyncio.to_thread(bench.kept, serial))
                    await _history(bench, serial)
                except InercalError as error:
                    refused(error)
            spinner.delete()


async def _history(bench: Bench, serial: str) -> None:
    """The course of each coefficient of an instrument; raises `InputError`."""
    from inercal.laboratory.verbs import history

    heading("History")
    result = await asyncio.to_thread(history, serial, store=bench.store)
    page = await asyncio.to_thread(result.view.page)
    ui.label(f"{result.status.value}: {result.message}").classes("verdict")
    frame = (
        ui.element("iframe").props('title="history" sandbox="allow-scripts allow-popups"').classes("report")
    )
    frame.props["srcdoc"] = page
    words = ["inercal", "history", serial, "--report", "history.html"]
    command(shlex.join([*words, *(["--store", shown_address(bench.store)] if bench.store else [])]))


def _kept(results: Sequence[Listed], certificates: Sequence[Mapping[str, Any]]) -> None:
    """Results and certificates of an instrument, the newest first."""
    heading("Results")
    table(
        ["Date", "Result", "Command", "Verdict", ""],
        [
            [
                each.date,
                each.id[:SHORT],
                each.command,
                f"{each.status}: {each.message}",
                "" if each.superseded_by is None else f"superseded by {each.superseded_by[:SHORT]}",
            ]
            for each in reversed(results)
        ],
    )
    heading("Certificates")
    if not certificates:
        ui.label("None was written yet.").classes("quiet")
        return

    def links(number: str) -> None:
        target = f"/api/v1/certificates/{quote(number, safe='')}"
        ui.link("page", f"{target}?page=true", new_tab=True).classes("mr-4")
        ui.link("XML", target, new_tab=True)

    table(
        ["Number", "Issued", "Supersedes", ""],
        [
            [each["number"], each["issued"][:10], each["supersedes"] or "", partial(links, each["number"])]
            for each in reversed(certificates)
        ],
    )
