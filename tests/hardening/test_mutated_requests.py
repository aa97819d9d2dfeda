"""REST of the workbench with spoiled bodies, names and files: an answer, or one sentence; nothing lands elsewhere."""

import asyncio
import itertools
import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from spoiled import spoil, whole

from inercal.bench.workbench.bench import open_bench
from inercal.foundation.errors import InercalError

pytest.importorskip("nicegui")

import httpx

from inercal.bench.workbench.jobs import JobState
from inercal.bench.workbench.rest import rest_of


class Answering:
    """The REST of a bench whose queue runs nothing, and the folder around it."""

    def __init__(self, folder, at_work=False):
        self.folder = folder
        self.bench = open_bench(folder / "work", str(folder / "store"))
        if not at_work:
            self.bench.close()  # jobs are taken in, none is begun
        self.transport = httpx.ASGITransport(rest_of(self.bench))
        self.around = self.outside()

    def outside(self):
        return sorted(path.name for path in self.folder.iterdir())

    def ask(self, method, path, **given):
        """Ask; an answer of 500 is raised as the fault it comes from."""

        async def asked():
            async with httpx.AsyncClient(transport=self.transport, base_url="http://here") as client:
                return await client.request(method, path, **given)

        answer = asyncio.run(asked())
        assert answer.status_code < 500
        if answer.status_code == 422 and "error" in (told := answer.json()):
            assert "\n" not in told["error"].strip(), told
            assert len(told["error"]) < 2000
        assert self.outside() == self.around
        return answer


@pytest.fixture(scope="module")
def answering(tmp_path_factory):
    found = Answering(tmp_path_factory.mktemp("requests"))
    assert found.ask("POST", "/sessions", json={"example": "ferraris-si"}).status_code == 201
    assert found.ask("POST", "/sessions", json={"title": "empty"}).status_code == 201
    return found


SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(-(10**25), 10**25), st.floats(), st.text(max_size=12),
    st.sampled_from(["imu", "xsens", "0001", "../..", "100 Hz", "nan Hz", "<img src=x>", "\0", "x" * 5000]),
)  # fmt: skip
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=4,
)
BODIES = st.one_of(
    st.dictionaries(
        st.sampled_from(
            [
                "title",
                "example",
                "kind",
                "rate",
                "number",
                "instrument",
                "tool",
                "settings",
                "earlier",
                "x",
                "source",
                "record",
                "to",
                "every",
            ]
        ),
        VALUES,
        max_size=4,
    ),
    VALUES,
)
NUMBERS = st.sampled_from(["0001", "0002", "00001", "9999", "..", "%2e%2e", "0001%2f..", "x", "٠٠٠١", "-1"])
ROUTES = st.sampled_from(
    [
        ("POST", "/sessions"),
        ("GET", "/sessions/{}"),
        ("POST", "/sessions/{}/study"),
        ("POST", "/sessions/{}/kind"),
        ("POST", "/sessions/{}/jobs"),
        ("GET", "/sessions/{}/files/{}"),
        ("PUT", "/sessions/{}/files/{}"),
        ("GET", "/jobs/{}"),
        ("POST", "/jobs/{}/cancel"),
        ("POST", "/jobs/{}/again"),
        ("GET", "/jobs/{}/files/{}"),
        ("POST", "/jobs/{}/keep"),
        ("POST", "/jobs/{}/certificate"),
        ("POST", "/jobs/{}/convert"),
        ("POST", "/jobs/{}/compare"),
        ("POST", "/sessions/{}/design"),
        ("POST", "/plans"),
        ("POST", "/validation"),
        ("GET", "/instruments/{}"),
        ("GET", "/certificates/{}"),
        ("POST", "/sessions/{}/live"),
        ("GET", "/sessions/{}/live"),
        ("GET", "/sessions/{}/live/rows"),
        ("GET", "/sessions/{}/live/files/{}"),
        ("POST", "/sessions/{}/live/stop"),
        ("PUT", "/lab"),
    ]
)
RAW = st.one_of(
    st.binary(max_size=200), st.just(b'{"a":' * 3000), BODIES.map(lambda body: json.dumps(body).encode())
)


def spoil_requests(answering, examples):
    """Ask for so many spoiled things."""

    @settings(
        derandomize=True,
        deadline=None,
        max_examples=examples,
        suppress_health_check=list(HealthCheck),
        database=None,
    )
    @given(ROUTES, NUMBERS, NUMBERS, RAW, st.sampled_from(["application/json", "text/plain", "image/png"]))
    def ask(route, number, name, body, kind):
        method, path = route
        data = {} if method == "GET" else {"content": body, "headers": {"content-type": kind}}
        answering.ask(method, path.format(number, name), **data)

    ask()


@pytest.mark.parametrize(
    "examples", [60, pytest.param(5000, marks=pytest.mark.campaign)], ids=["short", "rest"]
)
def test_a_spoiled_request_has_an_answer(answering, examples):
    spoil_requests(answering, examples)


SUFFIXES = {"csv": ".csv", "npz": ".npz", "mat v5": ".mat", "map, TOML": ".toml"}
"""Formats that are uploaded, spoiled."""


@pytest.mark.parametrize(
    "seeds", [range(4), pytest.param(range(4, 100), marks=pytest.mark.campaign)], ids=["short", "rest"]
)
@pytest.mark.parametrize("name", SUFFIXES)
def test_a_spoiled_upload_is_looked_at_or_refused(answering, name, seeds):
    content = whole.content(name)
    for seed in seeds:
        body = spoil.spoiled(np.random.default_rng(seed), name, content)
        number = answering.ask("POST", "/sessions", json={"title": "spoiled"}).json()["session"]
        if name == "map, TOML":
            answering.ask("PUT", f"/sessions/{number}/files/log.csv", content=whole.content("csv"))
        answering.ask("PUT", f"/sessions/{number}/files/log{SUFFIXES[name]}", content=body)
        answering.ask("POST", f"/sessions/{number}/study", json={"rate": "100 Hz"})
        said = ""
        try:
            answering.bench.look(answering.bench.sessions.get(number))
        except InercalError as error:
            said = str(error)
        assert "\n" not in said


ODD = (
    "\0", "a\0b", "\ud800", "x\udfff", "\ud83d\ude00", "x" * 200_000, "", " ", "\n", "\x1b[2J\x7f", "\u202e", "--",
    "--out=/x", "-x", "../../..", "/etc/passwd", "s3://a/b", "nan", "1e999", "{out}", "<script>", None, True, -1,
    10**30, 1.5, [], ["\0"], {}, {"\ud800": "\0"}, [[["x"]]],
)  # fmt: skip
"""Values in the place of a text."""

WITH_BODY = (
    ("POST", "/sessions", {"title": "a test"}),
    ("POST", "/sessions", {"title": "a test", "example": None}),
    ("POST", "/sessions", {"example": "no such"}),
    ("POST", "/sessions/0001/study", {"kind": "imu", "rate": "100 Hz"}),
    ("POST", "/sessions/0001/kind", {"kind": "imu"}),
    ("POST", "/sessions/0001/design", {"settings": ["a.b=1", "c=2"]}),
    (
        "POST",
        "/sessions/0002/live",
        {"source": "replay:log.csv", "record": "a.csv", "to": ["text:x"], "every": "1 s"},
    ),
    ("POST", "/plans", {"kind": "no such"}),
    ("POST", "/jobs/00001/keep", {"instrument": "A, B, 1"}),
    ("POST", "/jobs/00001/convert", {"tool": "kalibr"}),
    ("POST", "/jobs/00001/compare", {"earlier": "00001"}),
    ("POST", "/jobs/00001/certificate", {"number": "T-1"}),
    ("PUT", "/lab", "[laboratory]"),
)
"""Routes that take a body, each with a sound one."""


def mutated(rng, body):
    """A body with odd values in the place of one or two of its own, or of the whole."""
    value = ODD[rng.integers(len(ODD))]
    match body:
        case dict() if rng.random() < 0.95:
            key = [*body, "more"][rng.integers(len(body) + 1)]
            inner = body.get(key)
            return {
                **body,
                key: mutated(rng, inner) if isinstance(inner, list) and rng.random() < 0.7 else value,
            }
        case list() if body:
            return [*body[:1], value, *body[1:]]
    return value


def with_a_job(folder):
    """The folder with a session that plans a test, one without a recording, and a job that has left a result."""
    found = Answering(folder)
    assert found.ask("POST", "/plans", json={"kind": "turntable"}).status_code == 201
    assert found.ask("POST", "/plans", json={"kind": "aoa"}).status_code == 201
    job = found.bench.queue.add("0001", folder / "work" / "sessions" / "0001", ["calibrate", "imu"])
    (job.folder / "result.json").write_text("{}")


def begun(job, *_):
    """A process that is begun with the arguments of a job, and does nothing."""
    command = [sys.executable, "-S", "-E", "-c", "", str(job.folder), *job.arguments]
    return subprocess.Popen(command, cwd=job.where, stdin=subprocess.PIPE)


def answers(answering):
    """Look whether the queue lives, and jobs and sessions are told."""
    assert answering.bench.queue._thread.is_alive()
    for path in ("/jobs", "/sessions"):
        answer = answering.ask("GET", path)
        assert answer.status_code == 200
        assert answer.json()


@pytest.mark.parametrize(
    "count", [150, pytest.param(2000, marks=pytest.mark.campaign)], ids=["short", "rest"]
)
def test_no_body_ends_the_queue(count, tmp_path, monkeypatch):
    """Each is answered, jobs are begun or refused, and all is told, also after a restart on the same folder."""
    with_a_job(tmp_path)
    monkeypatch.setattr("inercal.bench.workbench.jobs._begun", begun)
    answering, rng = Answering(tmp_path, at_work=True), np.random.default_rng(14)
    statuses = set()
    try:
        for method, path, body in itertools.islice(itertools.cycle(WITH_BODY), count):
            sent = json.dumps(mutated(rng, body)).encode()
            answer = answering.ask(method, path, content=sent, headers={"content-type": "application/json"})
            statuses.add(answer.status_code)
        answers(answering)
        last = answering.ask("POST", "/validation").json()["job"]
        assert (
            answering.bench.queue.wait(last, 60.0).state is JobState.INTERRUPTED
        )  # begun, and it left no exit code
    finally:
        answering.bench.close()
    assert {201, 202, 422} <= statuses
    again = Answering(tmp_path, at_work=True)
    try:
        answers(again)
    finally:
        again.bench.close()


def test_every_route_with_a_body_is_among_them(answering):
    paths = rest_of(answering.bench).openapi()["paths"]
    there = {
        (method.upper(), path)
        for path, methods in paths.items()
        for method, route in methods.items()
        if "requestBody" in route
    }
    numbers = ("0001", "0002", "00001")
    tried = {
        (method, "/".join("{number}" if part in numbers else part for part in path.split("/")))
        for method, path, _ in WITH_BODY
    }
    assert there == tried


@pytest.mark.parametrize("odd", ["\0", "\ud800"])
@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("POST", "/sessions", {"title": "{}"}),
        ("POST", "/sessions/0001/design", {"settings": ["a=1", "{}"]}),
        ("POST", "/jobs/00001/keep", {"instrument": "A, B, {}"}),
        ("POST", "/jobs/00001/certificate", {"number": "{}"}),
        ("POST", "/sessions/0002/live", {"source": "udp://here:5/{}"}),
        ("POST", "/sessions/0002/live", {"source": "udp://127.0.0.1:5", "to": ["text:{}"]}),
        ("POST", "/sessions/0001/study", {"rate": "{} Hz"}),
        ("PUT", "/lab", "# {}"),
    ],
)
def test_a_text_that_is_none_is_refused_at_the_door(method, path, body, odd, tmp_path):
    with_a_job(tmp_path)
    answering = Answering(tmp_path)
    before = [answering.ask("GET", each).json() for each in ("/jobs", "/sessions")]
    sent = json.dumps(body).replace("{}", json.dumps(odd)[1:-1]).encode()
    answer = answering.ask(method, path, content=sent, headers={"content-type": "application/json"})
    assert answer.status_code == 422, answer.text
    assert [answering.ask("GET", each).json() for each in ("/jobs", "/sessions")] == before
