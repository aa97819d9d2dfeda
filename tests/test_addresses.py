"""Addresses show no secret: against SQLAlchemy's own rendering, and for passwords of any characters."""

from urllib.parse import quote

from hypothesis import assume, given
from hypothesis import strategies as st
from sqlalchemy.engine import make_url

from inercal.foundation.addresses import (
    HIDDEN,
    hidden_in,
    holds_secret,
    shown_address,
    without_login,
    without_secrets,
)
from inercal.foundation.addresses import PLAIN as KNOWN
from inercal.foundation.errors import InputError
from inercal.foundation.units import shown
from rows import for_each

SHOWN = {
    "postgresql://u@h/db": "postgresql://u@h/db",
    "postgresql://u:PW@h:5432/db?sslmode=require&password=PW": "postgresql://u:***@h:5432/db?sslmode=require&password=***",
    "postgresql://u:p@PW/PW@h/db": "postgresql://u:***@h/db",
    "postgresql://u:12/PW@h/db": "postgresql://u:***@h/db",
    "postgresql:///db?host=/run&user=u&password=PW": "postgresql:///db?host=/run&user=u&password=***",
    "s3://KEY:PW@bucket/a.csv": "s3://***@bucket/a.csv",
    "s3:/KEY:PW@bucket/a.csv": "s3:/***@bucket/a.csv",
    "https://PW@h/x": "https://***@h/x",
    "http://u:PW@h:80/a.csv?part=PW&X-Amz-Signature=PW": "http://***@h:80/a.csv?part=***&X-Amz-Signature=***",
    "https://h/a.csv?PW": "https://h/a.csv?***",
    "https://h/a.csv#token=PW": "https://h/a.csv#token=***",
    "simplecache::s3://K:PW@b/x?versionId=3": "simplecache::s3://***@b/x?versionId=3",
    "zip://inner.csv::https://u:PW@h/a.zip?sig=PW": "zip://inner.csv::https://***@h/a.zip?sig=***",
    "--store=postgresql://u:PW@h/db": "--store=postgresql://u:***@h/db",
    "host=h user=u password='PW PW'": "host=h user=u password=***",
    "postgresql://u:hunter:/PW@h/db": "postgresql://u:***@h/db",
    "http://h/f.csv?sig=PW:/PW": "http://h/f.csv?sig=***",
    "http://h/f.csv?url=http://other/a&sig=PW": "http://h/f.csv?url=***&sig=***",
    "sqlite+pysqlcipher://:PW@/x.db": "sqlite+pysqlcipher://***@/x.db",
    "file://user:PW@host/x": "file://***@host/x",
    "x://u:PW@h/d": "x://***@h/d",
    "https:/PW@h/x.csv": "https:/***@h/x.csv",
    "password=a,PW&PW": "password=***",
    "token=PW": "token=***",
}
"""Addresses with the secret PW, and as they are shown."""

PLAIN = (
    "tcp://host:8786",
    "udp://[::1]:5005",
    "serial:/dev/ttyUSB0?baud=921600",
    "mqtts://broker:8883/topic?login=secret.txt&ca=ca.pem&version=5",
    "replay:log.csv?speed=1",
    "s3://bucket/unit@home.csv",
    "sqlite:///tmp/a@b/store.db",
    "https://ptb.de/dcc/v3.2.1/dcc.xsd",
    "expected an address such as udp://127.0.0.1:5005, tcp://host:5006, or mqtt://host/topic",
    "t [s],acc_x [m/s^2]",
    "imu.method=means",
    "replay:/a@b.csv",
    "sftp://host:22/a@b.csv",
    "text:/tmp/a:b",
    "C:/a@b",
    "token=1/cal.json",
    "https://www.dakks.de/en/body.html?id=D-K-15070-01-00",
    "postgresql://u@h/db: the database says: no such user u@h",
)
"""Texts without a secret."""


@for_each("address", SHOWN)
def test_what_is_shown(address):
    assert shown_address(address) == without_secrets(address) == SHOWN[address]
    assert holds_secret(address) == ("PW" in address)
    assert without_secrets(SHOWN[address]) == SHOWN[address]


@for_each("text", PLAIN)
def test_what_holds_none_stays(text):
    assert without_secrets(text) == text
    assert "expected" in text or "says" in text or not holds_secret(text)


@for_each(
    "address", [a for a in SHOWN if a.startswith("postgresql://u:PW") or a.startswith("postgresql://u@")]
)
def test_a_database_as_sqlalchemy_shows_it(address):
    plain = address.partition("?")[0]
    assert shown_address(plain) == make_url(plain).render_as_string(hide_password=True)


@given(
    scheme=st.sampled_from(
        ["postgresql", "postgresql+psycopg", "s3", "http", "https", "mqtt", "tcp", "simplecache::s3"]
    ),
    before=st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Zl", "Zp"]), max_size=6),
    after=st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Zl", "Zp"]), max_size=6),
    quoted=st.booleans(),
    tail=st.sampled_from(["/db", "/a/b.csv", "/x?speed=1", ""]),
)
def test_a_password_of_any_characters_is_hidden(scheme, before, after, quoted, tail):
    """Typed as it is or quoted, alone or cut off within a message; hiding twice changes nothing."""
    password = f"{before}SeCrEt{after}"
    typed = quote(password, safe="") if quoted else password
    # typed as it is, what follows a number and a slash, or ? or #, is a path or query to every library
    assume(quoted or not (before[:1].isdigit() or set(before) & set("/?#\\ \t") or "://" in password))
    address = f"{scheme}://user:{typed}@host{tail}"
    said = shown_address(address)
    assert "SeCrEt" not in said
    assert shown_address(said) == said
    assert "SeCrEt" not in shown_address(f"--store={address}")
    assert "SeCrEt" not in shown(address)
    assert "SeCrEt" not in str(InputError(address, "cannot be reached"))
    if not set(typed) & set("\"'<> \t\xa0") and not any(c.isspace() for c in typed):
        assert "SeCrEt" not in without_secrets(f"found {address}, expected another")


@given(key=st.from_regex(r"[A-Za-z_.-]{1,20}", fullmatch=True), value=st.text(min_size=1, max_size=8))
def test_a_value_of_a_query_is_shown_only_for_known_keys(key, value):
    said = shown_address(f"https://host/file.csv?{key}=SeCrEt{quote(value)}")
    assert ("SeCrEt" in said) == (key.lower() in KNOWN)


def test_what_a_driver_says_of_an_address():
    address = "postgresql://u:p%40ssword@h/db?password=other"
    assert (
        hidden_in('no host "p@ssword" or "p%40ssword", other', address)
        == f'no host "{HIDDEN}" or "{HIDDEN}", {HIDDEN}'
    )


def test_texts_that_would_take_a_backtracking_reader_for_ever():
    """200 kB each: what is hidden takes time in proportion to the text."""
    for part in (
        "a-",
        "a://",
        "x=s3://",
        "a::s3://",
        "token=",
        "token=a/",
        "'s3://u:x",
        "postgresql://a:",
        "s3://a?b&",
    ):
        text = part * (200_000 // len(part)) + "="
        assert shown_address(text).count("=") <= text.count("=")


@for_each("address", ["s3://K:PW@b/objects", "s3://b/objects?key=PW", "s3://b/objects"])
def test_an_address_to_be_used_without_its_login(address):
    assert without_login(address) == "s3://b/objects"
