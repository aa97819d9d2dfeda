"""A plain NumPy twin of the fusion, written from its equations: dense matrices, derivatives by complex steps.

Transitions and their noise are scipy's matrix exponentials (Van Loan). The smoother is that of Rauch, Tung and
Striebel, another form than the one that is compiled.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

_STEP = 1e-30

_SHOWN_BY_MOTION = ("dr", "zo", "k", "tau")


@dataclass
class Twin:
    """The states by name, and what is taken as known from the settings of a study."""

    settings: object
    names: tuple
    spatial: bool = False

    def __post_init__(self):
        self.place = {name: k for k, name in enumerate(self.names)}
        roll = self.settings.attitude.roll
        self.roll = 0.0 if roll is None else roll.value

    def of(self, x, name):
        return x[self.place[name]] if name in self.place else 0.0

    def accelerometer(self, x, i, p, y):
        """Real or complex."""
        layout, k = self.settings.layout, i + 1
        g, theta, w, al = self.settings.site.gravity, x[0], x[1], x[2]
        vertical = self.settings.prior.heave.vertical
        g = g + vertical * self.of(x, "flexure_z")
        r, z = layout.r[i] + self.of(x, f"dr_{k}"), layout.z[i] + self.of(x, f"zo_{k}")
        if self.spatial:
            phi, p, y = self.of(x, "phi"), p - self.of(x, "b_roll"), y - self.of(x, "b_yaw")
        else:
            # a fixed roll phi: the turn w is about the horizontal, its parts in the body are w cos phi, w sin phi
            phi, p, y, w, al = self.roll, 0.0, w * math.sin(self.roll), w * math.cos(self.roll), al
            fx = g * np.sin(theta) - r * x[1] ** 2 - z * math.cos(phi) * al
            fz = g * np.cos(theta) * math.cos(phi) + r * math.cos(phi) * al - z * w**2
        if self.spatial:
            fx = g * np.sin(theta) - r * (w**2 + y**2) - z * (al - p * y)
            fz = g * np.cos(theta) * np.cos(phi) + r * (al + p * y) - z * (w**2 + p**2)
        fx, fz = fx + self.of(x, "flexure_x"), fz + (not vertical) * self.of(x, "flexure_z")
        angle = layout.angle[i]
        return fx * math.cos(angle) - fz * math.sin(angle) + self.of(x, f"b_{k}")

    def gyro(self, x):
        tau = self.settings.timing.gyro_delay
        tau = self.of(x, "tau_g") if tau is None else tau
        level = 1.0 if self.spatial else math.cos(self.roll)
        then = x[1] - tau * x[2] + 0.5 * tau**2 * x[3]
        return (1.0 + self.of(x, "k_g")) * level * then + self.of(x, "b_g")

    def reading(self, x, i, row, motion):
        """What scalar ``i`` of a row should read, its derivative, its variance.

        Derivatives by positions and by the gyro's scale and delay are those at another ``motion``, rate,
        acceleration and jerk.
        """
        n, noise = len(self.settings.layout.names), self.settings.noise

        def told(x, p, y):
            if i < n:
                return self.accelerometer(x, i, p, y)
            return self.gyro(x) if i == n else x[0]

        p, y = row[n + 3 :] if self.spatial else (0.0, 0.0)
        moved = np.concatenate([x[:1], motion, x[4:]])
        at = [moved if name.partition("_")[0] in _SHOWN_BY_MOTION else x for name in self.names]
        h = np.array([told(_off(at[k], k), p, y).imag / _STEP for k in range(len(x))])
        variance = (noise.accelerometer, noise.gyro, row[n + 2])[(i >= n) + (i > n)] ** 2
        if self.spatial:
            by = [
                told(x.astype(complex), p + _STEP * 1j, y).imag,
                told(x.astype(complex), p, y + _STEP * 1j).imag,
            ]
            variance += (by[0] ** 2 + by[1] ** 2) / _STEP**2 * noise.gyro**2
        return told(x.astype(complex), p, y).real, h, variance

    def transition(self, x, dt, p, y):
        """State ahead, F (n, n), Q (n, n)."""
        n, prior = len(x), self.settings.prior
        A, N = np.zeros((n, n)), np.zeros((n, n))
        A[0, 1] = A[1, 2] = A[2, 3] = 1.0
        N[3, 3] = self.settings.estimator.density * max(1.0, 1e-3 / dt) ** 2
        for s, output, of in (("s_z", "flexure_z", prior.heave), ("s_x", "flexure_x", prior.axial)):
            if s in self.place:
                a, b = self.place[s], self.place[output]
                A[a, b], A[b, a], A[b, b] = 1.0, -(of.omega**2), -2.0 * of.damping * of.omega
                N[b, b] = 4.0 * of.damping * of.omega * of.level**2
        for name, k in self.place.items():
            if name.startswith("b_"):
                of_gyro = name in ("b_g", "b_roll", "b_yaw")
                N[k, k] = (
                    self.settings.noise.gyro_walk if of_gyro else self.settings.noise.accelerometer_walk
                ) ** 2
        size = N.max()
        block = expm(np.block([[-A, N / size], [np.zeros((n, n)), A.T]]) * dt)
        F = block[n:, n:].T
        Q = F @ block[:n, n:] * size
        if not self.spatial:
            return F @ x, F, Q
        # theta and roll: a step of Euler with the turn of pitch in full
        roll = self.place["phi"]
        ahead = F @ x

        def turned(x):
            w, al, j, phi = x[1], x[2], x[3], x[roll]
            rolling, yawing = p - x[roll + 1], y - x[roll + 2]
            steep = np.sin(x[0]) * np.cos(x[0]) / (np.cos(x[0]) ** 2 + 1e-4)
            turn = w * dt + al * dt**2 / 2 + j * dt**3 / 6
            return (
                x[0] + np.cos(phi) * turn + yawing * np.sin(phi) * dt,
                phi + dt * (rolling + (w * np.sin(phi) - yawing * np.cos(phi)) * steep),
            )

        ahead[[0, roll]] = turned(x)
        for k in range(n):
            F[0, k], F[roll, k] = (each.imag / _STEP for each in turned(_off(x, k)))
        s, c = math.sin(x[roll]), math.cos(x[roll])
        steep = math.sin(x[0]) * math.cos(x[0]) / (math.cos(x[0]) ** 2 + 1e-4)
        # columns: noise of the roll gyro, of the yaw gyro
        by = np.array([[0.0, s], [1.0, -c * steep]]) * self.settings.noise.gyro * dt
        added = by @ by.T
        Q[0, 0] += added[0, 0]
        Q[roll, roll], Q[0, roll], Q[roll, 0] = added[1, 1], added[0, 1], added[0, 1]
        return ahead, F, Q


def _off(x, k):
    off = x.astype(complex)
    off[k] += _STEP * 1j
    return off


def above_noise(x, P, j, largest=math.inf):
    """Share of a state beyond three standard deviations, of a variance that is the largest at most."""
    return max(0.0, 1.0 - 9.0 * min(P[j, j], largest) / x[j] ** 2) if x[j] else 0.0


def motion_of(x, P):
    """Rate, acceleration, and the jerk as far as it is above noise."""
    return np.array([x[1], x[2], x[3] * above_noise(x, P, 3)])


def believed_of(twin, x, P):
    """(n,) how much of a derivative by each state is kept: of positions, gyro scale and delay as much as moves at a
    state. The noise of a rate is that of the gyro at most, however little is known before the first row."""
    rate, acceleration = above_noise(x, P, 1, twin.settings.noise.gyro**2), above_noise(x, P, 2)
    by = {"dr": max(rate, acceleration), "zo": max(rate, acceleration), "k": rate, "tau": acceleration}
    return np.array([by.get(name.partition("_")[0], 1.0) for name in twin.names])


def beyond(twin, P, believed):
    """Variance of tau al and of tau^2 j / 2 about 0: for a Gaussian tau the mean of tau^4 is 3 var(tau)^2."""
    if "tau_g" not in twin.place or not believed[twin.place["tau_g"]] > 0.0:
        return 0.0
    k = twin.place["tau_g"]
    return P[k, k] * P[2, 2] + 3.0 * P[k, k] ** 2 * P[3, 3] / 4.0


def run(twin, start, t, rows):
    """Filter and smoother from a `FilterStart`: arrays of states (m, n) and covariances (m, n, n), causal and smoothed.

    The innovations over their standard deviations (m, N + 1) come last.
    """
    n, gate = len(twin.settings.layout.names), twin.settings.estimator.gate
    x, P, turns = start.x.copy(), start.P.copy(), start.turns[:2]
    predicted, updated, steps = [], [], []
    innovations = np.full((len(t), n + 1), np.nan)
    for k, row in enumerate(rows):
        dt = t[k] - t[k - 1] if k else 0.0
        before = turns.copy()
        turns = np.where(np.isfinite(row[n + 3 :]), row[n + 3 :], turns)
        F = np.eye(len(x))
        motion, believed = motion_of(x, P), believed_of(twin, x, P)
        if dt > 0.0:
            x, F, Q = twin.transition(x, dt, *(0.5 * (before + turns)))
            P = F @ P @ F.T + Q
        predicted.append((x, P))
        steps.append(F)
        ahead = x.copy()
        for i in range(n + 2):
            if math.isnan(row[i]):
                continue
            told, h, variance = twin.reading(ahead, i, np.concatenate([row[: n + 3], turns]), motion)
            h = h * believed
            variance += beyond(twin, P, believed) if i == n else 0.0
            v, S = row[i] - told - h @ (x - ahead), h @ P @ h + variance
            if i <= n:
                innovations[k, i] = v / math.sqrt(S)
            S = max(S, v**2 / gate)
            K = P @ h / S
            x = x + K * v
            # Joseph's form, of the measurement with the noise that its variance leaves for it
            left = np.eye(len(x)) - np.outer(K, h)
            P = left @ P @ left.T + np.outer(K, K) * (S - h @ P @ h)
        updated.append((x, P))
    smooth = [updated[-1]]
    for k in range(len(t) - 2, -1, -1):
        (x, P), (ahead, spread) = updated[k], predicted[k + 1]
        scale = np.sqrt(np.diag(spread))
        G = np.linalg.solve(spread / np.outer(scale, scale), (steps[k + 1] @ P) / scale[:, None]).T / scale
        later, of_later = smooth[0]
        smooth.insert(0, (x + G @ (later - ahead), P + G @ (of_later - spread) @ G.T))
    return (
        *(np.array(each) for each in zip(*updated, strict=True)),
        *(np.array(each) for each in zip(*smooth, strict=True)),
        innovations,
    )
