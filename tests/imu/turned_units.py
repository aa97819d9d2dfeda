"""An IMU that is held, turned and spun: mean outputs of sections by finite rotations.

Nothing here is shared with the program: attitudes are those of SciPy, and what turns is integrated over small steps of
time, earth rate included.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from inercal.systems.imu.sections.section import Section

EARTH = 7.292115e-5
DEG = np.pi / 180
SIDES = {s + a: (1 if s == "+" else -1) * np.eye(3)["xyz".index(a)] for a in "xyz" for s in "+-"}


def gain(scale, off):
    """Matrix from a scale and its six misalignments xy, xz, yx, yz, zx, zy."""
    m = np.eye(3)
    m[0, 1], m[0, 2], m[1, 0], m[1, 2], m[2, 0], m[2, 1] = off
    return np.diag(scale) @ m


@dataclass
class Unit:
    """Coefficients drawn as data sheets of micromachined units say, and where it stands."""

    rng: np.random.Generator
    gravity: float = 9.81
    latitude: float = 48 * DEG
    misalignment: float = 5e-3
    upper: bool = False
    lower_gyro: bool = True
    k2: float = 20e-6 / 9.81
    g_sensitivity: float = 0.02 * DEG / 9.81
    truth: dict = field(init=False)

    def __post_init__(self):
        rng, pairs = self.rng, ["xy", "xz", "yx", "yz", "zx", "zy"]
        m, t = rng.normal(0, self.misalignment, (2, 6))
        if self.upper:
            m[[2, 4, 5]] = 0.0
        if not self.lower_gyro:
            t[[2, 4, 5]] = 0.0
        self.k0, self.d_f = rng.normal(0, 0.1, 3), rng.normal(0, 0.3 * DEG, 3)
        self.k1, self.s = 1 + rng.normal(0, 0.01, (2, 3))
        self.second = rng.normal(0, self.k2, 3)
        self.g = self.s[:, None] * rng.normal(0, self.g_sensitivity, (3, 3))
        self.m, self.t = m, t
        vectors = {"K0": self.k0, "K1": self.k1, "K2": self.second, "D_F": self.d_f, "S": self.s}
        self.truth = {f"{name}_{a}": v[i] for name, v in vectors.items() for i, a in enumerate("xyz")}
        self.truth |= {
            f"{name}_{pair}": v[i] for name, v in (("M", m), ("T", t)) for i, pair in enumerate(pairs)
        }
        self.truth |= {f"G_{a}{b}": self.g[i, j] for i, a in enumerate("xyz") for j, b in enumerate("xyz")}

    def accelerometers(self, f):
        """Outputs (..., 3) for specific force on the axes of the case."""
        line = f @ gain(np.ones(3), self.m).T
        return self.k0 + self.k1 * (line + self.second * line**2)

    def gyro(self, w, f):
        """Outputs (..., 3) for rate and specific force."""
        return self.d_f + w @ gain(self.s, self.t).T + f @ self.g.T

    def stand(self, up, heading=None):
        """Attitude of a case in which ``up`` points up, north along it at any heading; axes east, north, up."""
        lift = Rotation.align_vectors([[0, 0, 1]], [up])[0]
        return (
            Rotation.from_rotvec([0, 0, self.rng.uniform(-np.pi, np.pi) if heading is None else heading])
            * lift
        )

    def felt(self, attitude):
        """Specific force and earth rate (..., 3) on the axes of the case."""
        world = EARTH * np.array([0, np.cos(self.latitude), np.sin(self.latitude)])
        return attitude.inv().apply([0, 0, self.gravity]), attitude.inv().apply(world)


@dataclass
class Bench:
    """Somebody who places a unit: errors of placing, of angles and rates, and noise of means."""

    unit: Unit
    placing: float = 0.3 * DEG
    acc_noise: float = 3e-4
    gyro_noise: float = 2e-5
    stated: bool = True

    @property
    def rng(self):
        return self.unit.rng

    def tilted(self, v, by):
        """A direction placed with an error in either direction across."""
        error = self.rng.normal(0, by, 3)
        return Rotation.from_rotvec(error - v * (error @ v)).apply(v)

    def noisy(self, y, kind):
        size = self.acc_noise if kind == "acc" else self.gyro_noise
        return y + self.rng.normal(0, size, 3)

    def variances(self):
        if not self.stated:
            return {}
        return {"acc_var": np.full(3, self.acc_noise**2), "gyro_var": np.full(3, self.gyro_noise**2)}

    def rest(self, up, told=True, **more):
        """A rest on a side, or in any direction."""
        attitude = self.unit.stand(self.tilted(up, self.placing))
        f, e = self.unit.felt(attitude)
        said = {"up": up} if told else {}
        return Section(
            "rest", acc=self.noisy(self.unit.accelerometers(f), "acc"), gyro=self.noisy(self.unit.gyro(e, f), "gyro"),
            **said, **self.variances(), **more,
        )  # fmt: skip

    def turn(
        self, axis, angle, told=True, level=None, angle_u=0.0, up=None, swivel=None, duration=6.0, **more
    ):
        """A turn about an axis; up is along it where not said otherwise, ``level`` the error of its being vertical."""
        actual = self.tilted(axis, self.placing) if swivel is None else swivel
        top = axis if up is None else up
        vertical = (
            self.tilted(actual * np.sign(actual @ top), level)
            if level is not None
            else self.tilted(top, self.placing)
        )
        first = self.unit.stand(vertical)
        true = angle + self.rng.normal(0, angle_u)
        part = np.linspace(0, 1, 401)
        attitude = first * Rotation.from_rotvec(np.outer(part * true, actual))
        f, e = self.unit.felt(attitude)
        w = actual * true / duration + e
        mean = np.trapezoid(self.unit.gyro(w, f), part, axis=0)
        said = {"axis": axis, "up": top} if told else {}
        if level is not None:
            said["level_u"] = level
        before, after = (self.noisy(self.unit.accelerometers(f[k]), "acc") for k in (0, -1))
        return Section(
            "turn", acc=before, acc_after=after, gyro=self.noisy(mean, "gyro"),
            angle=angle, angle_u=angle_u, duration=duration, **said, **self.variances(), **more,
        )  # fmt: skip

    def spin(
        self,
        axis,
        rate,
        actual=None,
        up=None,
        vertical=None,
        rate_u=0.0,
        error=0.0,
        level=None,
        told=True,
        **more,
    ):
        """A steady rate about an axis over whole turns; ``actual`` and ``vertical`` are placing drawn before."""
        actual = self.tilted(axis, self.placing) if actual is None else actual
        top = axis if up is None else up
        if vertical is None:
            vertical = (
                self.tilted(actual * np.sign(actual @ top), level)
                if level is not None
                else self.tilted(top, self.placing)
            )
        part = np.linspace(0, 2 * np.pi, 720, endpoint=False)
        attitude = self.unit.stand(vertical) * Rotation.from_rotvec(np.outer(np.sign(rate) * part, actual))
        f, e = self.unit.felt(attitude)
        mean = self.unit.gyro(actual * rate * (1 + error) + e, f).mean(axis=0)
        said = {"axis": axis, "up": top} if told else {}
        if level is not None:
            said["level_u"] = level
        if not told:  # accelerometers tell which way is up
            said["acc"] = self.noisy(self.unit.accelerometers(f).mean(axis=0), "acc")
        said |= self.variances()
        gyro = self.noisy(mean, "gyro")
        return Section("rate", gyro=gyro, rate=rate, rate_u=rate_u, **said, **more)
