"""Stores of both kinds: a folder, and a PostgreSQL server that the tests start."""

import getpass
import os
import shutil
import socket
import subprocess
from pathlib import Path

import pytest

from inercal.laboratory.store import make_store


def programs():
    """The folder of initdb and pg_ctl: of PATH, or of the newest Debian package; None where there is none."""
    found = shutil.which("initdb")
    if found:
        return Path(found).parent
    newest = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: int(path.parts[-3]))
    return newest[-1].parent if newest else None


def run(*command):
    """A program of PostgreSQL, which root may not run."""
    as_postgres = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
    words = [*as_postgres, *map(str, command)]
    done = subprocess.run(words, capture_output=True, text=True, cwd="/", check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    """URL of a PostgreSQL server of the tests' own, without a database's name."""
    where = programs()
    if where is None:
        pytest.skip("no PostgreSQL server is installed (Debian: postgresql)")
    folder = tmp_path_factory.mktemp("postgresql")
    user = "postgres" if os.geteuid() == 0 else getpass.getuser()
    if os.geteuid() == 0:
        shutil.chown(folder, "postgres")
        for above in folder.parents:
            if above != Path("/") and above.stat().st_uid == os.geteuid() and above != Path("/tmp"):
                above.chmod(above.stat().st_mode | 0o011)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    data = folder / "data"
    run(where / "initdb", "-D", data, "-U", user, "-A", "trust", "-E", "UTF8", "--no-sync")
    options = f"-F -p {port} -c listen_addresses=127.0.0.1 -k {folder}"
    run(where / "pg_ctl", "-D", data, "-o", options, "-l", folder / "log", "-w", "start")
    yield f"postgresql://{user}@127.0.0.1:{port}"
    run(where / "pg_ctl", "-D", data, "-m", "immediate", "stop")


@pytest.fixture(params=["sqlite", "postgresql"])
def place(request, tmp_path):
    """What --store and --objects say of a new store of that kind."""
    if request.param == "sqlite":
        return str(tmp_path / "store"), None
    import psycopg

    url = request.getfixturevalue("server")
    name = f"t{abs(hash(tmp_path)):x}"
    with psycopg.connect(f"{url}/postgres", autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    return f"{url}/{name}", str(tmp_path / "objects")


@pytest.fixture
def store(place):
    """An empty store."""
    made = make_store(*place)
    yield made
    made.engine.dispose()
