"""Protocols of people who calibrate an IMU: sections by the simulated unit, and what is known before."""

from dataclasses import replace

import numpy as np
from turned_units import DEG, SIDES, Bench, Unit

from inercal.foundation.geometry.earth import Site
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.sections.section import Section

AXES = ("+x", "+y", "+z")
WHOLE = 2 * np.pi
PLACED = {"up_u": 0.3 * DEG, "axis_u": 0.3 * DEG}


def without(sections, *fields):
    """The sections without some of their outputs."""
    return [replace(s, **dict.fromkeys(fields)) for s in sections]


def of_accelerometers(sections):
    return without(sections, "gyro", "gyro_var")


def of_the_gyro(sections):
    return without(sections, "acc", "acc_var", "acc_after")


def sides(b, times=1, **said):
    return [b.rest(v, name=side, **said) for _ in range(times) for side, v in SIDES.items()]


def turns(b, angles=(WHOLE, -WHOLE), **said):
    return [
        b.turn(SIDES[side], angle, name=f"{side} {angle:.1f}", **said) for side in AXES for angle in angles
    ]


def rates(b, values=(0.5, -0.5, 1.0, -1.0), axes=AXES, rate_u=5e-4, placing=0.3 * DEG, **said):
    """Steady rates about sides, each side one setup; a rate of the table has one error."""
    errors, out = {abs(v): b.rng.normal(0, rate_u) for v in values}, []
    for side in axes:
        placed = {"actual": b.tilted(SIDES[side], placing), "vertical": b.tilted(SIDES[side], placing)}
        for v in values:
            more = {
                "rate_group": f"{abs(v)}",
                "rate_u": abs(v) * rate_u,
                "error": errors[abs(v)],
                "setup": side,
            }
            out.append(b.spin(SIDES[side], v, name=f"{side} {v}", **placed, **more, **said))
    return out


def poses(b, count, **said):
    """Rests in directions that nobody knows, all over the sphere."""
    ways = b.rng.normal(size=(count, 3))
    ways[:6] = list(SIDES.values())[: len(ways)]
    return [b.rest(b.tilted(v / np.linalg.norm(v), 0.2), told=False, **said) for v in ways]


def by_size(b):
    """Rates of known size about three axes that nobody knows, one error of each rate, and rests of no direction."""
    axes = (*AXES, "-x", "-y", "-z")
    return [*poses(b, 8), *rates(b, values=(0.5, 1.0, 2.0), axes=axes, told=False)]


def in_sessions(b, count=4):
    """Six sides in each of some sessions, between which the biases change."""
    out, unit = [], b.unit
    for day in range(count):
        shift, drift = unit.rng.normal(0, 5e-3, 3), unit.rng.normal(0, 2e-4, 3)
        here = sides(b, session=f"day {day}", **PLACED_UP)
        out += [replace(s, acc=s.acc + unit.k1 * shift, gyro=s.gyro + unit.s * drift) for s in here]
    return out


PLACED_UP = {"up_u": 0.3 * DEG}


def by_reference(b):
    """A reference accelerometer beside the unit, shaken and tilted."""
    forces = b.rng.normal(0, 6.0, (15, 3))
    rest = Section("rest", **b.variances())
    return [
        replace(rest, name=f"force {k}", force=f, acc=b.noisy(b.unit.accelerometers(f), "acc"))
        for k, f in enumerate(forces)
    ]


def northward(b):
    """Six sides with a gyro of navigation grade, the heading known within a degree."""
    out = []
    for side, v in SIDES.items():
        for heading in (0.0, 2.0):
            attitude = b.unit.stand(b.tilted(v, b.placing), heading)
            f, e = b.unit.felt(attitude)
            north = attitude.inv().apply([0.0, 1.0, 0.0])
            level = north - v * (north @ v)
            off = b.rng.normal(0, 1 * DEG)
            said = np.cos(off) * level + np.sin(off) * np.cross(v, level)
            acc, gyro = b.noisy(b.unit.accelerometers(f), "acc"), b.noisy(b.unit.gyro(e, f), "gyro")
            section = replace(b.rest(v, name=side, up_u=0.3 * DEG), acc=acc, gyro=gyro)
            out.append(replace(section, north=said / np.linalg.norm(said), north_u=1 * DEG))
    return out


def quarter_turns(b, level):
    """Turns by a quarter on a level table, accelerometers before and after."""
    out = []
    for side in AXES:
        out += [b.turn(SIDES[side], angle, level=level, axis_u=0.3 * DEG) for angle in (WHOLE / 4, WHOLE)]
    return out


def site(unit):
    return Site(unit.gravity, (), unit.latitude)


class Protocol:
    """Sections of a unit and a bench, with what is known."""

    def __init__(self, build, bench=None, unit=None, keep=lambda name: True, latitude=True, **known):
        self.build, self.bench, self.unit = build, bench or {}, unit or {}
        self.keep, self.latitude, self.known = keep, latitude, known

    def run(self, seed):
        """Unit, sections and priors of a run."""
        unit = Unit(np.random.default_rng(seed), **self.unit)
        place = site(unit) if self.latitude else Site(unit.gravity)
        return unit, self.build(Bench(unit, **self.bench)), Priors(place, **self.known)


HAND = {"upper": True}
PROTOCOLS = {
    "six sides, accelerometers": Protocol(lambda b: of_accelerometers(sides(b, **PLACED_UP))),
    "six sides, placing not stated": Protocol(lambda b: of_accelerometers(sides(b))),
    "six sides, nothing stated": Protocol(lambda b: of_accelerometers(sides(b)), {"stated": False}),
    "six sides twice, nothing stated": Protocol(lambda b: of_accelerometers(sides(b, 2)), {"stated": False}),
    "six sides, both sensors": Protocol(lambda b: sides(b, **PLACED_UP)),
    "sides and turns": Protocol(lambda b: [*sides(b, **PLACED_UP), *turns(b, (WHOLE,), **PLACED)]),
    "sides and turns both ways, placing not stated": Protocol(lambda b: [*sides(b), *turns(b)]),
    "sides and turns, nothing stated": Protocol(lambda b: [*sides(b, 2), *turns(b)], {"stated": False}),
    "sides and turns of an angle with u": Protocol(
        lambda b: [*sides(b), *turns(b, angle_u=0.2 * DEG)], clock_u=2e-5
    ),
    "quarter turns on a level table": Protocol(lambda b: [*sides(b), *quarter_turns(b, 0.02 * DEG)]),
    "quarter turns on a table level to 0.3 deg": Protocol(lambda b: [*sides(b), *quarter_turns(b, 0.3 * DEG)]),
    "rates about sides": Protocol(lambda b: [*sides(b, **PLACED_UP), *rates(b, **PLACED)]),
    "rates alone, placing not stated": Protocol(lambda b: of_the_gyro(rates(b))),
    "rates of known size": Protocol(by_size, unit=HAND),
    "twelve poses": Protocol(lambda b: of_accelerometers(poses(b, 12)), unit=HAND),
    "twenty poses, nothing stated": Protocol(lambda b: poses(b, 20), {"stated": False}, HAND),
    "turns of the gyro alone": Protocol(lambda b: of_the_gyro([*sides(b, **PLACED_UP)[:2], *turns(b, **PLACED)])),
    "four sessions": Protocol(in_sessions),
    "a reference accelerometer": Protocol(by_reference, keep=lambda name: name.startswith(("K", "M"))),
    "headings of a gyro for navigation": Protocol(
        northward, {"gyro_noise": 1e-8}, {"g_sensitivity": 1e-8, "misalignment": 1e-3}
    ),
    "latitude not known": Protocol(lambda b: [*sides(b), *turns(b)], latitude=False),
}  # fmt: skip
