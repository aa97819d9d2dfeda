"""Pages by NiceGUI's own user: what they say, and what their buttons do, without a browser."""

import asyncio
import json

import pytest

from inercal.workbench.bench import KINDS
from inercal.workbench.jobs import State

pytest.importorskip("nicegui")

from nicegui import ui
from simulated import of_user


async def run(bench, session):
    """The calibration of a session, to its end."""
    job = bench.run(session)
    ended = await asyncio.to_thread(bench.queue.wait, job.id, 120.0)
    assert ended.state is State.DONE, ended.said
    return ended


@of_user
async def test_home_lists_what_is_open_all_of_it_when_asked(user, bench):
    for number in range(23):
        bench.sessions.begin(f"test {number}")
    await user.open("/")
    await user.should_see("0023 test 22")
    await user.should_not_see("0001 test 0")
    await user.should_see("Show all 23 sessions")
    await user.open("/?every=1")
    await user.should_see("0001 test 0")


@of_user
async def test_pages_of_a_new_session_say_what_is_missing(user, bench):
    session = bench.sessions.begin("empty", "turntable")
    for page, words in (
        ("recording", "none yet"),
        ("study", "There is no study yet"),
        ("design", "There is no study yet"),
        ("run", "Nothing was run yet"),
        ("result", "There is no result yet"),
    ):
        await user.open(f"/sessions/{session.id}/{page}")
        await user.should_see(words)


@of_user
async def test_a_test_is_planned_from_its_kind_to_its_uncertainties(user, bench):
    session = bench.plan("turntable")
    await user.open(f"/sessions/{session.id}/design")
    await user.should_see("fill in site.latitude", retries=40)
    bench.change(session, "site.latitude", '"48.1 deg"')
    await user.open(f"/sessions/{session.id}/design")
    await user.should_see("1296 positions", retries=40)
    bench.change(session, "positions.grid", "")
    bench.change(session, "positions.plan", '"24-position"')
    await user.open(f"/sessions/{session.id}/design")
    await user.should_see("24 stops, ", retries=40)
    before = {each.text for each in user.find(kind=ui.label).elements}
    (slider,) = [
        each
        for each in user.find(kind=ui.element).elements
        if each.props.get("aria-label") == "instrument.noise"
    ]
    for listener in slider._event_listeners.values():
        if listener.type == "input":
            slider._handle_event({"listener_id": listener.id, "args": "100"})
    await user.should_see("instrument.noise: 0.1 deg/h (10 times)", retries=20)
    after = {each.text for each in user.find(kind=ui.label).elements}
    assert len(after - before) > 5
    assert KINDS[session.kind] in bench.sessions.get(session.id).title


@pytest.mark.slow
@of_user
async def test_advice_of_a_result_is_a_button_that_changes_the_study(user, bench):
    session = bench.sessions.begin_with("ferraris-si")
    job = await run(bench, session)
    found = json.loads(job.result.read_text())
    found["findings"][0]["message"] += ": set imu.k2 = true"
    job.result.write_text(json.dumps(found))
    await user.open(f"/sessions/{session.id}/result")
    await user.should_see("ok: 33 coefficients")
    user.find("imucal").click()
    await user.should_see("imucal.json", retries=200)
    (written,) = bench.root.glob("jobs/*/imucal.json")
    assert "K_a" in written.read_text()
    user.find("Set imu.k2 = true").click()
    await user.should_see("The study as text", retries=20)
    assert "k2 = true" in session.study.read_text()
    await user.open(f"/sessions/{session.id}/result")
    await user.should_not_see("Set imu.k2 = true")
