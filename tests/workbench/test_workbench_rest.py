"""REST: from an uploaded recording to a result, a kept one and a certificate; what is refused, and how."""

import http.client
import json

import pytest
from serving import LAB, served

from inercal.examples import EXAMPLES, FOLDER
from rows import for_each


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    with served(tmp_path_factory.mktemp("rest") / "work") as found:
        yield found


def put(bench, session, name, data):
    return bench.ask(f"/api/v1/sessions/{session}/files/{name}", data, "PUT")


def test_from_an_upload_to_a_certificate(bench, tmp_path):
    from inercal.laboratory.store import make_store

    make_store(str(bench.store))
    status, session = bench.ask("/api/v1/sessions", {"title": "ferraris by hand"})
    assert status == 201
    number = session["session"]
    example = EXAMPLES["ferraris-si"]
    for name in (*example.records, example.map, example.study):
        status, found = put(bench, number, name, (FOLDER / name).read_bytes())
        assert (status, found["bytes"]) == (201, (FOLDER / name).stat().st_size)
    status, job = bench.ask(f"/api/v1/sessions/{number}/jobs", b"")
    assert status == 202
    ended = bench.ended(job["job"])
    assert (ended["state"], ended["code"]) == ("done", 0), ended["said"]
    status, result = bench.ask(f"/api/v1/jobs/{job['job']}/files/result.json")
    assert result["status"]["code"] == "ok"
    assert result["provenance"]["arguments"] == ended["command"].split()[1:]
    status, kept = bench.ask(f"/api/v1/jobs/{job['job']}/keep", {"instrument": "Portabiles, NilsPod, 2"})
    assert bench.ended(kept["job"])["code"] == 0, bench.ended(kept["job"])["said"]
    assert bench.ask("/api/v1/lab", LAB.encode(), "PUT", {"Content-Type": "text/plain"})[0] == 204
    status, asked = bench.ask(f"/api/v1/jobs/{job['job']}/certificate", {"number": "T-1"})
    written = bench.ended(asked["job"])
    assert written["code"] == 0, written["said"]
    status, xml = bench.ask(f"/api/v1/jobs/{asked['job']}/files/certificate.xml")
    assert "digitalCalibrationCertificate" in xml
    assert [each["serial"] for each in bench.ask("/api/v1/instruments")[1]] == ["2"]
    status, of_unit = bench.ask("/api/v1/instruments/2")
    assert [each["status"] for each in of_unit["results"]] == ["ok"]
    assert [each["number"] for each in of_unit["certificates"]] == ["T-1"]
    assert bench.ask("/api/v1/certificates/T-1") == (200, xml)
    assert "T-1" in bench.ask("/api/v1/certificates/T-1?page=true")[1]
    assert bench.ask("/api/v1/certificates/T-2")[0] == 422
    status, asked = bench.ask(f"/api/v1/jobs/{job['job']}/compare", {"earlier": job["job"]})
    assert bench.ended(asked["job"])["code"] == 0


@pytest.mark.parametrize(
    ("example", "kind"), [("sting", "aoa"), ("selfcal", "selfcal"), ("strapdown", "strapdown")]
)
def test_a_study_that_comes_says_what_kind_the_session_is(bench, example, kind):
    _, session = bench.ask("/api/v1/sessions", {"title": example})
    put(bench, session["session"], "any.toml", (FOLDER / EXAMPLES[example].study).read_bytes())
    assert bench.ask(f"/api/v1/sessions/{session['session']}")[1]["kind"] == kind


def test_a_map_that_came_alone_stays_and_one_that_was_guessed_goes_with_its_study(bench):
    _, session = bench.ask("/api/v1/sessions", {"title": "mapped"})
    number, example = session["session"], EXAMPLES["ferraris-si"]
    own = (FOLDER / example.map).read_bytes()
    put(bench, number, example.records[0], (FOLDER / example.records[0]).read_bytes())
    put(bench, number, example.map, own)
    for expected in (True, False):
        assert bench.ask(f"/api/v1/sessions/{number}/study", {"kind": "imu"})[0] == 201
        kept = bench.ask(f"/api/v1/sessions/{number}/files/study-map.toml")[1]
        assert (kept.encode() == own) is expected


def test_a_study_with_a_fault_is_refused_in_one_sentence(bench):
    _, session = bench.ask("/api/v1/sessions", {"title": "wrong"})
    put(bench, session["session"], "log.csv", b"t [s],acc_x [m/s^2]\n0,1\n")
    put(bench, session["session"], "study.toml", b'[site]\nlatitude = "45 m"\n')
    _, job = bench.ask(f"/api/v1/sessions/{session['session']}/jobs", b"")
    ended = bench.ended(job["job"])
    assert (ended["state"], ended["code"]) == ("refused", 2)
    assert ended["said"].count("\n") == 1
    assert "site.latitude" in ended["said"]


@pytest.mark.parametrize(
    "path",
    [
        "/api/v1/sessions/0001/files/..%2F..%2Flab.toml",
        "/api/v1/sessions/0001/files/%2Fetc%2Fpasswd",
        "/api/v1/sessions/..%2Fjobs",
        "/api/v1/jobs/00001/files/..%2F00001%2Fjob.json",
        "/api/v1/jobs/..%2Fsessions/files/x",
        "/static/..%2F..%2F__init__.py",
        "/static/%2e%2e/serve.py",
    ],
)
def test_no_path_leads_out_of_the_folders(bench, path):
    status, found = bench.ask(path)
    assert status in (404, 405, 422), found


def test_what_is_not_there_is_refused_in_a_sentence(bench):
    for path in ("/api/v1/sessions/9999", "/api/v1/jobs/99999", "/api/v1/jobs/99999/files/result.json"):
        status, found = bench.ask(path)
        assert status == 422
        assert list(found) == ["error"]
    status, found = bench.ask("/api/v1/sessions", {"example": "absent"})
    assert status == 422


def test_nothing_is_answered_without_the_key(bench):
    for path in ("/", "/api/v1/sessions", "/static/bench.js", "/_nicegui/client/x", "/api/v1/openapi.json"):
        assert bench.ask(path, key=False)[0] == 401
    assert bench.ask("/api/v1/sessions", headers={"Host": "evil.example"})[0] == 421
    assert bench.ask("/api/v1/sessions", headers={"Origin": "http://evil.example"})[0] == 403


@for_each(
    ("host", "origin", "key", "status"),
    [
        (None, None, True, 101),
        (None, "http://evil.example", True, 403),
        ("evil.example", "http://evil.example", True, 403),
        (None, None, False, 403),
    ],
)
def test_a_websocket_opens_to_this_machine_its_own_pages_and_the_key_alone(bench, host, origin, key, status):
    here = bench.base.split("//")[1]
    connection = http.client.HTTPConnection(here, timeout=60)
    connection.putrequest("GET", "/_nicegui_ws/socket.io/?EIO=4&transport=websocket", skip_host=True)
    headers = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    headers |= {"Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==", "Host": host or here}
    headers |= {"Authorization": f"Bearer {bench.key if key else 'none'}", "Origin": origin or bench.base}
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    assert connection.getresponse().status == status
    connection.close()


def test_programs_find_a_description(bench):
    status, found = bench.ask("/api/v1/openapi.json")
    assert status == 200
    assert found["paths"]["/sessions/{number}/jobs"]["post"]["description"]
    assert "http" not in json.dumps(found.get("servers", []))


@pytest.mark.slow
def test_a_folder_that_0_2_0_spoiled_is_served(tmp_path):
    """A job and a session with texts that are none, as 0.2.0 took in: pages and lists are there, and jobs run."""
    for folder, name, about in (
        ("sessions/0001", "session.json", {"title": "odd \ud800\0", "kind": "imu", "made": "2026-11-26"}),
        ("jobs/00001", "job.json", {"arguments": ["keep", "x", "--instrument", "\0"], "state": "waiting"}),
        ("jobs/00002", "job.json", {"arguments": ["calibrate", "imu", "\ud800"], "state": "done"}),
    ):
        (tmp_path / "work" / folder).mkdir(parents=True)
        if name == "job.json":
            about |= {"session": "0001", "where": str(tmp_path / "work"), "made": "2026-11-26", "code": None}
        (tmp_path / "work" / folder / name).write_text(json.dumps(about))
    with served(tmp_path / "work") as bench:
        for path in ("/", "/sessions/0001/recording", "/sessions/0001/run", "/validation"):
            assert bench.ask(path)[0] == 200
        assert [each["title"] for each in bench.ask("/api/v1/sessions")[1]] == ["odd \\ud800\\x00"]
        assert [each["state"] for each in bench.ask("/api/v1/jobs")[1]] == ["done", "refused"]
        assert bench.ask("/api/v1/jobs/00001/again", b"")[0] == 422
        assert bench.ask("/api/v1/sessions", {"title": "\0"})[0] == 422
        session = bench.ask("/api/v1/sessions", {"example": "ferraris-si"})[1]["session"]
        job = bench.ask(f"/api/v1/sessions/{session}/jobs", b"")[1]
        assert bench.ended(job["job"])["state"] == "done"
