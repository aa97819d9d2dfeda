"""A platform in three gimbals with what ordinary rigs do wrong, in plain NumPy: it shares no code with the product.

Frame n is north, up, east: earth rate (cos L, sin L, 0), gravity along -up. At zero angles the axes of p are those of
n, the outer joint turns about Z_p, the inner one about X_p, that of the platform about Y_p. p is that of the
accelerometers: X_p along the first, Y_p in the plane of the first two. Attitudes are matrices C_np that take components
in p to n.

The platform is driven by its gyros: in inertial space it turns at w + M w + kg0 + noise, w the rate commanded (or read,
for a system that measures it). Its base carries the outer joint; the encoders read what angles the gimbals then have,

    C_bp = Z(th_x) Y(n_xy) X(th_y) Z(n_yz) Y(th_z) R(gamma) R(sag),   an encoder reads th + zero,

n_xy, n_yz the non-orthogonality of outer and inner, inner and platform axis; gamma the turn of the sensors on the
platform; sag its elastic turn under an unbalanced mass on Y_p. A delay is positive where a sensor is late: what it
logs at t is of t less the delay. All in SI and rad.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np

EARTH = 7.292115e-5
LATITUDE = np.radians(40.0)
GRAVITY = 9.801691  # normal gravity of WGS 84 at 40 degrees, to 1 ppm
G = 9.80665
ARCSEC, DEG_H, UG, PPM = np.pi / 648000.0, np.pi / 648000.0, 1e-6 * G, 1e-6
DEG_ROOT_H = np.pi / 180.0 / 60.0

NAMES = [
    f"{group}_{end}"
    for group, ends in (
        ("kg0", "x y z"), ("eta", "pz oy oz"), ("ds", "x y z"), ("do", "x y z"), ("ka0", "x y z"), ("ka1", "x y z"),
    )
    for end in ends.split()
]  # fmt: skip
TRUTH = np.concatenate(
    [
        DEG_H * np.array([0.08, -0.06, 0.10]),
        ARCSEC * np.array([60.0, -90.0, 120.0]),
        ARCSEC * np.array([60.0, -45.0, 90.0]),
        ARCSEC * np.array([-75.0, 50.0, -100.0]),
        UG * np.array([100.0, -150.0, 200.0]),
        PPM * np.array([500.0, -300.0, 800.0]),
    ]
)
"""The 18 coefficients of the paper, in the order of `NAMES`, misalignments of accelerometers inside the bracket."""
PRIOR = np.repeat([0.3 * DEG_H, 300 * ARCSEC, 300 * ARCSEC, 300 * ARCSEC, 500 * UG, 1500 * PPM], 3)

PAPER = (("z", 180.0), ("x", 90.0), ("z", -180.0), ("x", 90.0))
BEST = (("x", -90.0), ("z", -210.0), ("x", -60.0), ("z", 90.0), ("x", -90.0))
THREE = (
    ("x", -90.0), ("y", 50.0), ("z", -210.0), ("y", -100.0), ("x", -60.0), ("z", 90.0), ("y", 50.0), ("x", -90.0),
)  # fmt: skip
"""Turns as joint and angle [deg]; the last path turns all three joints."""


@dataclass(frozen=True)
class Noise:
    """Of the gyros [rad/sqrt(s)], of a sample of an accelerometer [m/s^2] and of an encoder [rad]."""

    walk: float = 5e-4 * DEG_ROOT_H
    accelerometer: float = 10 * UG
    encoder: float = 2 * ARCSEC


NOMINAL, LOW = Noise(), Noise(1e-4 * DEG_ROOT_H, 1 * UG, 0.5 * ARCSEC)


def three() -> np.ndarray:
    """Nothing, of each of three axes."""
    return np.zeros(3)


@dataclass(frozen=True)
class Faults:
    """Sizes of faults; nothing is wrong by default.

    ``zero`` (3,) of the encoders [rad]; ``non_orthogonality`` (2,) [rad]; ``base`` (3,) the turn of the base about n
    that nobody states [rad]; ``k2`` (3,) of A (f + K2 f^2) [1/(m/s^2)]; ``asymmetry`` (3,) of the scale, S (1 +- a/2);
    ``harmonics`` joint, order, amplitude [rad], phase; delays [s]; ``flicker`` [m/s^2] of the accelerometers and
    ``gyro_flicker`` [rad/s], the level of the Allan deviation's floor; ``walk`` and ``gyro_walk`` of their biases
    [unit/sqrt(s)]; ``levers`` (3, 3) of the accelerometers about the gimbals' centre in p, a row each [m]; ``gravity``
    relative, ``latitude`` [rad] beyond what is stated; ``warming`` [K] from begin to end, linear, with ``bias_by_k``
    [m/s^2/K], ``gyro_by_k`` [rad/s/K] and ``scale_by_k`` [1/K]; ``sag`` [rad/g]; ``g_sensitivity`` [rad/s/g] of each
    gyro along its own axis; ``sway`` [rad] and ``sway_frequency`` [Hz] of the base about north and east; ``jitter`` [s]
    of the stamps; ``quantum`` [rad] of the encoders, ``acc_quantum`` [m/s^2]; ``servo`` [rad/s] random rate of the
    drive at each row, which is commanded (or read) like the rest; ``gaps`` as first and last second without rows;
    ``lost`` share of rows without numbers; ``gyro_scale`` (3,).
    """

    gamma: np.ndarray = field(default_factory=three)
    zero: np.ndarray = field(default_factory=three)
    non_orthogonality: np.ndarray = field(default_factory=lambda: np.zeros(2))
    base: np.ndarray = field(default_factory=three)
    k2: np.ndarray = field(default_factory=three)
    asymmetry: np.ndarray = field(default_factory=three)
    gyro_scale: np.ndarray = field(default_factory=three)
    harmonics: tuple[tuple[int, int, float, float], ...] = ()
    delay_encoder: float = 0.0
    delay_accelerometer: float = 0.0
    delay_gyro: float = 0.0
    flicker: float = 0.0
    gyro_flicker: float = 0.0
    walk: float = 0.0
    gyro_walk: float = 0.0
    levers: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    gravity: float = 0.0
    latitude: float = 0.0
    warming: float = 0.0
    bias_by_k: np.ndarray = field(default_factory=three)
    gyro_by_k: np.ndarray = field(default_factory=three)
    scale_by_k: np.ndarray = field(default_factory=three)
    sag: float = 0.0
    g_sensitivity: float = 0.0
    sway: float = 0.0
    sway_frequency: float = 0.3
    jitter: float = 0.0
    quantum: float = 0.0
    acc_quantum: float = 0.0
    servo: float = 0.0
    gaps: tuple[tuple[float, float], ...] = ()
    lost: float = 0.0

    def __add__(self, other: Faults) -> Faults:
        """Both together: what the other leaves as it is by default stays."""
        nothing = Faults()
        changed = {
            each.name: getattr(other, each.name)
            for each in fields(Faults)
            if not np.array_equal(np.asarray(getattr(other, each.name), dtype=object),
                                  np.asarray(getattr(nothing, each.name), dtype=object))
        }  # fmt: skip
        return replace(self, **changed)


@dataclass(frozen=True)
class Drive:
    """A path: ``turns`` at ``rate`` [rad/s], reached and left within ``ramp`` [s], rests of ``rest`` [s] between them,
    rows every ``step`` [s]. A system that is ``measured`` logs what its gyros read, another what it commands."""

    turns: tuple[tuple[str, float], ...] = PAPER
    rate: float = np.radians(1.0)
    ramp: float = 0.0
    rest: float = 0.0
    step: float = 0.2
    measured: bool = False
    fine: int = 5
    """Steps of the integration between two rows."""

    def spans(self):
        """Begin, duration, joint and angle [rad] of each turn, and the end of all."""
        t, out = 0.0, []
        for joint, degrees in self.turns:
            angle = np.radians(degrees)
            lasts = np.ceil((abs(angle) / self.rate + self.ramp) / self.step - 1e-9) * self.step
            out.append((t, lasts, "xyz".index(joint), angle))
            t += lasts + np.ceil(self.rest / self.step - 1e-9) * self.step
        return out, t

    def angles(self, t: np.ndarray) -> np.ndarray:
        """Nominal angles (..., 3) [rad] at times [s]: trapezoids of rate."""
        th = np.zeros((*t.shape, 3))
        for begin, lasts, joint, angle in self.spans()[0]:
            top = angle / (lasts - self.ramp)
            s = np.clip(t - begin, 0.0, lasts)
            up, down = np.minimum(s, self.ramp), np.maximum(s - (lasts - self.ramp), 0.0)
            r = max(self.ramp, 1e-12)
            th[..., joint] += top * (s - up + 0.5 * up**2 / r - 0.5 * down**2 / r)
        return th


def turned(v: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    K = np.zeros((*v.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    K -= np.swapaxes(K, -1, -2).copy()
    half = 0.5 * angle
    s, h = np.sinc(angle / np.pi), np.sinc(half / np.pi)
    return np.eye(3) + s * K + 0.5 * h**2 * (K @ K)


def about(axis: int, angle) -> np.ndarray:
    """Rotation matrices about one axis."""
    angle = np.asarray(angle, float)
    return turned(angle[..., None] * np.eye(3)[axis])


def running_product(C: np.ndarray) -> np.ndarray:
    """C_0, C_0 C_1, C_0 C_1 C_2, ... of matrices (n, 3, 3), by doubling."""
    C, by = C.copy(), 1
    while by < len(C):
        C[by:] = C[:-by] @ C[by:]
        by *= 2
    return C


def vee(C: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3) of matrices that turn by far less than half a circle."""
    v = 0.5 * np.stack(
        [C[..., 2, 1] - C[..., 1, 2], C[..., 0, 2] - C[..., 2, 0], C[..., 1, 0] - C[..., 0, 1]], -1
    )
    sine = np.linalg.norm(v, axis=-1)[..., None]
    return v / np.sinc(np.arcsin(np.minimum(sine, 1.0)) / np.pi)


def joints(th: np.ndarray) -> np.ndarray:
    """Axes of the joints in p (..., 3, 3), as columns."""
    back = np.swapaxes(about(1, th[..., 2]), -1, -2)
    inner = back @ np.swapaxes(about(0, th[..., 1]), -1, -2)
    y = np.broadcast_to([0.0, 1.0, 0.0], th.shape)
    return np.stack([inner[..., :, 2], back[..., :, 0], y], axis=-1)


def gimballed(th: np.ndarray, faults: Faults, up_p: np.ndarray) -> np.ndarray:
    """C_bp (n, 3, 3) at true angles of the gimbals; ``up_p`` (n, 3) specific force over g in p, for the sag."""
    n_xy, n_yz = faults.non_orthogonality
    a, b, c = np.moveaxis(th, -1, 0)
    chain = about(2, a) @ about(1, n_xy) @ about(0, b) @ about(2, n_yz) @ about(1, c) @ turned(faults.gamma)
    if faults.sag == 0.0:
        return chain
    return chain @ turned(faults.sag * np.cross([0.0, 1.0, 0.0], up_p))


def encoder_angles(C_bp: np.ndarray, near: np.ndarray, faults: Faults, up_p: np.ndarray) -> np.ndarray:
    """True angles (n, 3) of the gimbals at attitudes (n, 3, 3), from those ``near`` (n, 3) by Newton's steps."""
    th = near.copy()
    for _ in range(6):
        miss = vee(np.swapaxes(gimballed(th, faults, up_p), -1, -2) @ C_bp)
        th = th + np.linalg.solve(joints(th), miss[..., None])[..., 0]
    return th


def flicker(rng: np.random.Generator, level: float, step: float, n: int, axes: int = 3) -> np.ndarray:
    """1/f noise (n, axes) whose Allan deviation has its floor at ``level``: first-order processes an octave apart.

    A sum of processes of equal variance and correlation times an octave apart has a spectrum near 1/f; that of one is
    flat to its corner. The Allan deviation of the sum, divided out here, is level over the times of a record.
    """
    times = step * 2.0 ** np.arange(0, np.ceil(np.log2(max(n, 2))) + 2)
    total = np.zeros((n, axes))
    for tau in times:
        keep = np.exp(-step / tau)
        driven = np.sqrt(1.0 - keep**2) * rng.standard_normal((n, axes))
        driven[0] = rng.standard_normal(axes)
        # x_k = keep x_{k-1} + driven_k, by doubling
        by, power = 1, keep
        while by < n:
            driven[by:] = driven[by:] + power * driven[:-by].copy()
            by, power = 2 * by, power**2
        total += driven
    # the Allan variance of such processes, summed over all octaves, of variance 1 each
    x = 2.0 ** np.arange(-12, 21)
    allan = np.sum((2.0 / x**2) * (x - 1.5 + 2.0 * np.exp(-x) - 0.5 * np.exp(-2.0 * x)))
    return level * total / np.sqrt(allan)


@dataclass(frozen=True)
class Record:
    """A record: stamps ``t`` (n,) [s]; ``rate``, ``th``, ``acc`` (n, 3) as logged (the last rate not used), and the
    true ``C_np`` (n, 3, 3); ``temperature`` (n,) [degC]."""

    t: np.ndarray
    rate: np.ndarray
    th: np.ndarray
    acc: np.ndarray
    C_np: np.ndarray
    temperature: np.ndarray
    measured: bool

    def write(self, path, without=()) -> None:
        """A CSV file with units in its header, ``without`` the columns of some names."""
        sensor = "gyro" if self.measured else "wc"
        titles = ["t [s]", *(f"{sensor}_{i} [deg/h]" for i in "xyz"), *(f"th_{i} [deg]" for i in "xyz"),
                  *(f"acc_{i} [m/s^2]" for i in "xyz"), "temperature [degC]"]  # fmt: skip
        rows = np.column_stack(
            [self.t, self.rate / DEG_H, np.degrees(self.th), self.acc, self.temperature[:, None]]
        )
        kept = [k for k, title in enumerate(titles) if title.split(" ")[0] not in without]
        titles = [titles[k] for k in kept]
        np.savetxt(path, rows[:, kept], delimiter=",", header=",".join(titles), comments="", fmt="%.13g")


def earth_and_up(faults: Faults):
    """Earth rate and specific force at rest in n."""
    L, g = LATITUDE + faults.latitude, GRAVITY * (1.0 + faults.gravity)
    return EARTH * np.array([np.cos(L), np.sin(L), 0.0]), np.array([0.0, g, 0.0])


def simulated(rng, drive=Drive(), truth=TRUTH, noise=NOMINAL, faults=Faults()) -> Record:
    """One record of a platform with ``truth`` (18,) and ``faults``; the noise is the same whatever the faults."""
    of_gyros, of_encoders, of_accelerometers, rng = rng.spawn(4)
    kg0, eta, ds, do, ka0, ka1 = truth.reshape(6, 3)
    earth, up = earth_and_up(faults)
    m, h = drive.fine, drive.step / drive.fine
    rows = round(drive.spans()[1] / drive.step) + 1
    lead = int(np.ceil(1.0 / drive.step))  # a second before the first row, for what is late
    n = rows + 2 * lead
    t = h * np.arange(-lead * m, (n - lead - 1) * m + 1)

    # the drive wants the platform to turn with the nominal angles, and knows earth rate
    at = t if drive.measured else t - faults.delay_gyro
    th = drive.angles(at)
    middle = 0.5 * (th[1:] + th[:-1])
    J, nominal = joints(middle), gimballed(middle, Faults(), None)
    wanted = (J @ (np.diff(th, axis=0) / h)[..., None])[..., 0] + np.einsum(
        "kji,j->ki", nominal, earth_and_up(Faults())[0]
    )
    if faults.servo:
        own = np.repeat(faults.servo * rng.standard_normal((n - 1, 3)), m, axis=0)
        wanted = wanted + own
    M = np.array([[0.0, ds[0], -do[0]], [-do[1], 0.0, ds[1]], [ds[2], -do[2], 0.0]]) + np.diag(
        faults.gyro_scale
    )
    bias = kg0 + faults.gyro_by_k * (faults.warming * (t[:-1] / t[-1]))[:, None]
    bias = bias + flicker(rng, faults.gyro_flicker, h, len(t) - 1) if faults.gyro_flicker else bias
    bias = bias + faults.gyro_walk * np.sqrt(h) * np.cumsum(rng.standard_normal(bias.shape), axis=0)
    if faults.g_sensitivity:
        bias = bias + faults.g_sensitivity * np.einsum("kji,j->ki", nominal, up) / G
    wander = noise.walk / np.sqrt(h) * of_gyros.standard_normal(bias.shape)
    # what the platform does: it turns as its gyros say, whose errors thus move it
    w = wanted if drive.measured else wanted + wanted @ M.T + bias + wander

    first = np.argmin(np.abs(t))
    inertial = running_product(np.concatenate([np.eye(3)[None], turned(w * h)]))
    C_np = (
        np.swapaxes(turned(earth * t[:, None]), -1, -2) @ turned(faults.base) @ inertial[first].T @ inertial
    )

    def attitudes(times):
        """C_np at any times, exact within a fine step."""
        k = np.clip(np.floor((times - t[0]) / h + 1e-9).astype(int), 0, len(w) - 1)
        late = (times - t[k])[:, None]
        return np.swapaxes(turned(earth * late), -1, -2) @ C_np[k] @ turned(w[k] * late)

    stamps = drive.step * np.arange(rows)
    real = stamps + faults.jitter * rng.standard_normal(rows) if faults.jitter else stamps

    # encoders
    seen = real - faults.delay_encoder
    C_seen = attitudes(seen)
    sway = faults.sway * np.sin(2.0 * np.pi * faults.sway_frequency * seen + rng.uniform(0.0, 2.0 * np.pi))
    C_base = turned(faults.base) @ turned(sway[:, None] * np.array([1.0, 0.0, 0.6]))
    up_p = np.einsum("kji,j->ki", C_seen, up) / G
    th_true = encoder_angles(np.swapaxes(C_base, -1, -2) @ C_seen, drive.angles(seen), faults, up_p)
    read = th_true + faults.zero + noise.encoder * of_encoders.standard_normal((rows, 3))
    for joint, order, amplitude, phase in faults.harmonics:
        read[:, joint] += amplitude * np.sin(order * th_true[:, joint] + phase)
    if faults.quantum:
        read = faults.quantum * np.round(read / faults.quantum)

    # accelerometers
    felt = real - faults.delay_accelerometer
    f = np.einsum("kji,j->ki", attitudes(felt), up)
    if faults.levers.any():
        rate = w - np.einsum("kji,j->ki", C_np[:-1], earth)
        edge = np.clip(np.searchsorted(t, felt - 1e-9), 1, len(w) - 1)
        k = np.clip(np.floor((felt - t[0]) / h + 1e-9).astype(int), 0, len(w) - 1)
        smooth = J @ (np.diff(th, axis=0) / h)[..., None]
        change = (smooth[edge, :, 0] - smooth[edge - 1, :, 0]) / h
        own = rate[k]
        for i in range(3):
            r = faults.levers[i]
            f[:, i] += (np.cross(change, r) + np.cross(own, np.cross(own, r)))[:, i]
    along = np.stack([f[:, 0], f[:, 1] - eta[1] * f[:, 0], f[:, 2] + eta[0] * f[:, 0] - eta[2] * f[:, 1]], -1)
    warm = faults.warming * np.clip(stamps / stamps[-1], 0.0, 1.0)[:, None]
    scale = 1.0 + ka1 + faults.scale_by_k * warm + 0.5 * faults.asymmetry * np.sign(along)
    acc = ka0 + faults.bias_by_k * warm + scale * (along + faults.k2 * along**2)
    acc = acc + noise.accelerometer * of_accelerometers.standard_normal((rows, 3))
    acc = acc + (flicker(rng, faults.flicker, drive.step, rows) if faults.flicker else 0.0)
    acc = acc + faults.walk * np.sqrt(drive.step) * np.cumsum(rng.standard_normal((rows, 3)), axis=0)
    if faults.acc_quantum:
        acc = faults.acc_quantum * np.round(acc / faults.acc_quantum)

    # rates, meant from each row to the next
    mean = wanted[lead * m : (lead + rows) * m].reshape(rows, m, 3).mean(axis=1)
    if drive.measured:
        of_truth = wanted - bias - wander
        late = np.interp(t[:-1] - faults.delay_gyro, t[:-1], np.arange(len(of_truth)))
        k, part = np.floor(late).astype(int), (late - np.floor(late))[:, None]
        shifted = (1.0 - part) * of_truth[k] + part * of_truth[np.minimum(k + 1, len(of_truth) - 1)]
        mean = np.linalg.solve(
            np.eye(3) + M, shifted[lead * m : (lead + rows) * m].reshape(rows, m, 3).mean(axis=1).T
        ).T
    elif faults.delay_gyro:  # logged when sent
        on_time = drive.angles(t)
        between = 0.5 * (on_time[1:] + on_time[:-1])
        sent = (joints(between) @ (np.diff(on_time, axis=0) / h)[..., None])[..., 0] + np.einsum(
            "kji,j->ki", gimballed(between, Faults(), None), earth_and_up(Faults())[0]
        )
        mean = sent[lead * m : (lead + rows) * m].reshape(rows, m, 3).mean(axis=1)

    keep = np.ones(rows, bool)
    for begin, end in faults.gaps:
        keep &= (stamps < begin) | (stamps > end)
    lost = np.append(False, rng.random(rows - 1) < faults.lost) if faults.lost else np.zeros(rows, bool)
    read[lost], acc[lost] = np.nan, np.nan
    temperature = 25.0 + warm[:, 0]
    made = (stamps, mean, read, acc, attitudes(real), temperature)
    return Record(*(each[keep] for each in made), drive.measured)


def study(noise: Noise = NOMINAL, more: str = "") -> str:
    """The study of such a platform, as a file has it; ``more`` lines are appended."""
    return f"""
[site]
latitude = "{np.degrees(LATITUDE)} deg"
gravity = "{GRAVITY} m/s^2"
[rig]
kind = "three_axis_gimbals"
heading = "0 deg"
[noise]
angle_random_walk = "{noise.walk / DEG_ROOT_H} deg/sqrt(h)"
accelerometer = "{noise.accelerometer / UG} ug"
encoder = "{noise.encoder / ARCSEC} arcsec"
[prior]
kg0 = "0.3 deg/h"
eta = "300 arcsec"
ds = "300 arcsec"
do = "300 arcsec"
ka0 = "500 ug"
ka1 = "1500 ppm"
{more}"""
