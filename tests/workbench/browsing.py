"""The system's Chromium on the pages of a workbench: what it asks for, says and shows."""

import os
import shutil
from contextlib import contextmanager

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

needs_browser = pytest.mark.skipif(
    CHROMIUM is None, reason="needs Chromium or Chrome (apt-get install chromium)"
)


class Watched:
    """A page, the requests that would leave the machine, errors in its console, and answers that refuse."""

    def __init__(self, page, base):
        self.page, self.base = page, base
        self.outside, self.errors = [], []
        page.on("request", self._asked)
        page.on("websocket", lambda socket: self._away(socket.url))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda said: said.type == "error" and self.errors.append(said.text))

    def _asked(self, request):
        self._away(request.url)

    def _away(self, url):
        host = self.base.split("//")[1]
        if url.split(":")[0] not in ("data", "blob", "about") and f"//{host}/" not in url:
            self.outside.append(url)

    def sound(self):
        """Nothing left the machine, and the console is silent."""
        assert self.outside == []
        assert self.errors == []


@contextmanager
def browser():
    """A browser for as long as the block lasts."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        options = ["--disable-dev-shm-usage", *(["--no-sandbox"] if os.geteuid() == 0 else [])]
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        try:
            yield found
        finally:
            found.close()


def opened(window, bench):
    """A page that has opened the address of a workbench, in a window that keeps what pages load."""
    page = window.new_page()
    page.set_default_timeout(60_000)
    watched = Watched(page, bench.base)
    page.goto(bench.address)
    page.wait_for_selector("h1")
    return page, watched


def serious(page):
    """What axe-core finds that keeps people out."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(page, options={"iframes": False})
    return [
        (each["id"], [node["html"][:200] for node in each["nodes"]][:3])
        for each in found.response["violations"]
        if each["impact"] in ("serious", "critical")
    ]
