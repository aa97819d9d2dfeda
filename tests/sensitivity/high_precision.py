"""The parts of variance of a chain's output by another road, with 60 digits: second moments and subtraction.

E[R x R] and E[R] x E[R] of each element give the second moment of E[Y | errors of a set] as one product of 9 x 9
matrices; variances are differences of such products. Angles and sizes are taken as the exact numbers they are.
"""

import mpmath as mp
import numpy as np

from inercal.foundation.rigs.chain import Error, Fixed, Joint
from inercal.foundation.rigs.patterns import density, normal, triangular, two_point, uniform

DIGITS = 60


def exact(values):
    """An array of the same numbers with 60 digits."""
    return np.vectorize(mp.mpf, otypes=[object])(np.asarray(values, dtype=float))


def ramp(size):
    """The asymmetric density that rises linearly from zero at -size/3 to its peak at ``size``."""
    distribution = density(lambda x: x + size / 3.0, -size / 3.0, size)
    object.__setattr__(distribution, "ends", (-size / 3.0, size))
    return distribution


#: distributions by size, symmetric ones and one that is not
KINDS = {"uniform": uniform, "normal": normal, "triangular": triangular, "two_point": two_point, "ramp": ramp}


def wave(distribution, k):
    """E exp(i k d) in closed form."""
    if k == 0:
        return mp.mpf(1)
    h = mp.mpf(distribution.size)
    match distribution.kind:
        case "uniform":
            return mp.sin(k * h) / (k * h)
        case "normal":
            return mp.exp(-((k * h) ** 2) / 2)
        case "two_point":
            return mp.cos(k * h)
        case "triangular":
            return 2 * (1 - mp.cos(k * h)) / (k * h) ** 2
    low, high = map(mp.mpf, distribution.ends)
    width, ik = high - low, mp.mpc(0, k)
    # twice by parts of (x - low) exp(ikx)
    return 2 / width**2 * (width * mp.exp(ik * high) / ik - (mp.exp(ik * high) - mp.exp(ik * low)) / ik**2)


def circular(distribution):
    """E cos, E sin, E cos^2, E cos sin, E sin^2."""
    one, two = mp.mpc(wave(distribution, 1)), mp.mpc(wave(distribution, 2))
    return one.real, one.imag, (1 + two.real) / 2, two.imag / 2, (1 - two.real) / 2


def basis(axis):
    """P, C, K with R(d) = P + cos d C + sin d K."""
    unit = np.eye(3)["xyz".index(axis)]
    P = np.outer(unit, unit)
    return exact(P), exact(np.eye(3) - P), exact(np.cross(np.eye(3), unit))


def element_moments(element, angle):
    """E[R], E[R] x E[R] and E[R x R] of an element."""
    if isinstance(element, Fixed):
        mean = exact(element.rotation)
        both = np.kron(mean, mean)
        return mean, both, both
    P, C, K = basis(element.axis)
    if isinstance(element, Joint):
        c, s = mp.cos(mp.mpf(angle)), mp.sin(mp.mpf(angle))
        cc, cs, ss = c * c, c * s, s * s
    else:
        c, s, cc, cs, ss = circular(element.distribution)
    mean = P + c * C + s * K
    second = (
        np.kron(P, P)
        + c * (np.kron(P, C) + np.kron(C, P))
        + s * (np.kron(P, K) + np.kron(K, P))
        + cc * np.kron(C, C)
        + cs * (np.kron(C, K) + np.kron(K, C))
        + ss * np.kron(K, K)
    )
    return mean, np.kron(mean, mean), second


def reference(chain, output, angles):
    """V, bias, V_i and VT_i - V_i of one output at one position, with 60 digits."""
    with mp.workdps(DIGITS):
        u, v = exact(output.reference), exact(output.axis)
        elements, joint = [], 0
        for element in chain.elements:
            if isinstance(element, Error) and element.is_offset:
                continue
            angle = angles[joint] if isinstance(element, Joint) else 0.0
            joint += isinstance(element, Joint)
            elements.append((element, *element_moments(element, float(angle))))
        mean, ideal = u, u
        for element, matrix, _, _ in elements:
            mean = mean @ matrix
            ideal = ideal if isinstance(element, Error) else ideal @ matrix
        mean, ideal = mean @ v, ideal @ v

        # second moments of the row before, and of the column after each element, all errors apart or together
        rows, columns = {2: [np.kron(u, u)], 3: [np.kron(u, u)]}, {2: [np.kron(v, v)], 3: [np.kron(v, v)]}
        for how in (2, 3):
            for element in elements:
                rows[how].append(rows[how][-1] @ element[how])
            for element in elements[::-1]:
                columns[how].insert(0, element[how] @ columns[how][0])
        variance = rows[3][-1] @ columns[3][-1] - mean**2
        first, total = exact(np.zeros(len(chain.factors))), exact(np.zeros(len(chain.factors)))
        for e, (element, _, apart, together) in enumerate(elements):
            if isinstance(element, Error):
                k = chain.factors.index(element.name)
                first[k] = rows[2][e] @ together @ columns[2][e + 1] - mean**2
                total[k] = variance - (rows[3][e] @ apart @ columns[3][e + 1] - mean**2)
        return variance, mean - ideal, first, total - first


def relative(found, expected, floor=0.0):
    """Largest relative error; numbers below ``floor`` are compared with the floor."""
    with mp.workdps(DIGITS):
        pairs = zip(np.ravel(np.asarray(found, dtype=float)), np.ravel(np.asarray(expected)), strict=True)
        return float(max(abs(mp.mpf(a) - b) / max(abs(b), floor) for a, b in pairs))
