"""The module in which Alembic finds the connection and the tables; `inercal.laboratory.database.migrate` runs it."""

from alembic import context

from inercal.laboratory.database import Tables

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=Tables.metadata,
    transaction_per_migration=False,
)
context.run_migrations()
