"""An instrument by wire in the workbench: begun, followed and stopped by programs, and on the page in a browser."""

import asyncio
import csv
import gzip
import json
import socket
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from browsing import browser, needs_browser, opened, serious
from serving import served

from inercal.bench.workbench.bench import open_bench
from inercal.bench.workbench.live_status import POINTS, drawable, row_figure, status, words_of
from inercal.bench.workbench.measurements import MOST, Wish, interval_of, next_name
from inercal.bench.workbench.sessions import put
from inercal.examples import FOLDER
from inercal.foundation.errors import InputError

pytest.importorskip("nicegui")

import httpx

from inercal.bench.workbench.rest import rest_of


@contextmanager
def sending(lines, rate=200.0):
    """The port of this machine to which lines are sent one by one, the first with each, again and again."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    stop = threading.Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            for line in lines:
                out.sendto(line.encode() + b"\n", ("127.0.0.1", port))
                if stop.wait(1.0 / rate):
                    return

    thread = threading.Thread(target=send)
    yield port, thread.start
    stop.set()
    if thread.ident is not None:
        thread.join()


def log():
    """The lines of the recording of the example ``sting``."""
    with gzip.open(FOLDER / "sting.csv.gz", "rt") as file:
        return file.read().splitlines()


def until(found, patience=300.0):
    """What is found, once it is true."""
    end = time.monotonic() + patience
    while not (told := found()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return told


@pytest.fixture
def bench(tmp_path):
    found = open_bench(tmp_path / "work", str(tmp_path / "store"))
    yield found
    found.close()


@pytest.mark.slow
def test_a_program_measures_by_wire(bench):
    """Rows, band, rest, counts and alarms over HTTP; the recording is there, and begins a session."""
    session = bench.sessions.begin_with("sting")
    transport = httpx.ASGITransport(rest_of(bench))

    def ask(method, path, **given):
        async def asked():
            async with httpx.AsyncClient(transport=transport, base_url="http://here") as client:
                return await client.request(method, f"/sessions/{session.id}/live{path}", **given)

        return asyncio.run(asked())

    assert ask("GET", "").json()["error"].endswith("is not measured")
    name = session.recordings[0].name
    wish = {
        "source": f"replay:{name}?speed=0",
        "record": "raw.csv",
        "to": ["text:angles.csv"],
        "every": "0.1 s",
    }
    begun = ask("POST", "", json=wish)
    assert begun.status_code == 201, begun.text
    assert begun.json()["command"] == (
        f"inercal live 'replay:{name}?speed=0' --study study.toml --record live/raw.csv --to text:live/angles.csv "
        "--every '0.1 s'"
    )
    found = until(lambda: (told := ask("GET", "").json())["state"] == "ended" and told)
    assert found["failure"] == ""
    assert found["latest"]["theta"]["u"] > 0.0
    assert found["latest"]["theta"]["unit"] == "deg"
    assert set(found["channels"]) >= {"t", "a1", "gyro"}
    assert found["counts"]["rows"] == len(log()) - 1
    assert found["counts"]["lost"] == 0
    rows = ask("GET", "/rows").json()
    assert rows["columns"][1] == "theta [deg]"
    assert len(rows["rows"][-1]) == len(rows["columns"])
    assert ask("GET", f"/rows?after={rows['next']}").json()["rows"] == []
    assert ask("GET", "/files").json() == ["angles.csv", "raw.csv"]
    raw = ask("GET", "/files/raw.csv").text.splitlines()
    assert raw[0].split(",")[0] == "t [s]"
    assert len(raw) == len(log())
    angles = list(csv.DictReader(ask("GET", "/files/angles.csv").text.splitlines()))
    assert float(angles[-1]["theta [deg]"]) == pytest.approx(found["latest"]["theta"]["value"])
    assert ask("GET", "/files/..%2Fstudy.toml").status_code == 422
    json.dumps(found, allow_nan=False)
    bench.drop(session)
    assert bench.measurements.of(bench.sessions.begin_with("sting")) is None  # of the same number


@pytest.mark.slow
def test_rest_is_told_as_it_was_made(bench):
    """Noise for 8 s, turned by hand for 4 s, noise for 3 s: at rest for those, as the monitor says of the same rows."""
    session, rng = bench.by_wire("imu"), np.random.default_rng(20261125)
    put(session, "study.toml", '[site]\ngravity = "9.81 m/s^2"\n[imu]\n')
    t = 0.02 * np.arange(750)
    moved = np.where((t >= 8.0) & (t < 12.0), np.sin(3.0 * t), 0.0)
    gyro = 1e-3 * rng.standard_normal((3, 750)) + moved
    np.savetxt(
        session.folder / "log.csv", np.column_stack([t, *gyro]), "%.6f", ",", comments="",
        header="t [s],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]",
    )  # fmt: skip
    live = bench.measurements.begin(session, Wish("replay:log.csv?speed=0"))
    assert live.measurement.join(300.0)
    assert live.measurement.failure == ""
    found = status(live)
    assert found["rest"] is True
    assert found["still_s"] == pytest.approx(3.0, abs=1.2)  # the window of the monitor is a second
    assert found["rest_words"] == f"At rest for {found['still_s']:.0f} s."
    assert found["latest"]["rest"]["value"] == 1.0


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        (Wish("udp://127.0.0.1"), "host and port"),
        (Wish("replay:/etc/passwd"), "is no file of this session"),
        (Wish("replay:../0001/session.json"), "is no file of this session"),
        (Wish("replay:session.json"), "is no file of this session"),
        (Wish("mqtt://127.0.0.1/topic?login=/etc/passwd"), "is no file of this session"),
        (Wish("udp://127.0.0.1:5005", to=("text:/tmp/x.csv",)), "is no plain name"),
        (Wish("udp://127.0.0.1:5005", to=("parquet:..",)), "expected"),
        (Wish("udp://127.0.0.1:5005", to=("text:-",)), "no standard output"),
        (Wish("udp://127.0.0.1:5005", "a.csv", ("text:a.csv",)), "one place for two things"),
        (Wish("udp://127.0.0.1:5005", every=-1.0), "every"),
    ],
)
def test_no_wish_leads_out_of_the_session(bench, wish, words):
    session = bench.sessions.begin_with("sting")
    with pytest.raises(InputError, match=words):
        bench.measurements.begin(session, wish)
    assert bench.measurements.at_work == {}
    assert not (session.folder / "live").exists()


def test_a_session_is_measured_once_and_so_many_at_a_time(bench, monkeypatch):
    monkeypatch.setattr("inercal.bench.live.measurement.RunningMeasurement.start", lambda self: None)
    sessions = [bench.sessions.begin_with("sting") for _ in range(MOST + 1)]
    for session in sessions[:MOST]:
        bench.measurements.begin(session, Wish("udp://127.0.0.1:5005"))
    with pytest.raises(InputError, match="measured already"):
        bench.measurements.begin(sessions[0], Wish("udp://127.0.0.1:5005"))
    with pytest.raises(InputError, match=f"found {MOST} measurements at work"):
        bench.measurements.begin(sessions[MOST], Wish("udp://127.0.0.1:5005"))
    assert len(bench.measurements.at_work) == MOST


def test_a_recording_has_a_name_that_is_free(bench):
    session = bench.by_wire("imu")
    assert next_name(session) == "live-1.csv"
    (session.folder / "live").mkdir()
    (session.folder / "live" / "live-1.csv").write_text("")
    (session.folder / "study-map.toml").write_text(
        '[file]\nsync = "AA 55"\nfields = ["n u2", "x i2"]\n[columns.acc_x]\nfrom = "x"\nunit = "count"\n'
    )
    assert next_name(session).startswith("live-")
    with pytest.raises(InputError, match="found 'lab'"):
        bench.by_wire("lab")
    assert interval_of("") == 0.0
    assert interval_of("20 ms") == pytest.approx(0.02)
    with pytest.raises(InputError, match="interval"):
        interval_of("0 s")


def test_the_picture_has_a_band_of_two_standard_uncertainties():
    columns = ["t [s]", "status", "theta [deg]", "u_theta [deg]"]
    assert list(drawable(columns)) == ["theta [deg]", "status"]
    rows = [[0.01 * k, "ok", 1.0 + k, 0.5] for k in range(3 * POINTS)] + [[99.0, "lost", None, None]]
    low, high, line = row_figure(columns, rows, "theta [deg]")["data"]
    assert len(line["x"]) <= POINTS
    assert (low["y"][0], high["y"][0], line["y"][0]) == (0.0, 2.0, 1.0)
    assert row_figure(columns, [], "")["data"] == []
    assert words_of(1.23456, 0.01) == "1.235 ± 0.020"
    assert words_of(None, None) == "–"
    assert words_of("lost", None) == "lost"


@needs_browser
@pytest.mark.slow
def test_an_angle_is_measured_on_the_page(tmp_path):
    """Datagrams, one of them no row: angle with its band, channels, the alarm; recorded, stopped, worked on."""
    lines = log()
    spoiled = [*lines[:400], "not,a,row", *lines[400:]]
    with served(tmp_path / "work") as bench, browser() as chromium, sending(spoiled) as (port, begin):
        _, session = bench.ask("/api/v1/sessions", {"example": "sting"})
        page, watched = opened(chromium, bench)
        page.goto(f"{bench.base}/live")
        page.wait_for_selector("text=Nothing is measured now.")
        page.goto(f"{bench.base}/sessions/{session['session']}/live")
        page.wait_for_selector("text=Nothing is measured.")
        page.get_by_label("Source", exact=True).fill("udp://127.0.0.1")
        page.click('button:has-text("Start")')
        page.wait_for_selector("text=expected them as in udp://127.0.0.1:5005")
        page.get_by_label("Source", exact=True).fill(f"udp://127.0.0.1:{port}")
        page.click('button:has-text("Start")')
        page.wait_for_selector("text=The measurement waits for rows.", timeout=120_000)
        begin()
        page.wait_for_selector("text=The measurement is running.")
        page.wait_for_function("document.querySelector('[data-latest]').innerText.includes('theta')")
        assert "±" in page.inner_text("[data-latest]")
        assert "gyro" in page.inner_text("[data-channels]")
        page.wait_for_function("document.querySelector('[data-alarms]').innerText.includes('bad_row')")
        page.wait_for_function("(document.querySelector('.js-plotly-plot').data || []).length === 3")
        assert "Sources:" not in page.inner_text("main")
        assert page.inner_text("[data-rest]") == "Rest: not known, for nothing was quiet for 5 s yet."
        again, other = opened(chromium, bench)  # a second look, at what goes on without the first
        again.goto(f"{bench.base}/live")
        again.click(f"text=Session {session['session']}")
        again.wait_for_selector("text=The measurement is running.")
        other.sound()
        again.close()
        for width in (375, 768, 1366):
            page.set_viewport_size({"width": width, "height": 800})
            page.wait_for_function("document.documentElement.scrollWidth <= window.innerWidth")
        assert serious(page) == []
        page.click('button:has-text("Stop")')
        page.wait_for_selector("text=The measurement has ended.")
        assert "rows" in page.inner_text("[data-counts]")
        page.click('button:has-text("Begin a session with it")')
        page.wait_for_url("**/recording?new=1")
        page.wait_for_selector("[data-findings]")
        watched.sound()
