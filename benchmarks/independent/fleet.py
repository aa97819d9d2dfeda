"""A fleet of accelerometer triads in 24 poses, by a simulator of its own: matrices and noise, no code of inercal."""

import numpy as np

G = 9.80665
K1 = 400.0  # counts per m/s^2
U_BIAS, U_SCALE, NOISE = 3.0, 0.4, 0.05  # counts, counts per m/s^2, counts

STUDY = """
[site]
gravity = "9.80665(1) m/s^2"
[imu]
method = "means"
[item]
maker = "Acme"
model = "G-7"
[specification]
decision = "simple acceptance"
K1 = ["398 count/(m/s^2)", "402 count/(m/s^2)"]
K0 = ["-20 count", "20 count"]
"""


def poses():
    """Specific force of 24 poses: faces, edges and corners up, as far as they go."""
    every = np.array(
        [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)]
    )
    return G * (every / np.linalg.norm(every, axis=1, keepdims=True))[:24]


def made(folder, units=30, seed=20261123):
    """A manifest with files of means: unit 4 has a bias outside its limits, unit 9 a strange misalignment, unit 12 no
    readable file, unit 17 a scale outside; true biases and scales (units, 3)."""
    rng = np.random.default_rng(seed)
    bias = U_BIAS * rng.standard_normal((units, 3))
    scale = K1 + U_SCALE * rng.standard_normal((units, 3))
    skew = 1e-4 * rng.standard_normal((units, 3))
    if units > 17:
        bias[4, 1], skew[9, 0], scale[17, 2] = 35.0, 0.02, 404.0
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["serial,files,conditions.temperature"]
    for k in range(units):
        A = np.eye(3) + np.array([[0, skew[k, 0], skew[k, 1]], [0, 0, skew[k, 2]], [0, 0, 0]])
        counts = bias[k] + scale[k] * (poses() @ A.T) + NOISE * rng.standard_normal((24, 3))
        rows = [
            "acc_x [count],acc_y [count],acc_z [count]",
            *(",".join(map(repr, row.tolist())) for row in counts),
        ]
        text = "nothing of use\n" if k == 12 else "\n".join(rows) + "\n"
        (folder / f"unit{k:03d}.csv").write_text(text)
        lines.append(f"SN {k:03d},unit{k:03d}.csv,{20 + k % 5} degC")
    (folder / "fleet.csv").write_text("\n".join(lines) + "\n")
    (folder / "imu.toml").write_text(STUDY)
    return bias, scale
