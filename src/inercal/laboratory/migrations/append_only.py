"""Triggers that refuse to change or delete rows, in both databases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from alembic import op
from sqlalchemy import Connection, text

_SAYS = "rows of this table are only added: a correction is a new row"

_SQLITE = """
CREATE TRIGGER {table}_no_{word} BEFORE {what} ON {table}
BEGIN SELECT RAISE(ABORT, '{table}: {says}'); END
"""

_FUNCTION = """
CREATE OR REPLACE FUNCTION append_only() RETURNS trigger LANGUAGE plpgsql AS
$$ BEGIN RAISE EXCEPTION '%: {says}', TG_TABLE_NAME; END $$
"""

_ROWS = """
CREATE TRIGGER {table}_append_only BEFORE UPDATE OR DELETE ON {table}
FOR EACH ROW EXECUTE FUNCTION append_only()
"""

_WHOLE = """
CREATE TRIGGER {table}_no_truncate BEFORE TRUNCATE ON {table}
FOR EACH STATEMENT EXECUTE FUNCTION append_only()
"""


def append_only(*tables: str) -> None:
    """Let rows of the tables be added, and nothing else."""
    postgresql = op.get_context().dialect.name == "postgresql"
    if postgresql:
        op.execute(_FUNCTION.format(says=_SAYS))
    for table in tables:
        if postgresql:
            op.execute(_ROWS.format(table=table))
            op.execute(_WHOLE.format(table=table))
        else:
            for statement in _sqlite(table):
                op.execute(statement)


def _sqlite(table: str) -> Iterator[str]:
    """The statements that make the triggers of a table of SQLite."""
    for what in ("UPDATE", "DELETE"):
        yield _SQLITE.format(table=table, what=what, word=what.lower(), says=_SAYS)


@contextmanager
def suspended(connection: Connection, tables: Sequence[str]) -> Iterator[None]:
    """Let rows of the tables be changed within a transaction; without an error the triggers are back at its end."""
    postgresql = connection.dialect.name == "postgresql"
    for table in tables:
        if postgresql:
            connection.execute(text(f"ALTER TABLE {table} DISABLE TRIGGER USER"))
        else:
            for word in ("update", "delete"):
                connection.execute(text(f"DROP TRIGGER {table}_no_{word}"))
    yield
    for table in tables:
        for statement in [f"ALTER TABLE {table} ENABLE TRIGGER USER"] if postgresql else _sqlite(table):
            connection.execute(text(statement))
