"""inercal: calibrate inertial instruments, and say how sure one can be of every number.

This page defines the words. Nothing here computes. In Python, ``import inercal as ic`` brings one verb for each task:
``ic.read``, ``ic.record``, ``ic.study``, ``ic.calibrate``, ``ic.runs``, ``ic.simulate``, ``ic.design``,
``ic.sensitivity``, ``ic.allan``, ``ic.temperature``, ``ic.compare``, ``ic.apply``, ``ic.load``, ``ic.keep``,
``ic.history``, ``ic.batch``; each has an example in its ``help``.

Frames, signs, units
    SI and radians inside. Another unit is written into a name (``bias_deg_per_h``) or beside a number at the
    edge (files, command line, reports). The unit g is 9.80665 m/s^2; local gravity belongs to a site.
    ``C_ab`` and ``q_ab`` take components in b to components in a; adjacent letters match: ``C_ab @ v_b``.
    Quaternions are scalar first, Hamilton; q and -q are one attitude. Frames: i inertial, n of the site (with
    z up where nothing else is said), b of the instrument (z along the input axis of
    accelerometer z, y in the plane of those of y and z). Accelerometers read specific force: +g up at rest. Batch
    axes lead.

Instruments, forward: truth to indication
    triad          y = S M x + b: S scale factors, M unit-diagonal misalignment, b the output at zero input
    accelerometers K1_i, M_ij, K0_i; gyro S_i, T_ij, D_F_i and g-sensitive drift G_ij
    by table angle K2_i, K3_i, cross terms; gyrowheels k_i, DX_F, DX_X .. DX_YZ
    (`inercal.foundation.instruments.by_angle`)

Rigs: chains of joints, fixed transforms and elementary errors, base first (`inercal.foundation.rigs.chain.Chain`)
    turntables     n is north, west, up; C_nb = M_1 M_2 ... M_m; a = [0 0 -1] C_nb, omega = earth rate C_nb
    errors         dphi positioning, dalpha wobble, deps perpendicularity, dtheta mounting, dbase levelling, azimuth;
                   scope sample, position, run or rig: how long a value lasts

    gimbals        th_x outer, th_y inner, th_z platform; frame b of the encoders, p of the platform; q_bp(th);
                   at zero angles p lies along north-up-east (or as the study says);
                   `inercal.systems.selfcal.platform.rig`

Self-calibration: what a platform finds out about itself (`inercal.systems.selfcal.platform.coefficients`)
    rate           w_Ip^p = w_c + M w_c + kg0, M from ds, do (kg1); w_c commanded, kg0 gyro bias
    accelerometers ka0 bias, ka1 scale error, eta misalignments pz, oy, oz; beta base against encoders

Angle of attack: a model on a sting in a wind tunnel (`inercal.systems.aoa.fusion.model`)
    body           x forward, y left, z up, about the pivot; theta nose-up pitch, w = theta', phi roll right wing down
    accelerometer  at (r, 0, z), lambda from +x towards -z: reads g sin(theta - lambda) at rest; gyro nose-up positive
    errors         b_i, b_g biases; dr_i, zo_i of the positions; k_g gyro scale; tau_g gyro delay
    alpha, beta    of the flow: theta only without roll, yaw and flow angularity (`inercal.systems.aoa.angles`)

Records: labelled columns (`inercal.foundation.records.record.Record`)
    IMU            t, acc_x acc_y acc_z, gyro_x gyro_y gyro_z, temperature
    turntable      position or t, phi1 phi2 (phi3), y_x y_y or the IMU's; rate in a rate test
    selfcal        t, wc_x.. or gyro_x.., th_x.., acc_x..; q_ref_0.. the true attitude
    aoa            t, a1 .. an, gyro, gyro_roll, gyro_yaw, point, trigger, theta_ref

Uncertainty
    u standard, U = k u expanded for 95.45 % (k from Student's t), type A from scatter, type B from elsewhere;
    an `inercal.foundation.results.result.Estimate` carries values, covariance, degrees of freedom, status and budget.

Map, lower floors first; each imports only from those above its own line
    foundation: what all share
    addresses, arrays,         addresses without secrets; the type of arrays; what goes wrong; files that a result
    errors, inputs             rests on
    findings, units            what is said of a recording or result, and the verdict; texts with units
    keys                       what a study says of a field of settings: key, unit, default, bounds, meaning
    geometry                   rotations, earth, site
    instruments                terms, triad, polynomial, by_angle, noise, dsi
    records                    record, column, channels, maps, read, write, checks, dwells
    rigs                       chain, patterns, tables, plans, outputs
    computing                  runs, executors, cluster
    inference                  least_squares, variances, consistency, identifiability, hypotheses, effects; kernels:
                               sigma_point, kalman
    results                    result, basis, budget, files, remarks, repeat, compare, shown
    noise                      deviation, coefficients, running, outcome; dwell_means for the means of a calibration
    sensitivities              exact, sampled, local, dense, averages
    designs                    criteria, exchange, search, tolerances, foresight

    examples                   recordings that ship

    systems: contract (what a system offers), listed (all of them), and a room for each
    imu                        sections (cutting, problem, moves, calibration, shorthands), ferraris, aided,
                               temperature, task
    strapdown                  model (coefficients, samples, kernels), fit (rests, batch, error_state), before (bounds,
                               design), noise (restricted, left_out, considered), result, simulate, task
    turntable                  sensitivity, design, drift and rate calibration: model, regression, simulate, task
    selfcal                    platform (rig, plan, model), filters (error_state, quaternion, gimbal, batch),
                               before (bounds, observability, path_design, simulate), diagnosis, result, task
    aoa                        layout, motion, simulate; reading, fusion (model, loop, smoother), paper (static, lever,
                               frequency), reference, diagnosis, result, task

    faces: what people and programs meet
    convert                    calibrations applied; to and from imu_tk, imucal, kalibr, psins
    studies, report            files people write; pages people read
    stream                     line in, line out; state saved and resumed
    validate                   cases with published or closed-form numbers, run by `inercal validate`
    python                     the verbs of Python, and the results that they give back

    laboratory                 results kept in a store: database, keep, catalog, check; history, certificates
    fleet                      many units of one make: manifest, unit, batch, fleet

    bench: a measurement while it runs, and the commands in a browser
    live                       an instrument by wire: sources, frames, sinks, a measurement that runs
    workbench                  sessions, jobs, a page each, REST

    cli                        a module for each command or family of them
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from inercal.faces.python.calibrations import apply as apply
    from inercal.faces.python.calibrations import compare as compare
    from inercal.faces.python.calibrations import load as load
    from inercal.faces.python.recordings import read as read
    from inercal.faces.python.recordings import record as record
    from inercal.faces.python.result import Result as Result
    from inercal.faces.python.study import Study as Study
    from inercal.faces.python.study import study as study
    from inercal.faces.python.verbs import allan as allan
    from inercal.faces.python.verbs import calibrate as calibrate
    from inercal.faces.python.verbs import design as design
    from inercal.faces.python.verbs import runs as runs
    from inercal.faces.python.verbs import sensitivity as sensitivity
    from inercal.faces.python.verbs import simulate as simulate
    from inercal.faces.python.verbs import temperature as temperature
    from inercal.foundation.errors import CalibrationError as CalibrationError
    from inercal.foundation.errors import InputError as InputError
    from inercal.foundation.records.record import Record as Record
    from inercal.foundation.results.result import Estimate as Estimate
    from inercal.laboratory.fleet.batch import batch as batch
    from inercal.laboratory.verbs import history as history
    from inercal.laboratory.verbs import keep as keep

__version__ = "0.2.0"

#: public name -> module that defines it; resolved when first asked for (PEP 562), so that importing is quick
_WHERE = {
    name: f"inercal.{module}"
    for module, names in {
        "faces.python.calibrations": ("apply", "compare", "load"),
        "faces.python.recordings": ("read", "record"),
        "faces.python.result": ("Result",),
        "faces.python.study": ("Study", "study"),
        "faces.python.verbs": (
            "allan",
            "calibrate",
            "design",
            "runs",
            "sensitivity",
            "simulate",
            "temperature",
        ),
        "foundation.errors": ("CalibrationError", "InputError"),
        "foundation.records.record": ("Record",),
        "foundation.results.result": ("Estimate",),
        "laboratory.fleet.batch": ("batch",),
        "laboratory.verbs": ("history", "keep"),
    }.items()
    for name in names
}

__all__ = sorted(_WHERE)


def __getattr__(name: str) -> object:
    """Resolve a public name."""
    if name not in _WHERE:
        raise AttributeError(f"module 'inercal' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    """The public names."""
    return [*__all__, "__version__"]
