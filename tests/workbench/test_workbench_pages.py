"""Pages by NiceGUI's own user: what they say, and what their buttons do, without a browser."""

import asyncio
import json
import math
import tomllib

import pytest

from inercal.bench.workbench.jobs import JobState
from inercal.examples import EXAMPLES
from inercal.systems.listed import SYSTEMS
from rows import for_each

pytest.importorskip("nicegui")

from nicegui import ui
from simulated import of_user

from inercal.bench.workbench.pages.frame import _PLACES
from inercal.bench.workbench.pages.run import part_of


async def run(bench, session):
    """The calibration of a session, to its end."""
    job = bench.run(session)
    ended = await asyncio.to_thread(bench.queue.wait, job.id, 120.0)
    assert ended.state is JobState.DONE, ended.said
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
async def test_home_opens_every_example_in_one_click(user, bench):
    await user.open("/")
    for name in EXAMPLES:
        await user.should_see(name)
    opens = [
        each.props["aria-label"]
        for each in user.find(kind=ui.button).elements
        if each.props.get("aria-label", "").startswith("open example")
    ]
    assert sorted(opens) == sorted(f"open example {name}" for name in EXAMPLES)


@of_user
async def test_a_page_has_the_title_of_the_way_to_it(user, bench):
    """By which its way is marked as the current one."""
    for target, words in _PLACES:
        await user.open(target)
        assert user.client.title == f"{words} - inercal"


@of_user
async def test_what_is_at_work_and_what_waits_is_seen(user, bench):
    session = bench.sessions.begin_with("ferraris-si")
    running = bench.queue.add(
        session.id, session.folder, ["monitor", "--quiet"]
    )  # goes on until it is cancelled
    waiting = bench.run(session)
    await user.open("/")
    await user.should_see("At work")
    await user.should_see("calibrate imu")
    await user.open(f"/sessions/{session.id}/run")
    await user.should_see("The job waits for 1 job before it")
    await user.open("/")
    for job in (waiting, running):
        await asyncio.to_thread(bench.queue.cancel, job.id)
    await user.should_not_see("At work", retries=30)


@for_each(
    ("words", "part"),
    [
        ("reading, 40 %", 0.4),
        ("start 3 of 12", 0.25),
        ("filtering (error-state)", None),
        ("", None),
        ("0 of 0", 0.0),
    ],
)
def test_progress_in_words_moves_the_bar(words, part):
    assert part_of(words) == part


def chosen(user, label):
    """The field of that label."""
    fields = user.find(kind=ui.element).elements
    return next(each for each in fields if label in (each.props.get("aria-label"), each.props.get("label")))


@of_user
async def test_columns_are_chosen_added_and_taken_out(user, bench):
    session = bench.sessions.begin("log")
    rows = "".join(f"{0.01 * k:.2f},0,{0.1 * k},9.8,0.{k},0,0,21\n" for k in range(40))
    (session.folder / "log.csv").write_text("time,ax,ay,az,gx,gy,gz,warmth\n" + rows)
    await user.open(f"/sessions/{session.id}/recording?new=1")
    await user.should_see("Columns to channels", retries=60)
    column_map = session.folder / "study-map.toml"

    def columns():
        return tomllib.loads(column_map.read_text())["columns"]

    async def until(reached):
        for _ in range(60):
            if reached():
                return
            await asyncio.sleep(0.05)
        assert reached()

    assert columns()["acc_x"]["from"] == "ax"
    chosen(user, "column of acc_x").set_value('"ay"')
    chosen(user, "sign of acc_y").set_value(-1)
    await until(lambda: columns()["acc_x"]["from"] == "ay" and columns()["acc_y"].get("sign") == -1)
    look = bench.look(bench.sessions.get(session.id))
    assert look[0].record["acc_x"].values[10] == pytest.approx(1.0)
    assert look[0].record["acc_y"].values[10] == pytest.approx(-1.0)
    chosen(user, "column of gyro_z").set_value("")
    await until(lambda: "gyro_z" not in columns())
    chosen(user, "One more channel").set_value("temperature")
    chosen(user, "From").set_value('"warmth"')
    chosen(user, "Unit").set_value("degC")
    user.find("Add").click()
    await until(lambda: columns().get("temperature") == {"from": "warmth", "unit": "degC"})
    assert bench.look(bench.sessions.get(session.id))[0].record["temperature"].values[0] == 21.0


@of_user
async def test_a_guess_is_answered_by_a_choice(user, bench):
    session = bench.sessions.begin("still")
    noise = [0.001 * math.sin(k * k + 0.3) for k in range(120)]
    rows = "".join(
        f"{0.01 * k:.2f},{noise[k]:.9f},{noise[k + 40]:.9f},{noise[k + 80]:.9f}\n" for k in range(40)
    )
    (session.folder / "log.csv").write_text("time,gx,gy,gz\n" + rows)
    await user.open(f"/sessions/{session.id}/recording?new=1")
    await user.should_see("Is the gyro in", retries=60)
    user.find(kind=ui.button, content="mdeg/s").click()
    column_map = session.folder / "study-map.toml"
    for _ in range(60):
        await asyncio.sleep(0.05)
        columns = tomllib.loads(column_map.read_text())["columns"]
        if columns["gyro_z"]["grade"] == "certain":
            break
    assert {(columns[f"gyro_{axis}"]["unit"], columns[f"gyro_{axis}"]["grade"]) for axis in "xyz"} == {
        ("mdeg/s", "certain")
    }


@of_user
async def test_repeat_runs_are_looked_at_one_by_one(user, bench):
    session = bench.sessions.begin_with("five-years")
    await user.open(f"/sessions/{session.id}/recording")
    await user.should_see("20 runs", retries=60)
    assert len(bench.look(session)) == 20


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
    assert SYSTEMS[session.kind].title in bench.sessions.get(session.id).title


@pytest.mark.slow
@of_user
async def test_layouts_of_a_model_are_set_side_by_side(user, bench):
    """There is no plan to be found, and so none to be taken."""
    session = bench.sessions.begin_with("sting")
    bench.change(session, "layouts.short.a1", '{ r = "-0.1 m" }')
    await user.open(f"/sessions/{session.id}/design")
    await user.should_see("values are predicted", retries=100)
    user.find("Compare").click()
    await user.should_see("The comparison (job", retries=20)
    ended = await asyncio.to_thread(bench.queue.wait, bench.last_design(session).id, 120.0)
    assert ended.state is JobState.DONE, ended.said
    await user.should_see("is done", retries=40)
    await user.should_not_see("Take the plan found")
    assert "Layouts side by side" in ended.report.read_text()


@pytest.mark.slow
@of_user
async def test_advice_of_a_result_is_a_button_that_changes_the_study(user, bench):
    session = bench.sessions.begin_with("ferraris-si")
    job = await run(bench, session)
    found = json.loads(job.result.read_text())
    found["findings"][0]["action"] = 'set imu.time_base = "0(50) ppm", or set imu.k2 = true'
    found["status"]["message"] += "; or take `inercal calibrate strapdown`"
    job.result.write_text(json.dumps(found))
    await user.open(f"/sessions/{session.id}/result")
    await user.should_see("ok: 36 coefficients")
    user.find("imucal").click()
    await user.should_see("imucal.json", retries=200)
    (written,) = bench.root.glob("jobs/*/imucal.json")
    assert "K_a" in written.read_text()
    # six positions do not tell it: such a study is refused
    await user.should_not_see(kind=ui.button, content="Set imu.k2 = true")
    user.find(kind=ui.button, content='Set imu.time_base = "0(50) ppm"').click()
    await user.should_see("The study as text", retries=20)
    assert 'time_base = "0(50) ppm"' in session.study.read_text()
    await user.open(f"/sessions/{session.id}/result")
    await user.should_not_see(kind=ui.button, content='Set imu.time_base = "0(50) ppm"')
    user.find("Begin again with inercal calibrate strapdown").click()
    await user.should_see("The study as text", retries=20)
    (newest, *_) = bench.sessions
    assert (newest.kind, newest.recordings[0].name) == ("strapdown", session.recordings[0].name)
    assert newest.map.read_text() == session.map.read_text()
