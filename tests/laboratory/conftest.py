"""Stores of both kinds: a folder, and a PostgreSQL server that the tests start."""

import postgresql
import pytest

from inercal.laboratory.store import make_store


@pytest.fixture(scope="session")
def server():
    """URL of a PostgreSQL server of the tests' own, without a database's name."""
    if postgresql.programs() is None:
        pytest.skip("no PostgreSQL server is installed (Debian: postgresql)")
    with postgresql.started() as url:
        yield url


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
