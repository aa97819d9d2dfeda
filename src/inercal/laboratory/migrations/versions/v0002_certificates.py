"""Certificates, and the results that they state."""

import sqlalchemy as sa
from alembic import op

from inercal.laboratory.migrations.append_only import append_only

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Make the tables."""
    op.create_table(
        "certificate",
        sa.Column("number", sa.Text(), primary_key=True),
        sa.Column("object", sa.Text(), nullable=False),
        sa.Column("page", sa.Text()),
        sa.Column("issued", sa.Text(), nullable=False),
        sa.Column("supersedes", sa.Text(), sa.ForeignKey("certificate.number")),
        sqlite_strict=True,
    )
    op.create_table(
        "certified",
        sa.Column("number", sa.Text(), sa.ForeignKey("certificate.number"), primary_key=True),
        sa.Column("result_id", sa.Text(), sa.ForeignKey("result.id"), primary_key=True),
        sqlite_strict=True,
    )
    append_only("certificate", "certified")
