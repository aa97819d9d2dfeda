"""Takes the pictures of the tutorial on the workbench, step by step as it says: into this folder, or the one given.

Needs the system's Chromium. The tests walk the same way (`make campaign`), and compare no pixels.
"""

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "workbench"))

from browsing import browser, opened  # noqa: E402
from serving import LAB, served  # noqa: E402

from inercal.laboratory.store import make_store  # noqa: E402


def take(page, base, folder):
    """Walk through the tutorial on a page of a workbench; the pictures go into a folder. Returns their names."""
    taken = []

    def picture(name, at=None):
        page.mouse.move(0, 0)
        page.wait_for_timeout(700)
        if at is not None:
            page.evaluate("words => [...document.querySelectorAll('h2')].find(e => e.innerText === words)"
                          ".scrollIntoView()", at)  # fmt: skip
            page.wait_for_timeout(300)
        path = folder / f"workbench-{name}.png"
        page.screenshot(path=path)
        taken.append(path.name)

    page.goto(base)
    page.wait_for_selector("h1")
    picture("home")
    page.click('button[aria-label="open example xsens"]')
    page.wait_for_selector("[data-findings]")
    page.wait_for_selector(".js-plotly-plot .main-svg")
    picture("recording")
    page.click("text=Study")
    page.wait_for_selector("text=The study can be used.")
    picture("study")
    page.click('button:has-text("Run")')
    page.wait_for_url("**/result", timeout=180_000)
    page.wait_for_selector("[data-verdict]")
    page.wait_for_selector(".js-plotly-plot .main-svg")
    picture("result")
    assert page.inner_text("[data-verdict]").startswith("ok")
    page.click("text=/Set imu.k2 = true/")
    page.wait_for_selector("text=The study can be used.")
    page.click('button:has-text("Run")')
    page.wait_for_url("**/result", timeout=180_000)
    page.wait_for_selector("[data-verdict]")
    page.get_by_label("Instrument: maker").fill("Xsens, MTi, 7")
    page.click('button:has-text("Keep")')
    page.wait_for_selector("text=It is kept.")
    page.get_by_label("lab.toml", exact=True).fill(LAB)
    page.click('button:has-text("Save lab.toml")')
    page.wait_for_selector("text=The statements of the laboratory are kept.")
    page.get_by_label("Number of the certificate").fill("2026-7")
    page.click('button:has-text("Write the certificate")')
    page.wait_for_selector("text=Certificate, page")
    page.goto(base)
    page.click('button[aria-label="open example selfcal"]')
    page.wait_for_selector("[data-findings]")
    page.click("text=Design")
    page.wait_for_selector("text=18 values are predicted")
    page.wait_for_selector("img[alt^=Direction]")
    page.locator('[aria-label="noise.angle_random_walk"]').focus()
    for _ in range(8):
        page.keyboard.press("ArrowLeft")
    picture("design", "The plan")
    return taken


if __name__ == "__main__":
    into = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    with tempfile.TemporaryDirectory() as work, served(Path(work) / "work") as bench, browser() as chromium:
        make_store(str(bench.store))
        page, _ = opened(chromium.new_context(viewport={"width": 1100, "height": 760}), bench)
        take(page, bench.base, into)
