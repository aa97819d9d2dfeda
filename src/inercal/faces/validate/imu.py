"""Cases of IMU calibration: published results on shipped recordings, simulated instruments, other tools' files."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from inercal.faces.convert.correct import ImuModel, imu_model
from inercal.faces.convert.other_tools import from_tool, to_tool
from inercal.faces.studies.load import load_imu_study
from inercal.faces.validate import rows
from inercal.faces.validate.case import Case, record_of, study_of
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import Site
from inercal.foundation.results.result import Estimate
from inercal.systems.imu.ferraris.names import TERMS_OF_FERRARIS
from inercal.systems.imu.ferraris.simulate import SessionCourse, quiet, simulate_session, true_values
from inercal.systems.imu.settings import FerrarisSettings, ImuSettings
from inercal.systems.imu.simulate import draw_full_truth
from inercal.systems.imu.task import calibrate
from inercal.systems.imu.temperature.sweep import fit_recording

_AXES = "xyz"


@cache
def _calibrated(name: str, *overrides: str) -> Estimate:
    """The calibration of a shipped recording by its study."""
    return calibrate(record_of(name), load_imu_study(study_of(name), overrides)).estimate


def _as_published() -> Estimate:
    """The calibration of the recording of imu_tk's authors by their model, which has no g-sensitive drift."""
    return _calibrated("xsens", "imu.g_sensitivity=false")


def _matrix(model_of: Estimate, scale: str, cross: str) -> Array:
    """S M (3, 3) of a triad."""
    given = model_of.parameters
    size = np.array([given[f"{scale}_{i}"].value for i in _AXES])
    shape = [[1.0 if i == j else _value(model_of, f"{cross}_{i}{j}") for j in _AXES] for i in _AXES]
    return np.asarray(size[:, None] * np.array(shape))


def _value(estimate: Estimate, name: str) -> float:
    """A coefficient; 0 where the model does not have it."""
    return estimate[name].value if name in estimate.names else 0.0


def _vector(estimate: Estimate, name: str) -> Array:
    """The three coefficients of that name."""
    return np.array([estimate[f"{name}_{i}"].value for i in _AXES])


# The recording of Tedaldi et al. 2014, in counts, and what imu_tk makes of it: scale 1/K, T, bias, gyro scale.

TK_SCALE = np.array([414.4588739254017, 412.01046845347594, 414.6486622431341])
TK_T = (-0.00335929903323467, -0.00890639474323122, -0.0213341193851847)
TK_BIAS = np.array([33124.1825645617, 33275.1794341807, 32364.4156494431])
TK_GYRO = np.array([4777.955828030662, 4764.206560263323, 4773.65741055623])


def _tedaldi_misalignments() -> Array:
    """Upper part of T in the correction T K (raw - b), the inverse of M."""
    T = np.linalg.inv(_matrix(_as_published(), "K1", "M") / _vector(_as_published(), "K1")[:, None])
    return np.asarray(T[[0, 0, 1], [1, 2, 2]])


# imucal 2.6.0: w_cal = R_g^-1 K_g^-1 (w - K_ga a_cal - b_g), a_cal = R_a^-1 K_a^-1 (a - b_a), m/s^2 and deg/s.

IMUCAL = {
    "ferraris": {
        "K_a": [208.54567263762615, 208.0011341167055, 214.78455364603022],
        "R_a": [
            [0.9999125214309234, 0.007122056140390757, -0.011145662922687352],
            [-0.007947378455060604, 0.9996887358297629, 0.023648903373787954],
            [0.021342900724016442, -0.010781879507682177, 0.9997140749549175],
        ],
        "b_a": [-6.018868019671572, -48.287874016760156, -28.96636637224333],
        "K_g": [16.67769558952488, 16.187895200550262, 16.253362639451936],
        "R_g": [
            [-0.9999143756542296, -0.0006142300632876558, 0.013071498821540703],
            [0.0055057030733027396, -0.9992594967426224, -0.03808077472097593],
            [-0.01314650914177706, 0.0365074524847183, -0.9992469040284595],
        ],
        "K_ga": [
            [0.0022926499308660976, -0.016134632407810497, 0.018465435717563698],
            [0.013873705024757028, 0.005443610335094903, -0.008812480865044459],
            [-0.00925910567448679, 0.008506306471459087, -0.003935382156556474],
        ],
        "b_g": [1.960686204431737, -4.472837741243746, -3.6511794138670477],
    },
    "ferraris-si": {
        "K_a": [0.9967458650887003, 1.0024376185894108, 1.0233953475452096],
        "R_a": [
            [0.9998620291746435, -0.014830571004926794, -0.007481763056406514],
            [0.008576740442555632, 0.9999615197419686, 0.0018435180263559792],
            [0.01333118773067902, 0.002003617949970859, 0.9999091283455711],
        ],
        "b_a": [0.5371174244458201, -0.6162029930860964, 0.3988673423902682],
        "K_g": [1.0279243264288036, 0.9824277738468916, 0.9983104874451514],
        "R_g": [
            [0.999979342528037, -0.00045421361799804057, -0.006411568231274507],
            [-0.00022220540636464124, 0.9999961009525417, -0.002783649487862618],
            [0.009714004498496572, 0.0076410932929403316, 0.9999236229882218],
        ],
        "K_ga": [
            [0.00038961109153281214, -0.00045815544407725904, -2.9844819440802578e-05],
            [0.0004320123104123373, 0.0004871099695542217, 0.0006178601683550832],
            [9.966554956457076e-05, -9.110691206112818e-05, 0.0002356473632041452],
        ],
        "b_g": [-0.5996686296674446, -0.36984313466306884, 0.0587739354671091],
    },
}


def _imucal(name: str) -> list[Array]:
    """K_a R_a, b_a, K_g R_g, b_g, K_ga as published."""
    given = {key: np.array(value) for key, value in IMUCAL[name].items()}
    triads = [np.diag(given[f"K_{s}"]) @ given[f"R_{s}"] for s in "ag"]
    return [triads[0], given["b_a"], triads[1], given["b_g"], given["K_ga"]]


def _ferraris(name: str) -> Array:
    """The same that stand in our result, each part less the published one and over its largest number."""
    found = _calibrated(name, "imu.ferraris.turn=-360 deg", "site.gravity=9.81 m/s^2").result["imucal"]

    def gain(scale: str, cross: str) -> Array:
        shape = [[1.0 if i == j else found[f"{cross}_{i}{j}"] for j in _AXES] for i in _AXES]
        return np.asarray(np.array([[found[f"{scale}_{i}"]] for i in _AXES]) * np.array(shape))

    parts = [
        gain("K1", "M"),
        np.array([found[f"K0_{i}"] for i in _AXES]),
        gain("S", "T") * np.pi / 180.0,
        np.array([found[f"D_F_{i}"] for i in _AXES]),
        np.array([[found[f"G_{i}{j}"] for j in _AXES] for i in _AXES]),
    ]
    pairs = zip(parts, _imucal(name), strict=True)
    return np.concatenate([((own - other) / np.max(np.abs(other))).ravel() for own, other in pairs])


# The turntable of pyins, S M of the truth and its own largest errors.

TABLE_ACC = [
    [1.00761037725147, 0.001216750164928284, 0.004438632327454257],
    [0.0033367432737426684, 1.0149407907315762, -0.0020515826376580086],
    [0.003130677016509014, -0.008540957393017247, 0.9744701018416592],
]
TABLE_GYRO = [
    [1.0176405234596766, 0.004001572083672233, 0.009787379841057393],
    [0.022408931992014578, 1.0186755799014997, -0.00977277879876411],
    [0.009500884175255894, -0.001513572082976979, 0.9989678114820644],
]
TABLE_ACC_BIAS = (0.13041039201706542, 0.17227293074811315, -0.1481500012389673)


def _table_errors() -> Array:
    """Errors of 12 coefficients of the accelerometers over their standard uncertainties."""
    estimate, true = _calibrated("table"), np.array(TABLE_ACC)
    names = [f"K1_{i}" for i in _AXES] + [f"M_{i}{j}" for i in _AXES for j in _AXES if i != j]
    values = [*np.diag(true), *(true[i, j] / true[i, i] for i in range(3) for j in range(3) if i != j)]
    names, values = [*names, *(f"K0_{i}" for i in _AXES)], [*values, *TABLE_ACC_BIAS]
    return np.array(
        [(estimate[name].value - value) / estimate[name].u for name, value in zip(names, values, strict=True)]
    )


# The climatic chamber: cubics of six channels, from the third power down.

SWEEP = {
    "gyro_x": (-6.547811871319369e-08, 1.127144684294249e-05, -0.0002905713924390807, -0.06908658751315856),
    "gyro_y": (-6.692696824869698e-08, 1.2259127488900832e-05, 0.00016234193328487474, -0.014969894544332965),
    "gyro_z": (1.743340035571664e-08, 2.0666313069123659e-07, -4.339730106444391e-05, 0.01634952711564554),
    "acc_x": (2.3565592260835784e-07, -1.7257782114584635e-05, 0.0016967178848284702, 0.07860749576827548),
    "acc_y": (-6.680984331032979e-09, -2.6772656426330624e-05, 2.3876427284591425e-06, -0.015066456389145548),
    "acc_z": (-1.1029295987811692e-06, 0.0002934901998157676, -0.01624294389108818, -9.416356814994183),
}
_HOT = 74.0 ** np.arange(3, -1, -1)


def _sweep() -> Array:
    """Contribution of each power at 74 degC."""
    cubics = {curve.name: curve.polynomial for curve in fit_recording(record_of("thermal"), 0.0, 3).curves}
    return np.stack([cubics[name].coefficients[::-1] * _HOT for name in SWEEP])


# A simulated session without noise, and its calibration in the files of other tools.

_SEED = 20230518


@cache
def _session() -> tuple[Estimate, Array]:
    """Six positions and three turns of an instrument without noise: the calibration and the truth (33,)."""
    rng = np.random.default_rng(_SEED)
    record, truth = simulate_session(quiet(draw_full_truth(rng)), SessionCourse(), rng)
    settings = ImuSettings(Site(9.81), k2_u=0.0, method=FerrarisSettings())
    return calibrate(record, settings).estimate, true_values(truth)


def _session_errors() -> Array:
    """Coefficients less the truth, over the size of their kind."""
    estimate, true = _session()
    size = {"K0": 415.0, "K1": 415.0, "M": 1.0, "D_F": 4775.0, "S": 4775.0, "T": 1.0, "G": 478.0}
    sizes = np.array([size[name.rpartition("_")[0]] for name in TERMS_OF_FERRARIS])
    return np.asarray((np.array([estimate[name].value for name in TERMS_OF_FERRARIS]) - true) / sizes)


def _corrected(model: ImuModel) -> Array:
    """Specific force and rate (40, 3) from outputs all around the range, in m/s^2 and rad/s."""
    rng = np.random.default_rng(_SEED)
    acc, gyro = (size * rng.uniform(-1.0, 1.0, (20, 3)) for size in (4000.0, 9000.0))
    f, omega = model.correct(acc, gyro)
    assert omega is not None
    return np.concatenate([f, omega])


def _through(tool: str) -> float:
    """Largest difference that a calibration makes after it went through the files of a tool."""
    calibration = replace(_session()[0], result={"unit": _session()[0].result["unit"]})
    estimate = calibration if tool != "imu_tk" else _without_g(calibration)
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for middle, text in to_tool(estimate, tool).texts.items():
            paths.append(Path(folder) / f"cal{middle}.txt")
            paths[-1].write_text(text, encoding="utf-8")
        back = from_tool(paths, tool, {"acc": "count", "gyro": "count"})
    return float(np.max(np.abs(_corrected(imu_model(back)) - _corrected(imu_model(estimate)))))


def _without_g(estimate: Estimate) -> Estimate:
    """The calibration without g-sensitivity, for which imu_tk has no place."""
    values = np.where([name.startswith("G_") for name in estimate.names], 0.0, estimate.values)
    return replace(estimate, values=values)


CASES = (
    Case(
        "tedaldi-scale",
        "Accelerometers turned by hand through 38 poses: scale factors relative to the authors' program",
        "imu_tk",
        np.zeros(3),
        1.5e-4,
        lambda: _vector(_as_published(), "K1") / TK_SCALE - 1.0,
    ),
    Case(
        "tedaldi-misalignment",
        "Accelerometers turned by hand through 38 poses: misalignments",
        "imu_tk",
        TK_T,
        [1.1e-4, 4.7e-4, 1.1e-4],
        _tedaldi_misalignments,
        "rad",
    ),
    Case(
        "tedaldi-bias",
        "Accelerometers turned by hand through 38 poses: biases, over the scale factor",
        "imu_tk",
        np.zeros(3),
        2e-3,
        lambda: (_vector(_as_published(), "K0") - TK_BIAS) / TK_SCALE,
        "m/s^2",
    ),
    Case(
        "tedaldi-gyro-scale",
        "Gyro turned by hand between 38 poses: scale factors relative to the authors' program",
        "imu_tk",
        np.zeros(3),
        1.5e-3,
        lambda: _vector(_as_published(), "S") / TK_GYRO - 1.0,
    ),
    *(
        Case(
            f"imucal-{name}",
            "Six positions and three turns: 33 coefficients less those published, over the largest of their kind",
            "imucal",
            np.zeros(33),
            1e-11,
            lambda name=name: _ferraris(name),  # type: ignore[misc]
        )
        for name in IMUCAL
    ),
    Case(
        "table-accelerometer",
        "Two-axis table: scale factors and misalignments of the accelerometers against the truth",
        "pyins",
        TABLE_ACC,
        8.6109e-5,
        lambda: _matrix(_calibrated("table"), "K1", "M"),
    ),
    Case(
        "table-gyro",
        "Two-axis table: scale factors and misalignments of the gyro against the truth",
        "pyins",
        TABLE_GYRO,
        4.4216e-4,
        lambda: _matrix(_calibrated("table"), "S", "T"),
    ),
    Case(
        "table-uncertainty",
        "Two-axis table: errors of the 12 coefficients of the accelerometers are within 4 standard uncertainties",
        "truth",
        np.zeros(12),
        4.0,
        _table_errors,
        "u",
    ),
    Case(
        "thermal-cubics",
        "Output over temperature: each power of six cubics, at 74 degC",
        "TofuPilot",
        np.array(list(SWEEP.values())) * _HOT,
        1e-9,
        _sweep,
    ),
    Case(
        "ferraris-noiseless",
        "33 coefficients of a simulated session without noise are the true ones, relative to the size of their kind",
        "truth",
        np.zeros(33),
        2e-6,
        _session_errors,
    ),
    *(
        Case(
            f"through-{tool.replace('_', '-')}",
            f"A calibration written to the file of {tool} and read back corrects as before",
            "closed form",
            [0.0],
            1e-9,
            lambda tool=tool: [_through(tool)],  # type: ignore[misc]
            "m/s^2",
        )
        for tool in ("imu_tk", "imucal", "kalibr", "psins")
    ),
    *rows.CASES,
)
