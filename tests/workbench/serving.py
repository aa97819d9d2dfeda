"""A workbench in a process of its own, and requests to it."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import contextmanager

LAB = """persons = [{ name = "A. Berg", role = "head of laboratory", signs = true }]
[laboratory]
name = "Test laboratory"
street = "Street 1"
post_code = "10115"
city = "Berlin"
country = "DE"
[customer]
name = "Flight test"
city = "Berlin"
[item]
model = "NilsPod"
serial = "2"
[conditions]
temperature = "23 degC"
[statements]
traceability = "to the SI by the gravity of the site"
[order]
begin = "2026-01-30"
end = "2026-01-31"
"""
"""What a laboratory states."""


class Served:
    """A workbench that runs: its address and key, its process, the folder it works in."""

    def __init__(self, folder, *options, env=None):
        self.folder = folder
        self.store = folder.parent / f"{folder.name}-store"
        command = [
            sys.executable,
            "-m",
            "inercal",
            "workbench",
            str(folder),
            "--no-browser",
            "--store",
            str(self.store),
        ]
        self.process = subprocess.Popen(
            [*command, *options], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env={**os.environ, **(env or {})},
        )  # fmt: skip
        self.line = self.process.stdout.readline()
        found = re.search(r"(http://[^/]+)/(?:\?key=(\S+))?", self.line)
        assert found, self.line + self.process.stdout.read()
        self.base, self.key = found[1], found[2] or ""
        self.address = f"{self.base}/?key={self.key}"

    def ask(self, path, body=None, method=None, headers=None, key=True):
        """Status, JSON or text of an answer."""
        given = {"Authorization": f"Bearer {self.key}"} if key else {}
        if isinstance(body, dict):
            body, given["Content-Type"] = json.dumps(body).encode(), "application/json"
        request = urllib.request.Request(
            self.base + path,
            body,
            {**given, **(headers or {})},
            method=method or ("GET" if body is None else "POST"),
        )
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                status, text = answer.status, answer.read()
        except urllib.error.HTTPError as error:
            status, text = error.code, error.read()
        try:
            return status, json.loads(text)
        except ValueError:
            return status, text.decode(errors="replace")

    def ended(self, job, timeout=120.0):
        """A job once it has ended."""
        until = time.monotonic() + timeout
        while time.monotonic() < until:
            status, found = self.ask(f"/api/v1/jobs/{job}")
            assert status == 200, found
            if found["state"] not in ("waiting", "running"):
                return found
            time.sleep(0.1)
        raise AssertionError(f"job {job} goes on after {timeout:.0f} s: {found}")

    def kill(self):
        """End it as kill -9 does."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()


@contextmanager
def served(folder, *options, env=None):
    """A workbench for as long as the block lasts."""
    found = Served(folder, *options, env=env)
    try:
        yield found
    finally:
        found.process.terminate()
        try:
            found.process.wait(10.0)
        except subprocess.TimeoutExpired:
            found.kill()
        found.process.stdout.close()
