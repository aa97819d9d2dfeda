"""REST of the workbench with spoiled bodies, names and files: an answer, or one sentence; nothing lands elsewhere."""

import asyncio
import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from spoiled import spoil, whole

from inercal.errors import InercalError
from inercal.workbench.bench import open_bench

pytest.importorskip("nicegui")

import httpx

from inercal.workbench.rest import rest_of


class Answering:
    """The REST of a bench whose queue runs nothing, and the folder around it."""

    def __init__(self, folder):
        self.folder = folder
        self.bench = open_bench(folder / "work", str(folder / "store"))
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
    "examples", [120, pytest.param(5000, marks=pytest.mark.campaign)], ids=["short", "rest"]
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
