"""Diagnosis: each fault of a recording is named by its code and place, and a sound recording is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from paper_study import ARCSEC, DEG, NOISE, PPM, TRUTH, study

from inercal.foundation.findings import CODES, Finding, Harm
from inercal.foundation.geometry.rotations import exp, rotate
from inercal.systems.selfcal.diagnosis.examination import diagnose
from inercal.systems.selfcal.disturbances import Disturbances, EncoderHarmonic
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.rig import Base
from inercal.systems.selfcal.simulate import experiment, simulate

PROBLEM = problem(study())


def recording(seed=3, noise_of=None, **changes):
    """A simulated recording of the paper's path, with arrays of its own."""
    stated = study(**changes)
    stated = stated if noise_of is None else replace(stated, noise=noise_of)
    made = simulate(experiment(stated), np.random.default_rng(seed)).recording
    return replace(made, th=made.th.copy(), acc=made.acc.copy(), rate=made.rate.copy())


def named(made, problem=PROBLEM):
    return diagnose(made, problem, estimate(made, problem, history=False))


def only(found, code, *words):
    """The one finding, of that code and with these words."""
    assert [finding.code for finding in found] == [code]
    items = (f"{row['error']} = {float(row['value']):.2g}" for row in found[0].items if "error" in row)
    told = f"{found[0].message}; {', '.join(items)}"
    for word in words:
        assert word in told
    # values that are shifted by more than U, or any of a gross fault
    assert bool(found[0].harm) == (CODES[code].harm is not Harm.NEVER)
    return found[0]


@pytest.mark.slow
@pytest.mark.parametrize("noise", NOISE)
def test_sound_recordings_are_left_alone(noise):
    """Each test keeps a risk of about 1e-3: of 6 recordings one finding is rare, two are not to be had."""
    stated = study(noise=noise)
    made = experiment(stated)
    alarms = 0
    for seed in range(6):
        sound = simulate(made, np.random.default_rng([21, seed])).recording
        alarms += bool(named(sound, problem(stated)))
    assert alarms <= 1


def test_missing_readings_are_no_fault():
    assert named(recording(disturbances=Disturbances(dropouts=0.1))) == []


@pytest.mark.parametrize("lost", [slice(300, None), slice(0, 2400)])
def test_accelerometers_that_are_silent_for_long_are_no_fault(lost):
    """Their innovations in a ninth of the recording are white; what was not measured is neither too even nor uneven."""
    made = recording()
    made.acc[lost] = np.nan
    assert named(made) == []


@pytest.mark.parametrize(
    ("rows", "how"), [(-3, "3 rows earlier"), (-1, "1 row earlier"), (2, "2 rows later")]
)
def test_a_shifted_command_log(rows, how):
    made = recording()
    only(named(replace(made, rate=np.roll(made.rate, rows, axis=0))), "command_shift", how)


@pytest.mark.slow
def test_commands_that_act_late_by_one_row_or_by_a_part_of_it():
    only(named(recording(disturbances=Disturbances(command_delay=0.2))), "command_shift", "1 row earlier")
    only(named(recording(disturbances=Disturbances(command_delay=0.02))), "command_shift", "20 ms later")


def test_a_command_log_that_lost_rows_is_shifted_from_there_on():
    made = recording()
    rate = np.delete(made.rate, [880, 881], axis=0)
    n = len(rate) + 1
    short = replace(made, t=made.t[:n], th=made.th[:n], acc=made.acc[:n], rate=rate)
    found = only(named(short), "command_shift", "2 rows earlier")
    first = int(found.where.split()[1].split("-")[0])
    assert abs(first - 881) <= 10  # seen at row 900 where the turn changes, placed by the drift before that


@pytest.mark.parametrize(
    ("order", "code", "words"),
    [
        ([1, 0, 2], "channel_swap", ["acc_x looks like acc_y", "acc_y looks like acc_x"]),
        ([1, 2, 0], "channel_swap", ["acc_z looks like acc_x"]),
    ],
)
def test_exchanged_accelerometers(order, code, words):
    made = recording()
    only(named(replace(made, acc=made.acc[:, order])), code, *words)


def test_a_reversed_accelerometer():
    made = recording()
    only(named(replace(made, acc=made.acc * [1.0, 1.0, -1.0])), "sign_suspect", "acc_z looks reversed")


def test_an_encoder_that_stands_still_for_a_while():
    made = recording()
    made.th[300:340, 2] = made.th[300, 2]
    found = only(named(made), "stuck_encoder", "th_z stands still", "7.8 deg")
    assert found.where == "rows 302-340"


def test_an_encoder_that_loses_counts():
    made = recording()
    lost = made.th[1020, 0] - made.th[1000, 0]
    made.th[1000:1020, 0] = made.th[1000, 0]
    made.th[1020:, 0] -= lost
    found = only(named(made), "stuck_encoder", "th_x stands still", "wrong from then on")
    assert found.where == "rows 1002-1021"


@pytest.mark.parametrize("commands_too", [True, False])
def test_rows_that_are_missing_without_a_gap_in_time(commands_too):
    made = recording()
    keep = np.delete(np.arange(len(made.t)), range(400, 405))
    rate = np.delete(made.rate, range(400, 405), axis=0) if commands_too else made.rate[: len(keep) - 1]
    short = replace(made, t=made.t[: len(keep)], th=made.th[keep], acc=made.acc[keep], rate=rate)
    found = only(named(short), "gap", "5 rows missing")
    assert ("the commands have them" in found.message) != commands_too
    assert found.where == "row 401"


def test_single_readings_far_off():
    made = recording()
    made.th[1500, 1] += 0.01
    made.acc[700, 2] += 0.05
    made.acc[1200, 0] -= 0.05
    found = only(named(made), "outlier", "3 readings", "acc_x, acc_z, th")
    assert found.where == "rows 701, 1201, 1501"


def test_two_faults_at_once_are_both_named():
    made = recording()
    made.th[300:340, 2] = made.th[300, 2]
    found = named(replace(made, acc=made.acc[:, [1, 0, 2]]))
    assert {finding.code for finding in found} == {"channel_swap", "stuck_encoder"}


@pytest.mark.slow
def test_an_unmodelled_turn_of_the_base():
    truth = TRUTH.copy()
    truth[21:] = 5.0 * ARCSEC
    found = only(
        named(recording(truth=truth)), "unmodelled", "beta_x = 5", "beta_z = ", 'states = "extended"'
    )
    assert "kg1" not in found.message


@pytest.mark.slow
def test_unmodelled_gyro_scale_errors():
    truth = TRUTH.copy()
    truth[18:21] = [0.0, -20.0 * PPM, 20.0 * PPM]
    only(named(recording(truth=truth)), "unmodelled", "gyros have scale errors", "kg1_y = -2", "kg1_z = ")


@pytest.mark.slow
def test_sensors_turned_on_the_platform():
    """The encoders tell the attitude of the joint, the accelerometers stand 5 arcsec off it about each axis."""
    made = recording()
    turn = exp(-5.0 * ARCSEC * np.ones(3))
    turned = replace(made, acc=rotate(turn, made.acc), rate=rotate(turn, made.rate))
    found = only(
        named(turned), "unmodelled", "turned on the platform", "gamma_x = 5", "gamma_y = ", "gamma_z = "
    )
    assert "beta" not in found.message


def test_the_extended_model_has_nothing_left_to_name():
    truth = TRUTH.copy()
    truth[18:] = [0.0, -20.0 * PPM, 20.0 * PPM, *(5.0 * ARCSEC * np.ones(3))]
    extended = study(truth=truth)
    extended = replace(extended, filter=replace(extended.filter, extended=True))
    assert named(recording(truth=truth), problem(extended)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("latitude", "seen"), [(41.0, "latitude 41.0"), (-40.0, "latitude -40.0")])
def test_a_latitude_that_is_not_that_of_the_site(latitude, seen):
    site = replace(study().site, latitude=latitude * DEG)
    only(named(recording(site=site)), "site_suspect", seen, "stated is 40.00 deg")


@pytest.mark.slow
def test_a_heading_that_is_not_that_of_the_base():
    only(named(recording(base=Base(heading=1.0 * DEG))), "unmodelled", "beta_y = 3.5e+03", "heading")


@pytest.mark.slow
def test_an_encoder_with_a_periodic_error():
    other = Disturbances(harmonics=(EncoderHarmonic("x", 8, 3.0 * ARCSEC, 0.5),))
    only(named(recording(disturbances=other)), "unmodelled", "th_x errs periodically", "8 periods a turn")


@pytest.mark.parametrize(
    ("level", "factor", "code", "word"),
    [
        ("accelerometer", 1.5, "excess_scatter", "accelerometers: noise is 1.5"),
        ("encoder", 2.0, "excess_scatter", "encoders: noise is 1.99"),
        ("accelerometer", 0.5, "low_scatter", "accelerometers: noise is only 0.5"),
        ("encoder", 0.5, "low_scatter", "encoders: noise is only 0.5"),
    ],
)
def test_noise_that_is_not_what_is_stated(level, factor, code, word):
    noise = replace(PROBLEM.noise, **{level: getattr(PROBLEM.noise, level) / factor})
    only(named(recording(), replace(PROBLEM, noise=noise)), code, word)


@pytest.mark.slow
def test_gyros_that_are_much_noisier_than_stated():
    noisy = replace(PROBLEM.noise, angle_random_walk=100.0 * PROBLEM.noise.angle_random_walk)
    only(named(recording(noise_of=noisy)), "excess_scatter", "angle random walk looks about")


def test_what_no_fault_explains_is_said_with_its_place():
    made = recording()
    made.acc[1000:1300, 1] += 2e-3 * np.sin(np.arange(300) / 7.0)
    found = only(named(made), "contradiction")
    first, last = (int(row) for row in found.where.split()[1].split("-"))
    assert first < 1302
    assert last > 1001


def test_a_filter_that_fails_on_a_sound_recording_is_told_from_the_recording():
    made = recording()
    wrong = replace(estimate(made, PROBLEM), kind="svd-qukf", converged=False)
    only(diagnose(made, PROBLEM, wrong), "filter_fails", "svd-qukf")


def test_nothing_is_sought_beyond_what_the_reading_found():
    made = recording()
    swapped = replace(
        made,
        acc=made.acc[:, [1, 0, 2]],
        findings=(Finding("channel_swap", "acc_x and acc_y look exchanged"),),
    )
    assert named(swapped) == []
