"""Column maps: what they may say, what is said of wrong ones, and how files and parts find each other."""

from pathlib import Path

import numpy as np
import pytest

from inercal.foundation.errors import InputError, MapError, RecordError
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.read.table import FileOptions
from rows import for_each


def written(path, text):
    path.write_text(text)
    return path


T = '[columns.t]\nfrom = 0\nunit = "s"\n'
ACC = '[columns.acc_x]\nfrom = 1\nunit = "g"\n'


def test_a_map_gives_channels_options_and_rate(tmp_path):
    text = """
    [columns.t]
    from = "stamp"
    unit = "ms"
    [columns.gyro_x]
    from = ["omega", 2]
    unit = "arcsec"
    sign = -1
    scale = 0.1
    kind = "increment"
    [columns.label]
    from = 3
    [time]
    rate = "0.1 kHz"
    [file]
    delimiter = ";"
    decimal = ","
    comment = "//"
    skip = 2
    [file.acc]
    path = "acc.csv"
    variable = "alpha"
    [file.acc.columns.acc_x]
    from = 1
    unit = "mg"
    """
    found = read_map(written(tmp_path / "map.toml", text))
    plain, acc = found.parts
    assert [channel.name for channel in plain.channels] == ["t", "gyro_x", "label"]
    assert [channel.origin for channel in plain.channels] == ["stamp", ("omega", 2), 3]
    assert (plain.channels[1].factor, plain.channels[1].increment) == (-0.1, True)
    assert plain.options == FileOptions(delimiter=";", decimal=",", comment="//", skip=2)
    assert (acc.name, acc.path, acc.options.variable) == ("acc", "acc.csv", "alpha")
    assert (found.rate, found.ignore_time) == (100.0, False)


@for_each(
    ("text", "message"),
    [
        ("", r"columns: missing, expected at least one \[columns.NAME\]"),
        ("[columns", "not valid TOML"),
        ("[colums.acc_x]\nfrom = 1", "colums: unknown key, did you mean columns?"),
        ("[columns.acx]\nfrom = 1\nunit = 'g'", r"columns.acx: unknown channel, did you mean acc_x\?"),
        (
            "[columns.qqqqqq]\nfrom = 1\nunit = 'g'",
            "columns.qqqqqq: unknown channel, known channels: acc_x, ",
        ),
        ("[columns.acc_x]\nunit = 'g'", "columns.acc_x.from: missing, expected a value"),
        ("[columns.acc_x]\nfrom = -1\nunit = 'g'", "columns.acc_x.from: found -1, expected a column number"),
        (
            "[columns.acc_x]\nfrom = true\nunit = 'g'",
            "columns.acc_x.from: found True, expected a column number",
        ),
        (
            "[columns.acc_x]\nfrom = ['v']\nunit = 'g'",
            r"columns.acc_x.from: found \['v'\], expected a column",
        ),
        ("[columns.acc_x]\nfrom = 1\nunti = 'g'", r"columns.acc_x.unti: unknown key, did you mean unit\?"),
        ("[columns.acc_x]\nfrom = 1", "columns.acc_x.unit: missing, expected a unit such as"),
        (
            "[columns.acc_x]\nfrom = 1\nunit = 'm/s'",
            r'columns.acc_x.unit: found "m/s" \(velocity\), expected a unit of acceleration or count or voltage or '
            r'current or torque or kind = "increment"',
        ),
        (
            "[columns.acc_x]\nfrom = 1\nunit = 'flurb'",
            "columns.acc_x.unit: found the unit 'flurb', expected one",
        ),
        (
            "[columns.gyro_x]\nfrom = 1\nunit = 'deg/s'\nkind = 'increment'",
            r'columns.gyro_x.unit: found "deg/s" \(rate\), expected a unit of angle',
        ),
        (
            "[columns.temperature]\nfrom = 1\nunit = 'degC'\nkind = 'increment'",
            'kind = "increment", expected kind = "rate" for temperature',
        ),
        ("[columns.acc_x]\nfrom = 1\nunit = 'g'\nsign = 2", "columns.acc_x.sign: found 2, expected 1 or -1"),
        (
            "[columns.acc_x]\nfrom = 1\nunit = 'g'\nscale = 0",
            "columns.acc_x.scale: found 0, expected a number other than 0",
        ),
        (ACC + "[time]\nrate = '100'", "time.rate: found '100' without a unit, expected a quantity"),
        (ACC + "[time]\nrate = '-5 Hz'", "time.rate: found '-5 Hz', expected a rate above 0"),
        (ACC + "[time]\nignore = true", "time.rate: missing, expected a rate"),
        (ACC + "[file]\ndelimiter = '::'", "file.delimiter: found '::', expected one character"),
        (ACC + "[file]\ndelimter = ','", r"file.delimter: unknown key, did you mean delimiter\?"),
        (ACC + "[file]\ndelimiter = ','\ndecimal = ','", "file.decimal: found ',', expected another"),
        (ACC + "[file]\nskip = -1", "file.skip: found -1, "),
        ("file = 3", "file: found 3, expected a table"),
        ("[site]\ngravity = '9.81 m/s^2'", "found a study, which goes behind --study, expected a column map"),
        ("[file.acc]\npath = 'a.csv'", "file.acc: columns: missing, expected a value"),
        ("[file.acc]\n[file.acc.columns.acc_x]\nfrom = 1\nunit = 'g'", "file.acc: path: missing"),
        (
            "[file.acc]\npath = 'a.csv'\n[file.acc.columns.acc_x]\nfrom = 1\nunit = 's'",
            'file.acc: columns.acc_x.unit: found "s"',
        ),
    ],
)
def test_wrong_maps_are_explained(tmp_path, text, message):
    path = written(tmp_path / "map.toml", text)
    with pytest.raises(InputError, match=message) as caught:
        read_map(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_sign_scale_and_unit_are_applied(tmp_path):
    data = written(tmp_path / "a.csv", "0,10,20\n5,11,21\n10,12,22\n")
    columns = (
        '[columns.t]\nfrom = 0\nunit = "ms"\n[columns.acc_x]\nfrom = 2\nunit = "mg"\nsign = -1\nscale = 0.5'
    )
    record = read(data, written(tmp_path / "map.toml", columns))
    np.testing.assert_allclose(record["acc_x"].t, [0.0, 0.005, 0.01])
    np.testing.assert_array_equal(record["acc_x"].values, [-10.0, -10.5, -11.0])
    assert record["acc_x"].unit.symbol == "mg"


def test_increments_of_a_test_on_a_table_need_its_time(tmp_path):
    """Rows of a table may be counted in place of a time, but a count says nothing of how fast an angle grew."""
    path = written(tmp_path / "a.csv", "".join(f"{i},{i % 3}\n" for i in range(9)))
    phi = '[columns.phi1]\nfrom = 0\nunit = "deg"\n'
    gyro = '[columns.gyro_x]\nfrom = 1\nunit = "arcsec"\nkind = "increment"\n'
    record_map = written(tmp_path / "map.toml", phi + gyro)
    with pytest.raises(RecordError, match="found no time column t"):
        read(path, record_map)
    written(record_map, phi + gyro + '[time]\nrate = "10 Hz"\n')
    assert read(path, record_map)["gyro_x"].values[4] == pytest.approx(np.radians(1 / 3600) * 10)


def test_increments_become_rates(tmp_path):
    data = written(tmp_path / "a.csv", "".join(f"{i / 100},{3600 * i},{i}\n" for i in range(5)))
    columns = (
        '[columns.gyro_x]\nfrom = 1\nunit = "arcsec"\nkind = "increment"\nscale = 0.1\n'
        '[columns.acc_x]\nfrom = 2\nunit = "mm/s"\nkind = "increment"\n'
    )
    for time in (T, '[time]\nrate = "100 Hz"\n'):
        record = read(data, written(tmp_path / "map.toml", columns + time))
        assert record["gyro_x"].unit.symbol == "rad/s"
        assert record["acc_x"].unit.symbol == "m/s^2"
        np.testing.assert_allclose(record["gyro_x"].values, np.radians([0, 10, 20, 30, 40]), rtol=1e-12)
        np.testing.assert_allclose(record["acc_x"].values, [0, 0.1, 0.2, 0.3, 0.4], rtol=1e-12)


def test_stamps_that_cannot_be_trusted_are_ignored(tmp_path):
    data = written(tmp_path / "a.csv", "7,1\n7,1\n3,1\n")
    record = read(data, written(tmp_path / "map.toml", T + ACC + '[time]\nrate = "50 Hz"\nignore = true'))
    np.testing.assert_allclose(record["acc_x"].t, [0.0, 0.02, 0.04])
    assert record.findings == ()


def test_options_of_the_file_are_followed(tmp_path):
    data = written(tmp_path / "a.csv", "Fs;100\nMode;2\nnow;x\n0;1,5\n// a note\n1;2,5\n")
    options = '[file]\nskip = 2\ncomment = "//"\ndelimiter = ";"\ndecimal = ","\n'
    record = read(data, written(tmp_path / "map.toml", options + T + ACC.replace("1\n", '"x"\n')))
    np.testing.assert_array_equal(record["acc_x"].values, [1.5, 2.5])


def test_named_files_keep_their_clocks(tmp_path):
    fast = written(tmp_path / "fast.csv", "0.0,1\n0.1,2\n0.2,3\n")
    slow = written(tmp_path / "slow.csv", "0.0,4\n0.2,5\n")
    text = "".join(
        f'[file.{name}]\npath = "{name}.csv"\n[file.{name}.columns.t]\nfrom = 0\nunit = "s"\n'
        f'[file.{name}.columns.{channel}]\nfrom = 1\nunit = "{unit}"\n'
        for name, channel, unit in (("fast", "acc_x", "g"), ("slow", "gyro_x", "deg/s"))
    )
    record_map = written(tmp_path / "map.toml", text)
    for files in ([fast, slow], [slow, fast], [slow], []):
        record = read(files, record_map)
        np.testing.assert_array_equal(record["acc_x"].t, [0.0, 0.1, 0.2])
        np.testing.assert_array_equal(record["gyro_x"].t, [0.0, 0.2])
        assert [Path(source.path).suffix for source in record.sources[-1:]] == [
            ".toml"
        ]  # the map is an input too
        assert len(record.sources) == 3
    with pytest.raises(
        RecordError, match=r"other.csv: not named by .*map.toml, expected fast.csv or slow.csv"
    ):
        read([written(tmp_path / "other.csv", "1,2\n")], record_map)
    slow.unlink()
    with pytest.raises(RecordError, match=r"slow.csv: found no such file"):
        read([fast], record_map)


def test_a_plain_map_takes_each_header_from_the_file_that_has_it(tmp_path):
    acc = written(tmp_path / "acc.csv", "time,ax\n0.0,1\n0.1,2\n")
    gyro = written(tmp_path / "gyro.csv", "time,gx\n0.0,3\n0.1,4\n0.2,5\n")
    text = (
        '[columns.t]\nfrom = "time"\nunit = "s"\n[columns.acc_x]\nfrom = "ax"\nunit = "g"\n'
        '[columns.gyro_x]\nfrom = "gx"\nunit = "deg/s"\n'
    )
    record_map = written(tmp_path / "map.toml", text)
    record = read([acc, gyro], record_map)
    np.testing.assert_array_equal(record["gyro_x"].values, [3, 4, 5])
    assert len(record["acc_x"].t) == 2
    with pytest.raises(
        MapError, match=r"columns.gyro_x.from: found no 'gx' in .*acc.csv \(columns time, ax\)"
    ):
        read([acc], record_map)
    with pytest.raises(RecordError, match=r"found acc_x as in .*acc.csv, expected each channel in one file"):
        read([acc, written(tmp_path / "again.csv", "time,ax,gx\n0,1,1\n1,2,1\n")], record_map)
    with pytest.raises(RecordError, match="found columns foo, bar, expected a mapped column at least"):
        read([acc, gyro, written(tmp_path / "foo.csv", "foo,bar\n0,1\n1,2\n")], record_map)


def test_a_file_without_stamps_shares_those_of_equal_length_only(tmp_path):
    acc = written(tmp_path / "acc.csv", "time,ax\n0.0,1\n0.1,2\n")
    gyro = written(tmp_path / "gyro.csv", "gx\n3\n4\n")
    text = (
        '[columns.t]\nfrom = "time"\nunit = "s"\n[columns.acc_x]\nfrom = "ax"\nunit = "g"\n'
        '[columns.gyro_x]\nfrom = "gx"\nunit = "deg/s"\n'
    )
    record_map = written(tmp_path / "map.toml", text)
    for files in ([acc, gyro], [gyro, acc]):
        record = read(files, record_map)
        assert record["gyro_x"].t is record["acc_x"].t
    written(gyro, "gx\n3\n4\n5\n")
    with pytest.raises(RecordError, match=r"gyro.csv: found 3 rows without t, and stamps for 2 in .*acc.csv"):
        read([acc, gyro], record_map)


def test_column_numbers_beyond_the_file_are_said(tmp_path):
    data = written(tmp_path / "a.csv", "0,1\n1,2\n")
    record_map = written(tmp_path / "map.toml", T + ACC.replace("1", "7"))
    with pytest.raises(MapError, match=r"columns.acc_x.from: found no 7 in .*\(2 columns without a header\)"):
        read(data, record_map)
