"""The causal fusion of three accelerometers and a gyro as one writes it in NumPy, and with filterpy.

The same model with 8 or 19 states at even intervals, without roll, delay or what is masked. `Model` is written with
care: transitions are made once, derivatives are those of the equations at the prediction, scalars are put in one after
the other.
"""

import math

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

#: places of biases of accelerometers, errors of r, flexure up and forward, errors of z, error of the gyro's scale
BIASES, ARMS, UP, FORWARD, HEIGHTS, SCALE = 5, 8, 12, 14, 15, 18


class Model:
    """Transition ``F``, its noise ``Q``, and what each of the four sensors reads."""

    def __init__(self, problem, gravity, noise, dt, F, Q):
        n = problem.size
        moving = [0, 1, 2, 3, *(range(11, 15) if n > 8 else ())]
        self.F, self.Q = np.eye(n), np.zeros((n, n))
        self.F[np.ix_(moving, moving)], self.Q[np.ix_(moving, moving)] = F, Q
        self.full, self.g, self.dt = n > 8, gravity, dt
        self.axes = [tuple(map(float, row)) for row in problem.geometry]
        self.variances = [noise.accelerometer**2] * 3 + [noise.gyro**2]

    def read(self, x, i, before):
        """What sensor ``i`` should read, and its derivative (n,); by positions and scale at the state ``before``."""
        h = np.zeros(len(x))
        theta, w, al = x[0], x[1], x[2]
        if i == 3:
            k = 1.0 + (x[SCALE] if self.full else 0.0)
            h[1], h[4] = k, 1.0
            if self.full:
                h[SCALE] = before[1]
            return k * w + x[4], h
        along, down, r, z = self.axes[i]
        up = forward = 0.0
        if self.full:
            r, z = r + x[ARMS + i], z + x[HEIGHTS + i]
            up, forward = x[UP], x[FORWARD]
            was, turned = before[1] ** 2, before[2]
            h[ARMS + i] = -along * was - down * turned
            h[HEIGHTS + i] = -along * turned + down * was
            h[UP], h[FORWARD] = -down, along
        s, c = self.g * math.sin(theta), self.g * math.cos(theta)
        fx, fz = s - r * w * w - z * al + forward, c + r * al - z * w * w + up
        h[0] = along * c + down * s
        h[1] = -2.0 * w * (along * r - down * z)
        h[2] = -along * z - down * r
        h[BIASES + i] = 1.0
        return along * fx - down * fz + x[BIASES + i], h

    def row(self, x, before, P):
        """What the four sensors should read at a prediction, and their derivatives (4, n).

        Positions and the gyro's scale are learned by the motion of the row ``before``, of covariance ``P``, and not
        where that is but noise: of a rate at most that of the gyro, however little is known at the start.
        """
        told, H = zip(*(self.read(x, i, before) for i in range(4)), strict=True)
        told, H = np.array(told), np.array(H)
        if self.full:
            noise = (min(P[1, 1], self.variances[3]), P[2, 2])
            w, al = (
                max(0.0, 1.0 - 9.0 * of / by**2) if by else 0.0
                for of, by in zip(noise, before[1:3], strict=True)
            )
            H[:, ARMS : ARMS + 3] *= max(w, al)
            H[:, HEIGHTS : HEIGHTS + 3] *= max(w, al)
            H[:, SCALE] *= w
        return told, H


def run_numpy(model, x, P, rows):
    """Angles and their uncertainties (m, 2) of ``rows`` (m, 4)."""
    x, P, found = x.copy(), P.copy(), np.empty((len(rows), 2))
    F, Q, Ft = model.F, model.Q, model.F.T
    for k, row in enumerate(rows.tolist()):
        before, spread = x.copy(), P
        if k:
            x = F @ x
            P = F @ P @ Ft + Q
        ahead, (told, H) = x.copy(), model.row(x, before, spread)
        for i, h in enumerate(H):
            v, Ph = row[i] - told[i] - h @ (x - ahead), P @ h
            S = float(h @ Ph) + model.variances[i]
            S = max(S, v * v / 25.0)
            x += Ph * (v / S)
            P -= np.outer(Ph, Ph / S)
        P = 0.5 * (P + P.T)
        found[k] = x[0], math.sqrt(P[0, 0])
    return found


def run_filterpy(model, x, P, rows):
    """The same with filterpy's extended filter; the gate is put into R."""
    ekf = ExtendedKalmanFilter(dim_x=len(x), dim_z=1)
    ekf.x, ekf.P, ekf.F, ekf.Q = x.copy(), P.copy(), model.F, model.Q
    found = np.empty((len(rows), 2))
    for k, row in enumerate(rows):
        before, spread = ekf.x.copy(), ekf.P.copy()
        if k:
            ekf.predict()
        ahead, (told, H) = ekf.x.copy(), model.row(ekf.x, before, spread)
        for i, h in enumerate(H):
            expected = told[i] + h @ (ekf.x - ahead)
            v, variance = row[i] - expected, h @ ekf.P @ h
            R = max(model.variances[i], v * v / 25.0 - variance)
            ekf.update(
                row[i : i + 1],
                HJacobian=lambda _, h=h: h[None, :],
                Hx=lambda _, expected=expected: np.array([expected]),
                R=np.array([[R]]),
            )
        found[k] = ekf.x[0], math.sqrt(ekf.P[0, 0])
    return found
