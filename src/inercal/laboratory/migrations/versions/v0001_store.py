"""The store: instruments, references, files, results with their coefficients, supersessions, events."""

import sqlalchemy as sa
from alembic import op

from inercal.laboratory.migrations.append_only import append_only

revision = "0001"
down_revision = None

STRICT = {"sqlite_strict": True}


def number(name: str) -> sa.Column[float]:
    """A column of numbers of double precision, or NULL."""
    return sa.Column(name, sa.Double().with_variant(sa.REAL(), "sqlite"))


def words(
    name: str, *more: sa.ForeignKey, nullable: bool = False, primary_key: bool = False
) -> sa.Column[str]:
    """A column of texts."""
    return sa.Column(name, sa.Text(), *more, nullable=nullable, primary_key=primary_key)


def upgrade() -> None:
    """Make the tables."""
    op.create_table("setting", words("key", primary_key=True), words("value"), **STRICT)
    op.create_table(
        "instrument",
        sa.Column("id", sa.Integer(), primary_key=True),
        *map(words, ("maker", "model", "serial", "kind", "owner", "notes")),
        sa.UniqueConstraint("maker", "model", "serial"),
        **STRICT,
    )
    op.create_table(
        "reference",
        sa.Column("id", sa.Integer(), primary_key=True),
        *map(words, ("name", "serial", "certificate", "valid_until")),
        sa.UniqueConstraint("name", "serial", "certificate", "valid_until"),
        **STRICT,
    )
    op.create_table(
        "recording",
        words("sha256", primary_key=True),
        sa.Column("bytes", sa.BigInteger().with_variant(sa.Integer(), "sqlite")),
        words("place", nullable=True),
        **STRICT,
    )
    op.create_table(
        "result",
        words("id", primary_key=True),
        words("object"),
        words("report", nullable=True),
        *map(words, ("command", "version", "program")),
        sa.Column("instrument_id", sa.Integer(), sa.ForeignKey("instrument.id"), index=True),
        *map(words, ("made", "measured", "operator", "status", "message")),
        **STRICT,
    )
    op.create_table(
        "source",
        words("result_id", sa.ForeignKey("result.id"), primary_key=True),
        sa.Column("position", sa.Integer(), primary_key=True),
        sa.Column("sha256", sa.Text(), sa.ForeignKey("recording.sha256"), nullable=False, index=True),
        words("path"),
        **STRICT,
    )
    op.create_table(
        "used",
        words("result_id", sa.ForeignKey("result.id"), primary_key=True),
        sa.Column("reference_id", sa.Integer(), sa.ForeignKey("reference.id"), primary_key=True),
        **STRICT,
    )
    op.create_table(
        "coefficient",
        words("result_id", sa.ForeignKey("result.id"), primary_key=True),
        sa.Column("position", sa.Integer(), primary_key=True),
        sa.Column("name", sa.Text(), nullable=False, index=True),
        *map(number, ("value", "u", "expanded", "k", "dof")),
        words("unit"),
        number("common"),
        **STRICT,
    )
    op.create_table(
        "supersession",
        words("result_id", sa.ForeignKey("result.id"), primary_key=True),
        words("by_id", sa.ForeignKey("result.id")),
        words("reason"),
        words("made"),
        **STRICT,
    )
    op.create_table(
        "event",
        sa.Column("number", sa.Integer(), primary_key=True, autoincrement=False),
        *map(words, ("made", "kind", "subject", "digest", "previous", "hash")),
        **STRICT,
    )
    append_only("recording", "result", "source", "used", "coefficient", "supersession", "event")
