"""The workbench for programs of a laboratory: sessions, jobs and results over HTTP, under ``/api/v1``.

Every request carries the key as ``Authorization: Bearer KEY``. Described by ``/api/v1/openapi.json``. Measurements by
wire are begun, looked at and stopped here, too.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from fastapi import Body, FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse
from pydantic import BaseModel

from inercal import __version__
from inercal.bench.workbench.bench import Bench, said_of
from inercal.bench.workbench.jobs import Job
from inercal.bench.workbench.live_status import rows, status
from inercal.bench.workbench.measurements import FOLDER, Wish, WishedMeasurement, interval_of, recordings
from inercal.bench.workbench.sessions import Session, receive, safe_name
from inercal.foundation.errors import InercalError, InputError, spelt


class Wanted(BaseModel):
    """The wish for a measurement: address of the source, name of a new file for its raw rows, addresses of sinks, and
    the interval of the rows, such as "0.1 s"."""

    source: str
    record: str = ""
    to: list[str] = []
    every: str = ""


def add_live(app: FastAPI, bench: Bench, file: Callable[[Path, str], FileResponse]) -> None:
    """Add the routes of measurements; ``file`` gives a file of a folder."""

    def of(number: str) -> WishedMeasurement:
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


class Begun(BaseModel):
    """The wish for a session: a title, or the name of a shipped example."""

    title: str = "session"
    example: str | None = None


class Asked(BaseModel):
    """The wish for a study: the kind, guessed where it is not said; the sample rate of files without times."""

    kind: str | None = None
    rate: str | None = None


class CertificateWish(BaseModel):
    """The wish for a certificate: its number."""

    number: str


def rest_of(bench: Bench) -> FastAPI:
    """The application that answers programs."""
    app = FastAPI(
        title="inercal workbench",
        version=__version__,
        docs_url=None,  # its page would load scripts from elsewhere
        redoc_url=None,
    )

    app.add_exception_handler(InercalError, _refused)
    app.add_exception_handler(RequestValidationError, _misshapen)

    @app.get("/sessions")
    def sessions() -> list[dict[str, Any]]:
        """All sessions, the newest first."""
        return [_of_session(each) for each in bench.sessions]

    @app.post("/sessions", status_code=201)
    def begin(begun: Begun) -> dict[str, Any]:
        """Begin a session."""
        if begun.example is not None:
            return _of_session(bench.sessions.begin_with(begun.example))
        return _of_session(bench.sessions.begin(begun.title))

    @app.get("/sessions/{number}")
    def session(number: str) -> dict[str, Any]:
        """One session: its files, kind, map and study."""
        return _of_session(bench.sessions.get(number))

    @app.delete("/sessions/{number}", status_code=204)
    def drop(number: str) -> Response:
        """Delete a session with its files; its jobs stay."""
        bench.drop(bench.sessions.get(number))
        return Response(status_code=204)

    @app.put("/sessions/{number}/files/{name:path}", status_code=201)
    async def upload(number: str, name: str, request: Request) -> dict[str, Any]:
        """Add a file, the body of the request as it is; a TOML file is the column map or the study."""
        session = bench.sessions.get(number)
        path = await receive(session, name, request.stream())
        bench.arrived(session, path)
        return {"file": path.name, "bytes": path.stat().st_size}

    @app.get("/sessions/{number}/files/{name:path}")
    def download(number: str, name: str) -> FileResponse:
        """A file of a session."""
        return _file(bench.sessions.get(number).folder, name)

    @app.post("/sessions/{number}/study", status_code=201)
    def begin_study(number: str, asked: Asked) -> dict[str, Any]:
        """Write a commented study and a guessed map for the recordings."""
        found = bench.begin_study(bench.sessions.get(number), asked.kind, asked.rate)
        return _of_session(found)

    @app.post("/sessions/{number}/kind")
    def set_kind(number: str, kind: Annotated[str, Body(embed=True)]) -> dict[str, Any]:
        """Say which kind of study a session has, as where it was uploaded."""
        return _of_session(bench.sessions.of_kind(bench.sessions.get(number), kind))

    @app.post("/sessions/{number}/jobs", status_code=202)
    def run(number: str) -> dict[str, Any]:
        """Put the calibration into the queue."""
        return _of_job(bench.run(bench.sessions.get(number)))

    @app.post("/plans", status_code=201)
    def plan(kind: Annotated[str, Body(embed=True)]) -> dict[str, Any]:
        """Begin a session with a study of that kind to plan a test with, without a recording."""
        return _of_session(bench.plan(kind))

    @app.post("/validation", status_code=202)
    def validate() -> dict[str, Any]:
        """Run the published and closed-form cases on this machine."""
        return _of_job(bench.validate())

    @app.get("/instruments")
    def instruments() -> list[dict[str, Any]]:
        """The instruments of the store."""
        return bench.instruments()

    @app.get("/instruments/{serial:path}")
    def kept(serial: str) -> dict[str, Any]:
        """Results and certificates of an instrument, the oldest first."""
        results, certificates = bench.kept(serial)
        own = ("id", "command", "status", "message", "made", "measured", "superseded_by")
        return {
            "results": [{name: getattr(each, name) for name in own} for each in results],
            "certificates": [
                {name: each[name] for name in ("number", "issued", "supersedes")} for each in certificates
            ],
        }

    @app.get("/certificates/{number:path}")
    def certificate(number: str, page: bool = False) -> Response:
        """A certificate of the store: its XML, or its page."""
        content = bench.certificate(number, page)
        kind = "text/html" if page else "application/xml"
        headers = (
            _ALONE if page else {**_ALONE, "content-disposition": 'attachment; filename="certificate.xml"'}
        )
        return Response(content, media_type=kind, headers=headers)

    @app.get("/jobs")
    def jobs() -> list[dict[str, Any]]:
        """All jobs, the newest first."""
        return [_of_job(each) for each in bench.queue]

    @app.get("/jobs/{number}")
    def job(number: str) -> dict[str, Any]:
        """One job: its state, what it is at, what it has said."""
        return _of_job(bench.queue.get(number))

    @app.post("/jobs/{number}/cancel")
    def cancel(number: str) -> dict[str, Any]:
        """Take a job out of the queue, or end it."""
        return _of_job(bench.queue.cancel(number))

    @app.post("/jobs/{number}/again", status_code=202)
    def again(number: str) -> dict[str, Any]:
        """The same command as a new job."""
        return _of_job(bench.queue.again(number))

    @app.get("/jobs/{number}/files/{name:path}")
    def result(number: str, name: str) -> FileResponse:
        """A file that a job wrote: result.json, report.html, certificate.xml, certificate.html."""
        return _file(bench.queue.get(number).folder, name)

    @app.post("/jobs/{number}/keep", status_code=202)
    def keep(number: str, instrument: Annotated[str, Body(embed=True)] = "") -> dict[str, Any]:
        """Keep the result of a job in the store: "maker, model, serial" where its study does not say."""
        return _of_job(bench.keep(bench.queue.get(number), instrument))

    @app.post("/jobs/{number}/convert", status_code=202)
    def convert(number: str, tool: Annotated[str, Body(embed=True)]) -> dict[str, Any]:
        """Write the result of a job as another tool reads it: imu_tk, imucal, kalibr or psins."""
        return _of_job(bench.convert(bench.queue.get(number), tool))

    @app.post("/sessions/{number}/design", status_code=202)
    def design(number: str, settings: Annotated[list[str], Body(embed=True)] = []) -> dict[str, Any]:  # noqa: B006
        """Search for a better plan of the test that the study of a session plans; settings as of --set."""
        return _of_job(bench.design(bench.sessions.get(number), settings))

    @app.post("/jobs/{number}/compare", status_code=202)
    def compare(number: str, earlier: Annotated[str, Body(embed=True)]) -> dict[str, Any]:
        """Set the result of a job beside that of an earlier one."""
        return _of_job(bench.compare(bench.queue.get(earlier), bench.queue.get(number)))

    @app.post("/jobs/{number}/certificate", status_code=202)
    def certify(number: str, certified: CertificateWish) -> dict[str, Any]:
        """Write a certificate of the result of a job, with what the laboratory states."""
        return _of_job(bench.certify(bench.queue.get(number), certified.number))

    @app.put("/lab", status_code=204)
    def state(text: Annotated[str, Body(media_type="text/plain")]) -> Response:
        """Say what the laboratory states in its certificates: the text of a lab.toml."""
        bench.state(text)
        return Response(status_code=204)

    add_live(app, bench, _file)
    return app


_REPORT_POLICY = (
    "sandbox allow-scripts allow-popups; default-src 'none'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; img-src data:; font-src data:"
)
"""Of a report, which may hold names from a foreign file: alone in its frame, without any request."""

_ALONE = {"content-security-policy": _REPORT_POLICY, "cache-control": "no-store"}
"""Headers of a file that may hold names from a foreign one: it asks for nothing, and nobody keeps it."""


def _refused(request: Request, error: Exception) -> JSONResponse:
    """The sentence of a refusal."""
    return JSONResponse({"error": said_of(error)}, 422)


def _misshapen(request: Request, error: Exception) -> JSONResponse:
    """The sentence for a body that is not as described; it may hold bytes that are no text."""
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    where = ".".join(str(each) for each in first["loc"][:6])
    words = spelt(f"{where}: {first['msg']}")
    return JSONResponse({"error": f"{words}, expected it as /api/v1/openapi.json says"}, 422)


def _of_session(session: Session) -> dict[str, Any]:
    """A session as JSON."""
    return {
        "session": session.id,
        "title": session.title,
        "kind": session.kind,
        "made": session.made,
        "files": [spelt(path.name) for path in session.files],
        "map": None if session.map is None else session.map.name,
        "study": None if session.study is None else session.study.name,
    }


def _of_job(job: Job) -> dict[str, Any]:
    """A job as JSON."""
    return {
        "job": job.id,
        "session": job.session,
        "state": job.state.value,
        "code": job.code,
        "command": job.command,
        "made": job.made,
        "progress": job.progress,
        "said": job.said,
        "result": None if job.result is None else job.result.name,
        "report": None if job.report is None else job.report.name,
    }


def _file(folder: Path, name: str) -> FileResponse:
    """A file of a folder, as one that a browser shows alone or saves; raises `InputError`."""
    path = folder / safe_name(name)
    if safe_name(name) != name or not path.is_file():
        raise InputError(name, "no such file")
    kind = {".html": "text/html", ".json": "application/json", ".xml": "application/xml"}
    media = kind.get(path.suffix.lower(), "application/octet-stream")
    if media != "text/html":
        return FileResponse(path, media_type=media, filename=path.name, headers=_ALONE)
    return FileResponse(path, media_type=media, headers=_ALONE)
