"""The workbench in a real browser: the main job, refusals, reload, kill -9, two tabs, keyboard, widths, access."""

import base64
import re
import runpy
import time
from pathlib import Path

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


def wide(chromium, **options):
    """A window of a common laptop."""
    return chromium.new_context(viewport={"width": 1366, "height": 768}, **options)


@pytest.fixture(scope="module")
def window(chromium):
    """One window for all tests, so that what pages load is loaded once."""
    found = wide(chromium, permissions=["clipboard-read", "clipboard-write"])
    yield found
    found.close()


@pytest.fixture
def tab(window, bench):
    """A page with who watches it, for one test."""
    page, watched = opened(window, bench)
    yield page, watched
    page.close()


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """The Xsens recording as a log in text whose rates are in mrad/s, which its header does not say."""
    from scipy.io import loadmat

    acc, gyro = (
        next(x for key, x in loadmat(FOLDER / f"xsens_{name}.mat").items() if not key.startswith("_"))
        for name in ("acc", "gyro")
    )
    path = tmp_path_factory.mktemp("log") / "log.csv"
    rows = np.column_stack([acc[:, 0], (acc[:, 1:] - 33000.0) / 415.0, (gyro[:, 1:] - 32500.0) / 4.770])
    np.savetxt(path, rows, "%.9g", ",", header="time,ax,ay,az,gx,gy,gz", comments="")
    return path


class Clicks:
    """A page on which clicks are counted."""

    def __init__(self, page):
        self.page, self.count = page, 0

    def __call__(self, selector):
        self.count += 1
        self.page.click(selector)


def usable(page):
    """Wait until the study can be used; else the words that say why not."""
    from playwright.sync_api import expect

    expect(page.locator("[data-verdict]")).to_have_text("The study can be used.", timeout=60_000)


EXPECTED = {"mpu6050": "ill_conditioned"}
"""Verdict of an example, where it is not ok."""


def test_from_a_dropped_log_to_a_certificate(tab, bench, log, tmp_path):
    page, watched = tab
    click = Clicks(page)
    page.set_input_files('input[type="file"]', log)
    page.wait_for_url("**/recording?new=1")
    page.wait_for_selector("[data-findings]")
    for axis in "xyz":  # the header does not say it, the turns do
        field = page.locator(f'input[aria-label="unit of gyro_{axis}"]')
        assert field.input_value() == "mrad/s"
        for unit in ("deg/s", "mrad/s"):  # another one, and back
            field.fill(unit)
            field.press("Tab")
            page.wait_for_function(
                """([axis, unit]) => document.querySelector('[aria-label="text of study-map.toml"]').value
                   .split(`[columns.gyro_${axis}]`)[1].split('[columns')[0].includes(`"${unit}"`)""",
                arg=[axis, unit],
            )
    page.wait_for_function("""() => document.querySelector('[aria-label="text of study-map.toml"]').value
                              .split('"mrad/s"').length === 4""")  # fmt: skip
    click("text=Study")
    page.wait_for_selector("[data-verdict]")
    field = page.get_by_label("latitude", exact=True).first
    field.fill("45.4 deg")
    field.press("Tab")
    click("text=/more keys of .imu./")
    field = page.get_by_label("g_sensitivity", exact=True).first
    field.fill("true")
    field.press("Tab")
    click("text=/.item. the instrument/")
    for name, value in (("maker", "Xsens"), ("model", "MTi"), ("serial", "7")):
        field = page.get_by_label(name, exact=True)
        field.fill(value)
        field.press("Tab")
    usable(page)
    click('button:has-text("Run")')
    page.wait_for_url("**/result", timeout=120_000)
    page.wait_for_selector("[data-verdict]")
    assert page.inner_text("[data-verdict]").startswith("ok")
    assert "S_x" in page.inner_text("table")
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
    assert click.count == 8
    page.goto(f"{bench.base}/instruments")
    page.click('tr:has-text("MTi") a')
    page.wait_for_selector("h2:has-text('History')")
    assert page.get_by_role("cell", name="T-7", exact=True).count() == 1
    assert serious(page) == []
    watched.sound()


@pytest.mark.campaign
@pytest.mark.parametrize("name", [name for name, each in EXAMPLES.items() if each.study is not None])
def test_an_example_comes_to_its_report(tab, bench, name):
    page, watched = tab
    page.click(f'button[aria-label="open example {name}"]')
    page.wait_for_selector("[data-findings]")
    page.click("text=Study")
    usable(page)
    page.click('button:has-text("Run")')
    page.wait_for_url("**/result", timeout=180_000)
    assert page.inner_text("[data-verdict]").startswith(EXPECTED.get(name, "ok"))
    frame = page.frame_locator("iframe.report")
    frame.locator("h2").first.wait_for()
    dots = page.locator('[aria-label="residuals over time"] .points path')
    if dots.count():  # one of them leads to its samples
        page.wait_for_timeout(500)
        dots.nth(1).scroll_into_view_if_needed()
        box = dots.nth(1).bounding_box()
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.click("[data-chosen] a")
        page.wait_for_selector("[data-findings]")
        assert "begin=" in page.url
    watched.sound()


def dropped(page, files):
    """Drop files (name -> content) on a page, as the hand does."""
    given = [[name, base64.b64encode(content).decode()] for name, content in files.items()]
    transfer = page.evaluate_handle(
        """files => {
            const given = new DataTransfer();
            for (const [name, text] of files)
                given.items.add(new File([Uint8Array.from(atob(text), each => each.charCodeAt(0))], name));
            return given;
        }""",
        given,
    )
    page.dispatch_event("body", "drop", {"dataTransfer": transfer})


@pytest.mark.campaign
def test_files_dropped_together_are_one_recording_and_a_wrong_one_does_not_stop_the_others(tab, bench):
    page, watched = tab
    heard = []
    page.expose_function("heard", lambda words: heard.append(words))
    page.evaluate("""() => {
        const line = document.getElementById('upload-words');
        new MutationObserver(() => heard(line.innerText)).observe(line, { subtree: true, childList: true });
    }""")
    example = EXAMPLES["xsens"]
    dropped(page, {name: (FOLDER / name).read_bytes() for name in (*example.records, example.map)})
    page.wait_for_url("**/recording?new=1")
    page.wait_for_selector("[data-findings]")
    assert heard[0].startswith("1 of 3, xsens_acc.mat: 0 % of all")
    assert any(words.startswith("3 of 3, xsens-map.toml: ") for words in heard)
    number = page.url.split("/")[4]
    assert (
        bench.ask(f"/api/v1/sessions/{number}/files/study-map.toml")[1].encode()
        == (FOLDER / example.map).read_bytes()
    )
    page.locator(".js-plotly-plot .nsewdrag").first.hover(force=True)
    page.wait_for_function(  # one cursor for both sensors
        "['acc_x', 'gyro_z'].every(name => document.querySelector('.hoverlayer').textContent.includes(name))"
    )
    dropped(page, {"broken.toml": b"[[[", "any.toml": (FOLDER / example.study).read_bytes()})
    page.wait_for_selector('#upload-words[role="alert"]:has-text("broken.toml")')
    page.click("text=Go on with the others")
    page.wait_for_url("**/recording?new=1")
    page.wait_for_selector("[data-findings]")
    assert bench.ask(f"/api/v1/sessions/{number}/files/study.toml")[0] == 200
    page.locator('button[aria-label="copy the command"]').first.click()
    page.wait_for_selector("text=Copied.")
    copied = page.evaluate("navigator.clipboard.readText()")
    assert copied.startswith("inercal new imu xsens_acc.mat xsens_gyro.mat")
    watched.errors = [words for words in watched.errors if "422" not in words]  # that of the broken file
    watched.sound()


def test_a_wrong_file_is_refused_in_a_sentence(tab, tmp_path):
    page, watched = tab
    hostile = tmp_path / "<img src=x onerror=alert(1)>.csv"
    hostile.write_text("not,a\nlog,at all\n")
    page.set_input_files('input[type="file"]', hostile)
    page.wait_for_url("**/recording?new=1")
    page.wait_for_selector('[role="alert"]')
    assert "expected" in page.inner_text('main [role="alert"]')
    assert page.locator("img[onerror]").count() == 0
    watched.sound()


SHIFT = """() => new Promise(done => {
    let sum = 0;
    new PerformanceObserver(list => { for (const each of list.getEntries()) sum += each.value; })
        .observe({ type: 'layout-shift', buffered: true });
    setTimeout(() => done(sum), 300);
})"""
"""How much of a page has moved since it was opened, by the browser's own measure."""


def test_a_run_goes_on_over_reloads_and_in_two_tabs(tab, bench):
    _, session = bench.ask("/api/v1/sessions", {"example": "ferraris-si"})
    number = session["session"]
    page, watched = tab
    page.goto(f"{bench.base}/sessions/{number}/study")
    page.click('button:has-text("Run")')
    page.wait_for_url("**/run")
    page.reload()
    other = page.context.new_page()
    other.goto(f"{bench.base}/sessions/{number}/run")
    for each in (page, other):
        each.wait_for_url("**/result", timeout=120_000)
        each.wait_for_selector('[data-verdict]:has-text("ok")')
    page.frame_locator("iframe.report").locator("h2").first.wait_for()
    assert page.evaluate(SHIFT) < 0.05  # a button stays where it is while the report is loading
    jobs = [job for job in bench.ask("/api/v1/jobs")[1] if job["session"] == number]
    assert [job["state"] for job in jobs] == ["done"]
    other.close()
    watched.sound()


def test_dark_is_kept_from_page_to_page(tab, bench):
    page, watched = tab
    page.goto(bench.base)
    page.click('button:has-text("Dark")')
    page.wait_for_function("document.cookie.includes('inercal-dark=1')")
    page.goto(f"{bench.base}/validation")
    page.wait_for_selector("body.body--dark")
    page.click('button:has-text("Light")')
    page.wait_for_function("document.cookie.includes('inercal-dark=0')")
    page.context.clear_cookies(name="inercal-dark")  # other tests go by the system
    watched.sound()


def test_a_run_is_cancelled(tab, bench):
    _, session = bench.ask("/api/v1/sessions", {"example": "selfcal"})
    page, watched = tab
    page.goto(f"{bench.base}/sessions/{session['session']}/study")
    page.click('button:has-text("Run")')
    page.wait_for_url("**/run")
    page.click('button:has-text("Cancel")')
    page.wait_for_selector('[data-state]:has-text("was cancelled")')
    watched.sound()


@pytest.mark.campaign
def test_after_kill_9_a_run_is_found_interrupted_and_is_started_again(window, tmp_path):
    killed = Served(tmp_path / "work")
    _, session = killed.ask("/api/v1/sessions", {"example": "ferraris-si"})
    _, job = killed.ask(f"/api/v1/sessions/{session['session']}/jobs", b"")
    until = time.monotonic() + 30.0
    while killed.ask(f"/api/v1/jobs/{job['job']}")[1]["state"] != "running" and time.monotonic() < until:
        time.sleep(0.05)
    killed.kill()
    killed.process.stdout.close()
    with served(tmp_path / "work") as bench:
        page, watched = opened(window, bench)
        page.goto(f"{bench.base}/sessions/{session['session']}/run")
        page.wait_for_selector('[data-state]:has-text("was interrupted")')
        page.click('button:has-text("Run again")')
        page.wait_for_url("**/result", timeout=120_000)
        page.close()
        watched.sound()


def test_the_way_to_a_run_needs_no_mouse(tab):
    page, watched = tab
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
    usable(page)
    page.locator('button:has-text("Run")').focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/run")
    watched.sound()


def settled(page, figure, limit, patience=3.0):
    """A figure of the page once it is at most ``limit``, or what it still is after ``patience`` [s]: plotly draws a
    picture anew some moments after the width has changed."""
    end = time.monotonic() + patience
    while (found := page.evaluate(figure)) > limit and time.monotonic() < end:
        page.wait_for_timeout(50)
    return found


PAGES = ["/", "/instruments", "/validation", "recording", "study", "design", "run", "result"]
WIDTHS = (375, 768, 1366)
TUTORIAL = {"width": 1100, "height": 760}


@pytest.mark.parametrize(
    ("name", "scheme"),
    [
        ("ferraris-si", "light"),
        pytest.param("ferraris-si", "dark", marks=pytest.mark.campaign),
        pytest.param("sting", "light", marks=pytest.mark.campaign),
        pytest.param("selfcal", "dark", marks=pytest.mark.campaign),
    ],
)
def test_every_page_is_within_its_width_and_open_to_all(chromium, bench, name, scheme):
    _, session = bench.ask("/api/v1/sessions", {"example": name})
    _, job = bench.ask(f"/api/v1/sessions/{session['session']}/jobs", b"")
    bench.ended(job["job"])
    with wide(chromium, color_scheme=scheme) as window:
        page, watched = opened(window, bench)
        within_and_open(page, bench, session["session"])
        watched.sound()


def within_and_open(page, bench, session):
    """Each page is as wide as the window at all widths, and axe finds nothing serious."""
    for path in PAGES:
        page.goto(bench.base + (path if path.startswith("/") else f"/sessions/{session}/{path}"))
        page.wait_for_selector("h1")
        if path == "recording":
            page.wait_for_selector("[data-findings]")
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": 800})
            beyond = settled(page, "document.documentElement.scrollWidth - window.innerWidth", 0)
            assert beyond <= 0, f"{path} is {beyond} pixels too wide for {width}"
        assert serious(page) == [], path


def test_a_plan_is_edited_turned_and_judged(tab, bench):
    """Lines and sliders by keyboard: each is seen at once, and in the study; a picture shows the stops."""
    _, session = bench.ask("/api/v1/sessions", {"example": "selfcal"})
    page, watched = tab
    page.goto(f"{bench.base}/sessions/{session['session']}/design")
    page.wait_for_selector("text=5 stops, 18 values are predicted.")
    page.fill('[aria-label="plan, a line each"]', "z, 180 deg\nx, 90 deg\ny, 45 deg")
    page.wait_for_selector("text=4 stops, 18 values are predicted.")
    _, study = bench.ask(f"/api/v1/sessions/{session['session']}/files/study.toml")
    assert '["y", "45 deg"]' in study
    page.wait_for_function("document.querySelector('img[alt^=Direction]')?.naturalWidth > 100")
    slider = page.locator('[aria-label="noise.encoder"]')
    slider.focus()
    assert slider.input_value() == "50"
    page.keyboard.press("End")
    page.wait_for_selector("text=noise.encoder: 20 arcsec (10 times)")
    page.wait_for_selector("""text=--set 'noise.encoder="20 arcsec"'""")
    watched.sound()


@pytest.mark.campaign
def test_the_tutorial_is_walked_and_its_pictures_are_taken(chromium, tmp_path):
    root = Path(__file__).parents[2] / "docs"
    take = runpy.run_path(str(root / "pictures" / "workbench.py"))["take"]
    (tmp_path / "pictures").mkdir()
    with served(tmp_path / "work") as bench, chromium.new_context(viewport=TUTORIAL) as window:
        make_store(str(bench.store))
        page, watched = opened(window, bench)
        taken = take(page, bench.base, tmp_path / "pictures")
        watched.sound()
    shown = re.findall(r"pictures/(workbench-\w+\.png)", (root / "tutorials" / "workbench.md").read_text())
    assert taken == shown
    for name in taken:
        assert (tmp_path / "pictures" / name).stat().st_size > 10_000
        assert (root / "pictures" / name).is_file()
