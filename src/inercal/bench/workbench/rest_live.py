"""Measurements by wire for programs: begun, looked at and stopped over HTTP."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.responses import FileResponse
from pydantic import BaseModel

from inercal.bench.workbench.bench import Bench
from inercal.bench.workbench.live_status import rows, status
from inercal.bench.workbench.measurements import FOLDER, Live, Wish, interval_of, recordings
from inercal.foundation.errors import InputError


class Wanted(BaseModel):
    """The wish for a measurement: address of the source, name of a new file for its raw rows, addresses of sinks, and
    the interval of the rows, such as "0.1 s"."""

    source: str
    record: str = ""
    to: list[str] = []
    every: str = ""


def add_live(app: FastAPI, bench: Bench, file: Callable[[Path, str], FileResponse]) -> None:
    """Add the routes of measurements; ``file`` gives a file of a folder."""

    def of(number: str) -> Live:
        session = bench.sessions.get(number)
        live = bench.measurements.of(session)
        if live is None:
            raise InputError(session.title, "is not measured")
        return live

    @app.post("/sessions/{number}/live", status_code=201)
    def begin(number: str, wanted: Wanted) -> dict[str, Any]:
        """Begin to measure a source by the study and map of a session."""
        wish = Wish(wanted.source, wanted.record, tuple(wanted.to), interval_of(wanted.every))
        return status(bench.measurements.begin(bench.sessions.get(number), wish))

    @app.get("/sessions/{number}/live")
    def look(number: str) -> dict[str, Any]:
        """A measurement at this moment: state, rest, last values with u, channels, counts, alarms."""
        return status(of(number))

    @app.get("/sessions/{number}/live/rows")
    def rows_after(number: str, after: int = 0) -> dict[str, Any]:
        """Rows of the last two minutes that came after a number."""
        return rows(of(number), after)

    @app.post("/sessions/{number}/live/stop")
    def stop(number: str) -> dict[str, Any]:
        """Ask a measurement to end in order."""
        return status(bench.measurements.stop(bench.sessions.get(number)))

    @app.get("/sessions/{number}/live/files")
    def files(number: str) -> list[str]:
        """Names of what measurements of a session have recorded or written."""
        return [path.name for path in recordings(bench.sessions.get(number))]

    @app.get("/sessions/{number}/live/files/{name:path}")
    def recorded(number: str, name: str) -> FileResponse:
        """A file that a measurement has recorded or written."""
        return file(bench.sessions.get(number).folder / FOLDER, name)
