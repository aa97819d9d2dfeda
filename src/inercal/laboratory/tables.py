"""The tables of a store.

Times are UTC, ISO 8601 texts. Values are in the units of the result (SI). Objects are named by the SHA-256 of their
bytes.
"""

from __future__ import annotations

from typing import Annotated

from sqlalchemy import REAL, BigInteger, Double, ForeignKey, Integer, Text, UniqueConstraint
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

MaybeNumber = Annotated[float | None, mapped_column(Double().with_variant(REAL(), "sqlite"))]
Words = Annotated[str, mapped_column(Text)]
MaybeWords = Annotated[str | None, mapped_column(Text)]


class Tables(DeclarativeBase):
    """The tables."""

    __table_args__: object = {"sqlite_strict": True}


class Setting(Tables):
    """A setting of the store itself: ``objects``, where they are."""

    __tablename__ = "setting"
    key: Mapped[Words] = mapped_column(primary_key=True)
    value: Mapped[Words]


class StoredInstrument(Tables):
    """An instrument that is calibrated."""

    __tablename__ = "instrument"
    __table_args__ = (UniqueConstraint("maker", "model", "serial"), {"sqlite_strict": True})
    id: Mapped[int] = mapped_column(primary_key=True)
    maker: Mapped[Words]
    model: Mapped[Words]
    serial: Mapped[Words]
    kind: Mapped[Words]
    owner: Mapped[Words]
    notes: Mapped[Words]


class StoredReference(Tables):
    """A standard, table or rig that a calibration used: its certificate, and until when that is valid."""

    __tablename__ = "reference"
    __table_args__ = (
        UniqueConstraint("name", "serial", "certificate", "valid_until"),
        {"sqlite_strict": True},
    )
    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[Words]
    serial: Mapped[Words]
    certificate: Mapped[Words]
    valid_until: Mapped[Words]


class StoredFile(Tables):
    """A file that results rest on, a recording, map or study: ``place`` is its path where it is kept by reference."""

    __tablename__ = "recording"
    sha256: Mapped[Words] = mapped_column(primary_key=True)
    bytes: Mapped[int | None] = mapped_column(BigInteger().with_variant(Integer(), "sqlite"))
    place: Mapped[MaybeWords]


class StoredResult(Tables):
    """A result: ``id`` is the SHA-256 of what it says, times of computing and the command line apart.

    ``object`` is its JSON, ``report`` its page; ``program`` the SHA-256 of the sources that made it, where known.
    """

    __tablename__ = "result"
    id: Mapped[Words] = mapped_column(primary_key=True)
    object: Mapped[Words]
    report: Mapped[MaybeWords]
    command: Mapped[Words]
    version: Mapped[Words]
    program: Mapped[Words]
    instrument_id: Mapped[int | None] = mapped_column(ForeignKey("instrument.id"), index=True)
    made: Mapped[Words]
    measured: Mapped[Words]
    operator: Mapped[Words]
    status: Mapped[Words]
    message: Mapped[Words]


class SourceOf(Tables):
    """A file that a result rests on, under the path by which the command knew it."""

    __tablename__ = "source"
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
    position: Mapped[int] = mapped_column(primary_key=True)
    sha256: Mapped[Words] = mapped_column(ForeignKey("recording.sha256"), index=True)
    path: Mapped[Words]


class Used(Tables):
    """A reference that a result used."""

    __tablename__ = "used"
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
    reference_id: Mapped[int] = mapped_column(ForeignKey("reference.id"), primary_key=True)


class StoredCoefficient(Tables):
    """A coefficient of a result: value, standard and expanded uncertainty, coverage factor; ``dof`` None is infinite.

    ``common`` is the part of u that repeat runs have in common, where the result tells it apart.
    """

    __tablename__ = "coefficient"
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
    position: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[Words] = mapped_column(index=True)
    value: Mapped[MaybeNumber]
    u: Mapped[MaybeNumber]
    expanded: Mapped[MaybeNumber]
    k: Mapped[MaybeNumber]
    dof: Mapped[MaybeNumber]
    unit: Mapped[Words]
    common: Mapped[MaybeNumber]


class Supersession(Tables):
    """A result that another takes the place of, and why."""

    __tablename__ = "supersession"
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
    by_id: Mapped[Words] = mapped_column(ForeignKey("result.id"))
    reason: Mapped[Words]
    made: Mapped[Words]


class Event(Tables):
    """Something that was done to the store, in order; ``hash`` covers the row and the hash of the row before."""

    __tablename__ = "event"
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    made: Mapped[Words]
    kind: Mapped[Words]
    subject: Mapped[Words]
    digest: Mapped[Words]
    previous: Mapped[Words]
    hash: Mapped[Words]


class IssuedCertificate(Tables):
    """A certificate that was issued: its XML, its page, and the number of the one that it supersedes."""

    __tablename__ = "certificate"
    number: Mapped[Words] = mapped_column(primary_key=True)
    object: Mapped[Words]
    page: Mapped[MaybeWords]
    issued: Mapped[Words]
    supersedes: Mapped[str | None] = mapped_column(Text, ForeignKey("certificate.number"))


class Certified(Tables):
    """A result that a certificate states."""

    __tablename__ = "certified"
    number: Mapped[Words] = mapped_column(ForeignKey("certificate.number"), primary_key=True)
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
