"""An IMU on a two-axis table whose angles are recorded beside its outputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import inercal as ic

from . import sample_faults as shared
from .means import triad
from .samples import World, mems, progress
from .trial import ARCSEC, DEG, EARTH_RATE, G0, Act, Array, Case, columns_of, log_uniform, turn

GRAVITY, GRAVITY_U = 9.80938, 2e-5
RATE = 50.0
MOVES = (  # joint, angle [deg], one after the other, a rest before each
    (2, 360), (1, 90), (2, 90), (2, 90), (2, 90), (2, 90), (1, 360), (2, 90), (1, 360), (1, 90), (2, 360), (1, -180),
    (2, -360),
)  # fmt: skip


@dataclass(frozen=True)
class Table:
    """A test, drawn; ``errors`` are deps_x, deps_y, dbase_x, dbase_y [rad], of the standard deviation ``table``."""

    truth: dict[str, float]
    errors: Array
    table: float
    rest: float
    speed: float
    azimuth: float
    azimuth_error: float
    k2: Array
    noise: tuple[float, float]
    encoder: float
    gravity: float
    latitude: float
    clock: float
    seed: int

    def plan(self) -> tuple[Array, Array, Array, Array]:
        """Begins and times of the moves, the time stamps, and the two angles at any of them by a function's table."""
        times = np.array([max(1.5, 1.9 * abs(angle) * DEG / self.speed) for _, angle in MOVES])
        times = np.round(times * RATE) / RATE
        begins = self.rest + np.cumsum(np.concatenate([[0.0], (times + self.rest)[:-1]]))
        t = np.arange(1, round((begins[-1] + times[-1] + self.rest) * RATE) + 1) / RATE
        return begins, times, t, np.array(MOVES, float)

    def angles(self, t: Array) -> Array:
        """The angles (n, 2) of the joints."""
        begins, times, _, moves = self.plan()
        found = np.zeros((len(t), 2))
        for (joint, angle), begin, time in zip(moves, begins, times, strict=True):
            found[:, int(joint) - 1] += angle * DEG * progress((t - begin) / time)[0]
        return found

    def attitude(self, t: Array, world: World) -> Array:
        """Table's innermost axes in north, west, up."""
        joints = self.angles(t)
        for change in world.plan.on_angles:
            joints = change(t, joints)
        deps_x, deps_y, base_x, base_y = world.plan.errors
        sag = world.plan.sag * np.cos(joints[:, 0])
        heading = self.azimuth + self.azimuth_error + world.plan.heading
        found = turn("z", heading) @ turn("x", base_x) @ turn("y", base_y) @ turn("y", joints[:, 0] + sag)
        return np.asarray(found @ turn("x", deps_x) @ turn("y", deps_y) @ turn("z", joints[:, 1]))

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The recording with a fault."""
        begins, times, t, _ = self.plan()
        k = np.searchsorted(begins, t - 0.5 / RATE, side="right") - 1
        moving = (k >= 0) & (t - 0.5 / RATE < begins[k] + times[k])
        plan = SimpleNamespace(
            errors=self.errors.copy(), heading=0.0, sag=0.0, on_angles=[], on_encoders=[], encoder_clock=0.0
        )
        world = World(
            t, np.where(moving, k, -1), np.where(moving, -1, k + 1), np.zeros(len(t), int), self.truth,
            np.random.default_rng(self.seed), self.noise, self.k2, self.gravity, plan, self.clock,
        )  # fmt: skip
        if act:
            act(world, size)
        world.make(*self.felt(t, lambda time: self.attitude(time, world), self.gravity))
        # an angle stands beside the mean of the samples about it, half a sample before the stamp
        seen = self.recorded(t - 0.5 / RATE, plan)
        seen = seen + self.encoder * np.random.default_rng(self.seed + 5).normal(size=seen.shape)
        rows, stamps = world.rows()
        record = ic.record(
            t=stamps, acc=world.acc[rows], gyro=world.gyro[rows], phi1=seen[rows, 0] / DEG, phi2=seen[rows, 1] / DEG,
            units={"phi1": "deg", "phi2": "deg"},
        )  # fmt: skip
        f, w = self.felt(t, lambda time: self.believed(time, plan), GRAVITY)

        def misses(truth: Mapping[str, float]) -> Array:
            """Outputs less those at the recorded angles, over the white noise."""
            offset, drift = (np.array([truth[f"{name}_{a}"] for a in "xyz"]) for name in ("K0", "D_F"))
            force = (world.acc - f @ triad(truth, "K1", "M").T - offset) / self.noise[0]
            rate = (world.gyro - w @ triad(truth, "S", "T").T - drift) / self.noise[1]
            return np.concatenate([force.ravel(), rate.ravel()])

        return Case(
            record, self.study(), self.truth, misses(self.truth), lambda: columns_of(misses, self.truth)
        )

    def recorded(self, t: Array, plan: SimpleNamespace) -> Array:
        """The angles (n, 2) that the encoders tell, without their noise."""
        found = self.angles(t * (1 + plan.encoder_clock))
        for change in plan.on_encoders:
            found = change(t, found)
        return np.asarray(found)

    def believed(self, t: Array, plan: SimpleNamespace) -> Array:
        """The attitude of a perfect table at these angles."""
        joints = self.recorded(t, plan)
        return np.asarray(turn("z", self.azimuth) @ turn("y", joints[:, 0]) @ turn("z", joints[:, 1]))

    def felt(self, t: Array, attitude: Callable[[Array], Array], gravity: float) -> tuple[Array, Array]:
        """Mean force and rate (n, 3) over the samples that end at t."""
        step = 1 / RATE
        before, after, middle = (attitude(time) for time in (t - step, t, t - step / 2))
        change = Rotation.from_matrix(np.swapaxes(before, 1, 2) @ after).as_rotvec() / step
        earth = EARTH_RATE * np.array([np.cos(self.latitude), 0.0, np.sin(self.latitude)])
        up = (before[:, 2] + 4 * middle[:, 2] + after[:, 2]) / 6
        return gravity * up, change + np.einsum("nji,j->ni", middle, earth)

    def study(self) -> Any:
        """The study, with all that is stated."""
        u = {"normal": f"{self.table / ARCSEC:.6g} arcsec"}
        return ic.study(
            "imu",
            site={"gravity": f"{GRAVITY} ± {GRAVITY_U} m/s^2", "latitude": f"{self.latitude / DEG:.8g} deg"},
            imu={
                "method": "aided",
                "time_base": "20 ppm",
                "aided": {
                    "mounting": ["+x", "+y", "+z"],
                    "rig": {
                        "kind": "two_axis_turntable",
                        "base": {"azimuth": f"{self.azimuth / DEG:.6g} ± 0.1 deg"},
                        "errors": {"deps_x": u, "deps_y": u, "dbase_x": u, "dbase_y": u},
                    },
                },
            },
        )


def draw(rng: np.random.Generator) -> Table:
    """A test, all inputs within their stated uncertainty."""
    table = ARCSEC * log_uniform(rng, 2, 30)
    grade = log_uniform(rng, 0.03, 1.0)
    noise = (
        G0 * 1e-4 * grade * np.sqrt(RATE),
        0.3 * grade * DEG / 60 * np.sqrt(RATE),
    )
    return Table(
        mems(rng, full=True), table * rng.normal(size=4), table, 8.0, DEG * rng.uniform(30, 80),
        rng.uniform(-180, 180) * DEG, 0.1 * DEG * rng.normal(), np.zeros(3), noise,
        ARCSEC * log_uniform(rng, 1, 10), GRAVITY + GRAVITY_U * rng.normal(), rng.uniform(-55, 65) * DEG,
        20e-6 * rng.normal(), int(rng.integers(2**31)),
    )  # fmt: skip


def _encoder(world: World, joint: int, error: Any) -> None:
    def change(t: Array, seen: Array) -> Array:
        found = seen.copy()
        found[:, joint] += error(t, seen[:, joint])
        return found

    world.plan.on_encoders.append(change)


def eccentric_disc(world: World, size: float) -> None:
    """The inner encoder, one period a turn."""
    phase = world.pick.uniform(0, 6.28)
    _encoder(world, 1, lambda t, angle: size * np.sin(angle + phase))


def two_lobed_disc(world: World, size: float) -> None:
    """The outer encoder, two periods a turn."""
    phase = world.pick.uniform(0, 6.28)
    _encoder(world, 0, lambda t, angle: size * np.sin(2 * angle + phase))


def clocks_apart(world: World, size: float) -> None:
    """Angles of the encoders run ahead."""
    world.plan.encoder_clock += size


def arm_bends(world: World, size: float) -> None:
    """A sag of the outer axis by its angle."""
    world.plan.sag += size


def base_tilted(world: World, size: float) -> None:
    """About north and west."""
    world.plan.errors[2:] += size * world.pick.normal(size=2)


def wrong_azimuth(world: World, size: float) -> None:
    """The base heads elsewhere."""
    world.plan.heading += size


def counts_lost(world: World, size: float) -> None:
    """The outer encoder from the middle of its fast turn on."""
    begin = world.t[world.middle(6)]
    _encoder(world, 0, lambda t, angle: -size * (t > begin))


FAULTS: dict[str, tuple[float, Act]] = {
    "eccentric_disc": (1e-3, eccentric_disc),
    "two_lobed_disc": (1e-3, two_lobed_disc),
    "clocks_apart": (1e-4, clocks_apart),
    "arm_bends": (1e-3, arm_bends),
    "creeping_mount": (1e-3, shared.creeping_mount),
    "slipped_mount": (1e-3, shared.slipped_mount),
    "supply_step": (1e-3, shared.supply_step),
    "large_k2": (1e-3, shared.large_k2),
    "turns_clipped": (0.05, shared.turns_clipped),
    "unequal_senses": (1e-3, shared.unequal_senses),
    "base_tilted": (1e-3, base_tilted),
    "wrong_azimuth": (2 * DEG, wrong_azimuth),
    "weight_on_gyro": (1e-4, shared.weight_on_gyro),
    "scale_warms": (1e-2, shared.scale_warms),
    "counts_lost": (1e-3, counts_lost),
}
