"""The page of an Allan analysis: its numbers are the estimate's, in units of the field, and nothing is fetched."""

import base64
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from inercal.faces.report.allan import cells, page, pictures, shown_units
from inercal.foundation.inputs import Source
from inercal.foundation.instruments.noise import NoiseModel
from inercal.foundation.noise.outcome import noise_of
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit

HOSTILE = "<script>alert(1)</script>&.csv"


class Page(HTMLParser):
    """Rows of a page, its links and headings; raises where a tag is left open."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.rows, self.links, self.tags, self._open = [], [], set(), []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.links += [value for key, value in attributes if key in ("src", "href")]
        if tag not in ("meta", "img", "br"):
            self._open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if {"td", "th"} & set(self._open):
            self.rows[-1][-1] += data


def noise(*names, unit="deg/s", n=4000, path="static.csv"):
    rng = np.random.default_rng(40)
    t, source = np.arange(n) / 100.0, Source(path, "0" * 64)
    model = NoiseModel(N=0.01, K=0.002)
    columns = {}
    for name in names:
        values = model.simulate(n, 0.01, rng)[:, 0]
        columns[name] = Column(name, parse_unit(unit), values, t, source)
    return noise_of(Record(columns, sources=(source,)))


def test_numbers_are_those_of_the_estimate_in_units_of_the_field():
    found = noise("gyro_x", "gyro_y", "gyro_z")
    text = page(found)
    shown = Page(text)
    heads = [
        "channel",
        "N [deg/√h]",
        "B [deg/h]",
        "K [deg/h/√h]",
        "R [deg/h/h]",
        "Q [arcsec]",
        "N of a sample [deg/h]",
    ]
    assert heads in [[" ".join(cell.split()) for cell in row] for row in shown.rows]
    for name in ("gyro_x", "gyro_y", "gyro_z"):
        row = next(row for row in shown.rows if row and row[0] == name)
        value, _, u = row[1].partition(" ± ")
        p = found.estimate[f"N_{name}"]
        size = np.radians(1.0) / 60.0
        assert float(value) == pytest.approx(p.value / size, abs=0.6 * float(u))
        assert float(u) == pytest.approx(p.u / size, rel=0.06)
        interval = found.channels[0].curve.interval  # white noise of density N^2, averaged over an interval
        assert float(row[-1]) == pytest.approx(
            p.value / np.sqrt(interval) / np.radians(1.0 / 3600.0), rel=6e-3
        )


def test_a_coefficient_that_is_not_seen_is_a_limit():
    found = noise("gyro_x", n=400)
    channel = found.channels[0]
    unseen = [k for k, cell in enumerate(cells(channel, found)) if cell.startswith("< ")]
    assert unseen
    for k in unseen:
        symbol, (_, size) = "NBKRQ"[k], shown_units("rad/s")[1][k]
        limit = float(cells(channel, found)[k].removeprefix("< "))
        assert limit == pytest.approx(channel.fit.bounds[symbol] / size, rel=0.06)
        assert "e" not in cells(channel, found)[k] or not 1e-3 < limit < 1e6  # < 190, not < 1.9e+02


@pytest.mark.parametrize(
    ("unit", "texts"),
    [
        ("rad/s", ("deg/h", "deg/sqrt(h)", "deg/h", "deg/h/sqrt(h)", "deg/h/h", "arcsec")),
        ("m/s^2", ("ug", "ug/sqrt(Hz)", "ug", "ug/sqrt(h)", "ug/h", "ug*s")),
        ("count", ("count", "count*sqrt(s)", "count", "count/sqrt(s)", "count/s", "count*s")),
    ],
)
def test_units_of_the_field_and_their_sizes(unit, texts):
    """Pins: 1 deg/h = 4.84813681e-6 rad/s; 1 deg/sqrt(h) = 2.90888209e-4 rad/sqrt(s); 1 ug = 9.80665e-6 m/s^2."""
    own, others = shown_units(unit)
    assert (own[0], *(text for text, _ in others)) == texts
    if unit == "rad/s":
        assert own[1] == pytest.approx(4.84813681e-6, rel=1e-8)
        assert others[0][1] == pytest.approx(2.90888209e-4, rel=1e-8)
        assert others[2][1] == pytest.approx(4.84813681e-6 / 60.0, rel=1e-8)
        assert others[3][1] == pytest.approx(4.84813681e-6 / 3600.0, rel=1e-8)
    if unit == "m/s^2":
        assert own[1] == others[0][1] == pytest.approx(9.80665e-6)
        assert others[2][1] == pytest.approx(9.80665e-6 / 60.0)


@pytest.mark.slow
def test_one_picture_for_three_channels_of_a_sensor():
    found = noise("acc_x", "acc_y", "acc_z", "gyro_x", unit="count", n=500)
    assert [picture.title for picture in pictures(found)] == [
        "Accelerometers: acc_x, acc_y, acc_z",
        "Gyro: gyro_x",
    ]
    many = noise("a1", "a2", "a3", "a4", unit="g", n=500)
    assert [picture.title for picture in pictures(many)] == [
        "Accelerometers: a1, a2, a3",
        "Accelerometers: a4",
    ]


def test_the_page_needs_nothing_but_itself_and_escapes_what_it_is_given():
    text = page(noise("gyro_x", n=500, path=HOSTILE))
    shown = Page(text)
    assert "script" not in shown.tags
    assert all(link.startswith("data:") for link in shown.links)
    for link in shown.links:
        svg = base64.b64decode(link.partition(",")[2]).decode()
        assert all(target.startswith("#") for target in re.findall(r'href="([^"]*)"', svg))


def test_a_channel_without_noise_is_drawn_too():
    t, source = np.arange(500) / 100.0, Source("a.csv", "0" * 64)
    dead = Column("acc_x", parse_unit("g"), np.ones(500), t, source)
    text = page(noise_of(Record({"acc_x": dead}, sources=(source,))))
    assert "acc_x: the output never changes" in text
    assert next(row for row in Page(text).rows if row and row[0] == "acc_x")[1:6] == ["–"] * 5
