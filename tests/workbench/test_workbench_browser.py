"""The workbench in a real browser: the main job, refusals, reload, kill -9, two tabs, keyboard, widths, access."""

import time

import numpy as np
import pytest
from browsing import browser, needs_browser, opened, serious
from serving import LAB, Served, served

from inercal.examples import EXAMPLES, FOLDER
from inercal.laboratory.store import make_store

pytestmark = [needs_browser, pytest.mark.slow]


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    with served(tmp_path_factory.mktemp("browser") / "work") as found:
        make_store(str(found.store))
        yield found


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """The Xsens recording as a log in text whose rates say deg/s but are told by a header without a unit."""
    from scipy.io import loadmat

    acc, gyro = (
        next(x for key, x in loadmat(FOLDER / f"xsens_{name}.mat").items() if not key.startswith("_"))
        for name in ("acc", "gyro")
    )
    path = tmp_path_factory.mktemp("log") / "log.csv"
    rows = np.column_stack(
        [acc[:, 0], (acc[:, 1:] - 33000.0) / 415.0, (gyro[:, 1:] - 32500.0) / 4770.0 * 57.29577951]
    )
    np.savetxt(path, rows, "%.9g", ",", header="time,ax,ay,az,gx,gy,gz", comments="")
    return path


class Clicks:
    """A page on which clicks are counted."""

    def __init__(self, page):
        self.page, self.count = page, 0

    def __call__(self, selector):
        self.count += 1
        self.page.click(selector)


def test_from_a_dropped_log_to_a_certificate(chromium, bench, log, tmp_path):
    page, watched = opened(chromium, bench)
    click = Clicks(page)
    page.set_input_files('input[type="file"]', log)
    page.wait_for_url("**/recording?new=1")
    page.wait_for_selector("[data-findings]")
    for axis in "xyz":  # the rates are in deg/s: the guess was rad/s, and asks to be checked
        field = page.locator(f'input[aria-label="unit of gyro_{axis}"]')
        assert field.input_value() in ("rad/s", "deg/s")
        if field.input_value() != "deg/s":
            field.fill("deg/s")
            with page.expect_navigation():
                field.press("Tab")
            page.wait_for_selector("[data-findings]")
    click("text=Study")
    page.wait_for_selector("[data-verdict]")
    field = page.get_by_label("latitude", exact=True).first
    field.fill("45.4 deg")
    field.press("Tab")
    click("text=/more keys of .imu./")
    page.get_by_role("checkbox", name="g_sensitivity").click()
    click("text=/.item. the instrument/")
    for name, value in (("maker", "Xsens"), ("model", "MTi"), ("serial", "7")):
        field = page.get_by_label(name, exact=True)
        field.fill(value)
        field.press("Tab")
    page.wait_for_selector("text=The study can be used.")
    click('button:has-text("Run")')
    page.wait_for_url("**/result", timeout=120_000)
    page.wait_for_selector("[data-verdict]")
    assert page.inner_text("[data-verdict]").startswith("ok")
    assert "S_x" in page.inner_text("table")
    page.wait_for_load_state("networkidle")
    page.locator('button:has-text("Keep")').scroll_into_view_if_needed()
    page.wait_for_timeout(1000)  # the report in its frame moves what is below it
    click('button:has-text("Keep")')
    page.wait_for_selector("text=It is kept.")
    page.get_by_label("lab.toml", exact=True).fill(LAB)
    click('button:has-text("Save lab.toml")')
    page.wait_for_selector("text=The statements of the laboratory are kept.")
    page.get_by_label("Number of the certificate").fill("T-7")
    click('button:has-text("Write the certificate")')
    with page.expect_download() as download:
        click("text=Certificate, XML")
    assert "T-7" in download.value.path().read_text()
    watched.sound()
    page.goto(f"{bench.base}/instruments")
    page.wait_for_selector("text=MTi")
    assert click.count == 8
    watched.sound()


@pytest.mark.parametrize(
    "name",
    [
        "sting",
        *(
            pytest.param(name, marks=pytest.mark.campaign)
            for name in ("ferraris-si", "table", "strapdown", "selfcal")
        ),
    ],
)
def test_an_example_of_another_system_comes_to_its_report(chromium, bench, name):
    page, watched = opened(chromium, bench)
    page.click(f'button[aria-label="open example {name}"]')
    page.wait_for_selector("[data-findings]")
    page.click("text=Study")
    page.wait_for_selector("text=The study can be used.")
    page.click('button:has-text("Run")')
    page.wait_for_url("**/result", timeout=180_000)
    assert page.inner_text("[data-verdict]").startswith(("ok", "suspect"))
    frame = page.frame_locator("iframe.report")
    frame.locator("h2").first.wait_for()
    watched.sound()


def test_a_wrong_file_is_refused_in_a_sentence(chromium, bench, tmp_path):
    page, watched = opened(chromium, bench)
    hostile = tmp_path / "<img src=x onerror=alert(1)>.csv"
    hostile.write_text("not,a\nlog,at all\n")
    page.set_input_files('input[type="file"]', hostile)
    page.wait_for_url("**/recording?new=1")
    page.wait_for_selector('[role="alert"]')
    assert "expected" in page.inner_text('main [role="alert"]')
    assert page.locator("img[onerror]").count() == 0
    watched.sound()


def test_a_run_goes_on_over_reloads_and_in_two_tabs(chromium, bench):
    _, session = bench.ask("/api/v1/sessions", {"example": "xsens"})
    number = session["session"]
    page, watched = opened(chromium, bench)
    page.goto(f"{bench.base}/sessions/{number}/study")
    page.click('button:has-text("Run")')
    page.wait_for_url("**/run")
    page.reload()
    other = page.context.new_page()
    other.goto(f"{bench.base}/sessions/{number}/run")
    for each in (page, other):
        each.wait_for_url("**/result", timeout=120_000)
        each.wait_for_selector('[data-verdict]:has-text("ok")')
    jobs = [job for job in bench.ask("/api/v1/jobs")[1] if job["session"] == number]
    assert [job["state"] for job in jobs] == ["done"]
    watched.sound()


def test_a_run_is_cancelled(chromium, bench):
    _, session = bench.ask("/api/v1/sessions", {"example": "selfcal"})
    page, watched = opened(chromium, bench)
    page.goto(f"{bench.base}/sessions/{session['session']}/study")
    page.click('button:has-text("Run")')
    page.wait_for_url("**/run")
    page.click('button:has-text("Cancel")')
    page.wait_for_selector('[data-state]:has-text("was cancelled")')
    watched.sound()


def test_after_kill_9_a_run_is_found_interrupted_and_is_started_again(chromium, tmp_path):
    killed = Served(tmp_path / "work")
    _, session = killed.ask("/api/v1/sessions", {"example": "xsens"})
    _, job = killed.ask(f"/api/v1/sessions/{session['session']}/jobs", b"")
    until = time.monotonic() + 30.0
    while killed.ask(f"/api/v1/jobs/{job['job']}")[1]["state"] != "running" and time.monotonic() < until:
        time.sleep(0.05)
    killed.kill()
    killed.process.stdout.close()
    with served(tmp_path / "work") as bench:
        page, watched = opened(chromium, bench)
        page.goto(f"{bench.base}/sessions/{session['session']}/run")
        page.wait_for_selector('[data-state]:has-text("was interrupted")')
        page.click('button:has-text("Run again")')
        page.wait_for_url("**/result", timeout=120_000)
        watched.sound()


def test_the_way_to_a_run_needs_no_mouse(chromium, bench):
    page, watched = opened(chromium, bench)
    target = page.locator('button[aria-label="open example ferraris-si"]')
    for _ in range(60):
        page.keyboard.press("Tab")
        if target.evaluate("each => each === document.activeElement"):
            break
    else:
        raise AssertionError("the button is not reached by Tab")
    page.keyboard.press("Enter")
    page.wait_for_selector("[data-findings]")
    page.locator('nav[aria-label="steps"] a:has-text("Study")').focus()
    page.keyboard.press("Enter")
    page.wait_for_selector("text=The study can be used.")
    page.locator('button:has-text("Run")').focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/run")
    watched.sound()


PAGES = ["/", "/instruments", "/validation", "recording", "study", "run", "result"]


@pytest.mark.parametrize(
    ("width", "height", "scheme"),
    [(1366, 768, "light"), (390, 844, "dark"), pytest.param(1366, 768, "dark", marks=pytest.mark.campaign)],
)
def test_every_page_is_within_its_width_and_open_to_all(chromium, bench, width, height, scheme):
    _, session = bench.ask("/api/v1/sessions", {"example": "ferraris-si"})
    _, job = bench.ask(f"/api/v1/sessions/{session['session']}/jobs", b"")
    bench.ended(job["job"])
    page, watched = opened(chromium, bench, width, height, color_scheme=scheme)
    for path in PAGES:
        page.goto(bench.base + (path if path.startswith("/") else f"/sessions/{session['session']}/{path}"))
        page.wait_for_selector("h1")
        page.wait_for_load_state("networkidle")
        if path == "recording":
            page.wait_for_selector("[data-findings]")
        wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
        assert wide <= 0, f"{path} is {wide} pixels too wide"
        assert serious(page) == [], path
    watched.sound()


def test_examples_that_the_home_page_shows_are_those_of_the_commands(chromium, bench):
    page, _ = opened(chromium, bench)
    shown = page.locator('button[aria-label^="open example"]').count()
    assert shown == sum(example.verb != "apply" and len(example.records) < 3 and example.study is not None
                        for example in EXAMPLES.values())  # fmt: skip
