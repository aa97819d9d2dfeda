"""A real S3 server in a process of its own: recordings of a fleet come from it, objects of a store go to it."""

import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest
from independent.fleet import made

import inercal as ic
from inercal.laboratory.catalog import results
from inercal.laboratory.check import check
from inercal.laboratory.store import make_store, open_store

pytest.importorskip("moto")
pytest.importorskip("s3fs")


@pytest.fixture(scope="module")
def server():
    """Address of the server."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    address, until = f"http://127.0.0.1:{port}", time.monotonic() + 60.0
    try:
        while True:
            try:
                urllib.request.urlopen(address, timeout=1.0).close()
                break
            except OSError:
                assert process.poll() is None
                assert time.monotonic() < until
                time.sleep(0.05)
        yield address
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_a_fleet_from_a_bucket_kept_in_a_bucket(server, tmp_path, monkeypatch):
    import s3fs

    for name, value in (
        ("AWS_ENDPOINT_URL", server),
        ("AWS_ACCESS_KEY_ID", "someone"),
        ("AWS_SECRET_ACCESS_KEY", "secret"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
    ):
        monkeypatch.setenv(name, value)
    made(tmp_path, 5)
    bucket = s3fs.S3FileSystem(skip_instance_cache=True)
    bucket.mkdir("recordings")
    bucket.mkdir("objects")
    names = [f"unit{k:03d}.csv" for k in range(5)]
    for name in names:
        bucket.put(str(tmp_path / name), f"recordings/{name}")
    at_s3 = tmp_path / "s3.csv"
    at_s3.write_text(
        "serial,files\n" + "".join(f"SN {k:03d},s3://recordings/{n}\n" for k, n in enumerate(names))
    )
    local = tmp_path / "fleet.csv"
    local.write_text("serial,files\n" + "".join(f"SN {k:03d},{n}\n" for k, n in enumerate(names)))

    store = make_store(str(tmp_path / "store"), "s3://objects/lab").where
    found = ic.batch(at_s3, tmp_path / "imu.toml", out=tmp_path / "out", store=store).evidence.rows
    expected = ic.batch(local, tmp_path / "imu.toml", out=tmp_path / "one").evidence.rows
    assert [row.coefficients for row in found] == [row.coefficients for row in expected]
    opened = open_store(store)
    assert len(results(opened)) == 5
    assert not check(opened).faults
    kept = [Path(path).name for path in bucket.find("objects/lab")]
    assert len(kept) >= 5 * 2 + 1  # recordings, results, the study
    shutil.rmtree(tmp_path / "out")
