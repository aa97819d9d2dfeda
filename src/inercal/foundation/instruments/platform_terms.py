"""Terms of a platform in gimbals, for the one table of all terms: symbol, name, SI unit."""

from __future__ import annotations

from typing import Final

_AXES = "xyz"

PLATFORM: Final[tuple[tuple[str, str, str], ...]] = (
    *((f"kg0_{i}", f"gyro {i} bias: rate of the platform at zero command", "rad/s") for i in _AXES),
    ("eta_pz", "misalignment of accelerometer z: output per specific force along x", "rad"),
    ("eta_oy", "misalignment of accelerometer y: output per specific force along x, reversed", "rad"),
    ("eta_oz", "misalignment of accelerometer z: output per specific force along y, reversed", "rad"),
    *(
        (f"{symbol}_{a}", f"misalignment of gyro {a}: rate about {a} per rate about {b}{way}", "rad")
        for symbol, way, others in (("ds", "", "yzx"), ("do", ", reversed", "zxy"))
        for a, b in zip(_AXES, others, strict=True)
    ),
    *(
        (f"{symbol}_{i}", name.format(i), unit)
        for symbol, name, unit, ends in (
            ("ka0", "accelerometer {} bias: reading at zero specific force", "m/s^2", _AXES),
            ("ka1", "accelerometer {} scale error", "1", _AXES),
            ("kg1", "gyro {} scale error", "1", _AXES),
            ("kg0_walk", "gyro {} bias at the last row less its mean", "rad/s", _AXES),
            ("ka0_walk", "accelerometer {} bias at the last row less its mean", "m/s^2", _AXES),
            ("beta", "zero of the encoders: turn of their frame about {} of the base", "rad", _AXES),
            ("gamma", "turn of the sensors about {} of the platform, against the last gimbal", "rad", _AXES),
            ("zero", "reading of the encoder {} at zero", "rad", "y"),
        )
        for i in ends
    ),
    ("nonorth_xy", "non-orthogonality of the joints: turn of axis y against axis x", "rad"),
    ("nonorth_yz", "non-orthogonality of the joints: turn of axis z against axis y", "rad"),
    *(
        (f"sag_{i}", f"turn of the sensors by a mass along {i} of the platform, per force", "rad/(m/s^2)")
        for i in _AXES
    ),
    *(
        (
            f"harmonic_{k}_{part}",
            f"error of an encoder, x, y or z, by its angle: {part} part of item {k}",
            "rad",
        )
        for k in range(1, 13)
        for part in ("sin", "cos")
    ),
    ("tau_enc", "delay of the encoders", "s"),
)
"""In the order of results."""
