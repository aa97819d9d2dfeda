"""The model of the filters of the paper: the 18 coefficients, or the 24 of the extended model, by themselves.

Their sigma points take a small vector through the model hundreds of times a step. What is here is
`inercal.systems.selfcal.platform.model` without the states of the rig, and a test holds the two together.
"""

from __future__ import annotations

from inercal.foundation._jit import kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Vector, exp, rotate


@kernel
def platform_rate(w: Vector | Array, c: Array, extended: bool) -> Vector:
    """Rate ``w_Ip^p`` (3,) [rad/s] of a platform that is commanded ``w`` (3,): ``w + M w + kg0``."""
    x = w[0] + c[0] + c[6] * w[1] - c[9] * w[2]
    y = w[1] + c[1] - c[10] * w[0] + c[7] * w[2]
    z = w[2] + c[2] + c[8] * w[0] - c[11] * w[1]
    if extended:
        x, y, z = x + c[18] * w[0], y + c[19] * w[1], z + c[20] * w[2]
    return x, y, z


@kernel
def on_the_base(v_b: Vector | Array, c: Array, extended: bool) -> Vector:
    """A vector stated in the base, in the frame of the encoders: turned by beta."""
    if extended:
        return rotate(exp((c[21], c[22], c[23])), v_b)
    return v_b[0], v_b[1], v_b[2]


@kernel
def accelerometers(f: Vector, c: Array) -> Vector:
    """Outputs (3,) [m/s^2] at specific force ``f`` (3,)."""
    return (
        c[12] + (1.0 + c[15]) * f[0],
        c[13] + (1.0 + c[16]) * f[1] - c[4] * f[0],
        c[14] + (1.0 + c[17]) * f[2] + c[3] * f[0] - c[5] * f[1],
    )
