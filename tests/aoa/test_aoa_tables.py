"""What the terminal shows: numbers in units of the field, the same as those of the result."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from sting_study import DEG, G, study

from inercal.foundation.instruments.terms import shown_unit, sized
from inercal.foundation.results.files import save, to_json
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.fusion.filter_result import estimate, of_fusion
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reference.corrections import report_of
from inercal.systems.aoa.reference.sensor_fit import fit
from inercal.systems.aoa.result.carry_over import corrected
from inercal.systems.aoa.result.outcome import assemble, assemble_angles, term_of
from inercal.systems.aoa.result.points import points
from inercal.systems.aoa.result.tables import (
    angle,
    answer,
    delays,
    displayed,
    fitted,
    methods,
    on_page,
    on_terminal,
    points_table,
    rest_of_fit,
    sensors,
    uncertainty,
    use_of_fit,
)
from inercal.systems.aoa.result.verification import errors
from inercal.systems.aoa.settings import SensorCalibration, Timing
from inercal.systems.aoa.simulate import simulate

PAUSES = MotionPlan(
    "pitch-pause", sample_rate=200.0, first=0.0, last=20.0 * DEG, step=10.0 * DEG, move=1.0, pause=2.0
)


def assembled(settings, made, verified=None):
    of = problem(settings)
    found = estimate(made, of)
    return assemble(made, settings, of, found, [], None, verified=verified), found


def measured(judged=True, **changes):
    settings = study(motion=PAUSES, **changes)
    made = simulate(settings, np.random.default_rng(4)).recording
    of = problem(settings)
    found = estimate(made, of)
    own = of_fusion(found, 19)
    off = Angles("by hand", own.theta + 0.02 * DEG, own.u, own.rate, own.rate_u)
    against = {each.method: errors(made, each) for each in (own, off)} if judged else None
    at_rest = points(made, own, settings)
    result = assemble(made, settings, of, found, [], None, at_rest, against, {"by hand": off})
    return settings, result, at_rest


@pytest.fixture(scope="module")
def shown():
    return measured()


def test_units_of_the_field_are_what_they_say():
    assert [shown_unit(unit) for unit in ("m", "s", "1")] == [("mm", 1e-3), ("ms", 1e-3), ("ppm", 1e-6)]
    assert shown_unit("m/s^2") == ("ug", 1e-6 * 9.80665)
    assert shown_unit("rad/s")[1] * 3600.0 == pytest.approx(DEG)
    assert shown_unit("kelvin") == ("kelvin", 1.0)
    assert sized(0.2 * DEG, "rad/s") == (pytest.approx(0.2), "deg/s")
    assert sized(5.0 * DEG / 3600.0, "rad/s") == (pytest.approx(5.0), "deg/h")
    assert sized(0.01 * G, "m/s^2") == (pytest.approx(10.0), "mg")
    assert sized(1e-3, "1") == (pytest.approx(1000.0), "ppm")
    assert sized(1.0, "1") == (1.0, "1")


def test_each_coefficient_has_words(shown):
    for name in (*shown[1].names, "tau_g", "b_roll", "b_yaw"):
        assert term_of(name).name
    assert term_of("b_2").name == "bias of accelerometer 2"
    assert term_of("b_g").name == "bias of the gyro"
    with pytest.raises(KeyError):
        term_of("b_nobody")


def test_the_table_of_sensors_shows_u_beside_the_prior(shown):
    _, result, _ = shown
    lines = {row[0]: row for row in sensors(result).rows}
    _, _, value, u, before, unit = lines["b_1"]
    assert unit == "ug"
    assert float(value) == pytest.approx(result["b_1"].value / (1e-6 * G), abs=0.51)
    assert float(u) == pytest.approx(result["b_1"].u / (1e-6 * G), rel=0.05)
    assert float(before) == pytest.approx(100.0)
    assert lines["zo_2"][4:] == ("5", "mm")
    assert lines["b_g"][4:] == ("5", "deg/h")
    assert lines["k_g"][4:] == ("1000", "ppm")


def test_displaying_changes_units_and_nothing_else(shown):
    _, result, _ = shown
    other = displayed(result)
    for name in result.names:
        assert other[name].value / other[name].u == pytest.approx(result[name].value / result[name].u)
    assert other.conditions["ranges"]["theta_deg"] == pytest.approx(
        np.degrees(result.conditions["ranges"]["theta_rad"])
    )


def test_points_are_listed_with_their_uncertainty(shown):
    settings, _, at_rest = shown
    table = points_table(at_rest, settings)
    assert len(table.rows) == 3
    assert [float(row[4]) for row in table.rows] == pytest.approx([0.0, 10.0, 20.0], abs=0.05)
    assert "alpha" not in table.text()


def test_methods_side_by_side_tell_errors_where_there_is_a_reference(shown):
    _, result, _ = shown
    rows = {row[0]: row[1:] for row in methods(result).rows}
    assert set(rows) == {"fusion 19", "by hand"}
    own, off = (float(rows[name][2]) for name in ("fusion 19", "by hand"))
    assert off - own == pytest.approx(0.02, abs=2e-4)


def test_methods_side_by_side_tell_differences_without_a_reference():
    _, result, _ = measured(judged=False)
    rows = {row[0]: row[1:] for row in methods(result).rows}
    assert float(rows["by hand"][0]) == pytest.approx(0.02)
    assert rows["fusion 19"][0] == "–"


def test_the_parts_of_u_add_up_to_it_in_squares(shown):
    _, result, _ = shown
    parts = [float(row[3]) for row in uncertainty(result).rows]
    median = math.degrees(result.result["angle"]["u"]["median"])
    assert math.hypot(*parts) == pytest.approx(median, rel=0.02)
    assert parts == sorted(parts, reverse=True)


def test_the_cost_of_a_delay_is_said_in_degrees(shown):
    """10 deg in 1 s by a quintic: 18.75 deg/s at most, 0.019 deg for each millisecond."""
    assert "not stated" in delays(shown[1])
    assert "0.019 deg at most" in delays(shown[1])
    _, result, _ = measured(timing=Timing(gyro_delay=2e-3, common_delay=1e-3, common_delay_u=1e-4))
    words = delays(result)
    assert "2 ms as stated" in words
    assert "1.00 ms (u 0.10 ms)" in words
    assert "0.019 deg at most" in words
    assert "0.0019 deg at most" in words


def test_a_delay_is_later_earlier_or_not_seen(shown):
    _, result, _ = shown

    def words(spectra, stated=0.0):
        value, u = spectra
        known = {"stated": stated, "spectra": {"value": value, "u": u, "coherence": 1.0}}
        parts = {"timing": result.result["timing"] | {"gyro_delay": known}, "posterior": {}}
        return delays(replace(result, result=result.result | parts)).partition(". ")[0]

    assert (
        words((2e-3, 1e-5))
        == "The gyro is later than the accelerometers by 2.000 ms (u 0.010 ms) by the spectra"
    )
    assert words((-2e-3, 1e-5)).endswith(
        "is earlier than the accelerometers by 2.000 ms (u 0.010 ms) by the spectra"
    )
    none = words((-2.9e-7, 3.2e-6))
    assert (
        none
        == "No delay of the gyro against the accelerometers is seen: -0.0003 ms (u 0.0032 ms) by the spectra"
    )
    both = words((1e-7, 3.2e-6), stated=-1e-3)
    assert both.endswith(
        "earlier than the accelerometers by 1 ms as stated, -0.0001 ms (u 0.0032 ms) by the spectra"
    )


def test_sensors_of_the_conditions_are_told_in_words_with_units(shown):
    _, result, _ = shown
    told = displayed(result).conditions["sensors"]
    assert told == {
        "a1": "lambda 90 deg, r -0.25 m, z 0 m",
        "a2": "lambda 0 deg, r 0.2 m, z 0 m",
        "a3": "lambda -90 deg, r 0.25 m, z 0 m",
    }
    sensors_known = {"a1": SensorCalibration(scale=1.01, bias=0.5), "gyro": SensorCalibration(bias=0.1 * DEG)}
    _, other, _ = measured(sensors=sensors_known)
    told = displayed(other).conditions["sensors"]
    assert told["a1"].endswith("scale 1.01, bias 0.5 m/s^2")
    assert told["gyro"] == "scale 1, bias 0.1 deg/s"


@pytest.fixture(scope="module")
def on_a_table():
    """Two sensors whose axes are off by 0.5 mrad, 0.0286 deg, on a table that turns slowly: no position is seen."""
    sweep = MotionPlan("static", duration=40.0, sample_rate=100.0, first=-10.0 * DEG, last=90.0 * DEG)
    settings = study(motion=sweep)
    off = replace(settings.layout, angle=settings.layout.angle + np.array([5e-4, -5e-4, 0.0]))
    made = simulate(replace(settings, layout=off), np.random.default_rng(5)).recording
    found = fit(made, settings)
    return settings, made, found, assembled(settings, made, found)[0]


def test_the_fit_to_a_reference_is_a_table(on_a_table):
    settings, made, found, result = on_a_table
    rows = {row[0]: row[1:] for row in fitted(result).rows}
    assert rows["dlambda_1"][0] == "axis of accelerometer 1, towards down"
    assert float(rows["dlambda_1"][1]) == pytest.approx(0.5, abs=5.0 * float(rows["dlambda_1"][2]))
    assert rows["dlambda_2"][3] == "mrad"
    assert float(rows["dlambda_2"][4]) == pytest.approx(-0.0286, abs=5e-3)
    assert float(rows["S_1"][1]) == pytest.approx(0.0, abs=5.0 * float(rows["S_1"][2]))
    assert rows["S_1"][3] == "ppm"
    assert rows["zo_1"][1] == rows["tau_g"][1] == "not seen"
    assert set(rows) == {*found.names, ""}
    (short,) = (each for each in on_terminal(result) if each.title == fitted(result).title)
    listed = {row[0] for row in short.rows} - {""}
    assert {"dlambda_1", "dlambda_2"} <= listed < set(found.names)
    for name, (_, value, u, *_) in rows.items():
        if name and value != "not seen":
            assert (abs(float(value)) > 2.0 * float(u)) == (name in listed) or abs(
                abs(float(value)) / float(u) - 2.0
            ) < 0.1  # rounded
    others = set(re.findall(r"[a-zA-Z]+_\w+|tau", rest_of_fit(result))) - {"theta_ref"}
    assert others == set(found.names) - listed
    json.dumps(to_json(result), allow_nan=False)
    poor, _ = assembled(settings, made, replace(found, converged=False))
    assert "not to be used" in fitted(poor).caption
    assert "did not converge" in fitted(poor).title


@pytest.mark.parametrize(("wider", "used"), [(0.01, True), (1.0, False)])
def test_a_fit_is_said_to_be_used_where_the_next_run_uses_it(on_a_table, tmp_path, wider, used):
    """A sweep at one rate does not tell the axes from a delay of the table, so that it leaves them worse known than the
    fusion its biases; a hundred times as well known they are of use."""
    settings, _, found, result = on_a_table
    fit_ = replace(found, covariance=wider**2 * found.covariance)
    result = replace(result, result={**result.result, "verified": report_of(fit_)})
    save(result, tmp_path / "table.json")
    changed = corrected(tmp_path / "table.json", settings).corrections
    assert bool(changed) == used
    assert ("scales and axes are then put right" in use_of_fit(result)) == used
    assert ("sweep to and fro" in use_of_fit(result)) != used


def test_all_tables_of_the_fusion_and_of_a_paper_method(shown):
    """A page has the errors of the sensors as its coefficients; a terminal as a table."""
    settings, result, at_rest = shown
    besides = ["Where the uncertainty of the angle comes from", "Methods side by side"]
    assert [each.title for each in answer(result, at_rest, settings)] == ["Angle", "Points"]
    assert [each.title for each in on_page(result)] == besides
    assert [each.title for each in on_terminal(result)] == ["Errors of the sensors", *besides]
    made = simulate(settings, np.random.default_rng(4)).recording
    u = np.full(len(made.t), 0.01 * DEG)
    angles = Angles("improved, mechanical, dual", made.reference, u, made.gyro, u)
    plain = assemble_angles(made, settings, angles, [], None)
    assert [each.title for each in answer(plain, (), settings)] == ["Angle"]
    assert on_page(plain) == on_terminal(plain) == []
    none = replace(
        angles, theta=np.full(len(made.t), np.nan), rate=np.full(len(made.t), np.nan), u=u * np.nan
    )
    empty = assemble_angles(made, settings, none, [], None)
    assert "–" in angle(empty).text()
    assert delays(empty) == ""
