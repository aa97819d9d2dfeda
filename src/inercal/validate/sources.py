"""Sources of the expected numbers of the cases."""

from __future__ import annotations

#: as a line of the command names it -> in full
SOURCES = {
    "GUM H.3": "JCGM 100:2008, Guide to the expression of uncertainty in measurement, H.3 (thermometer), table H.6 "
    "and H.3.3, H.3.4",
    "GUM table G.2": "JCGM 100:2008, table G.2: t_p(nu) for p = 95.45 %",
    "NIST StRD": "NIST Statistical Reference Datasets, regression: certified values",
    "NIST SP 1065": "W. J. Riley and D. A. Howe, Handbook of Frequency Stability Analysis, NIST SP 1065 (2008), "
    "section 12.4, tables 30 and 31; the first from NBS Monograph 140, annex 8.E",
    "Stable32": "W. J. Riley, Stable32 1.60, overlapping Allan deviation of its data set PHASE.DAT, which is the sum "
    "of the 1000 numbers of NIST SP 1065",
    "AllanTools": "AllanTools 2024.6 (A. Wallin and others), oadev, run on the recording of PSINS that ships",
    "WGS 84": "NIMA TR8350.2, Department of Defense World Geodetic System 1984, third edition, amendment 1 (2000), "
    "tables 3.1 and 3.4, normal gravity",
    "SI brochure": "BIPM, The International System of Units, 9th edition (2019), table 8; standard gravity: third CGPM "
    "(1901)",
    "imu_tk": "D. Tedaldi, A. Pretto, E. Menegatti, A robust and easy to implement method for IMU calibration without "
    "external equipments, ICRA 2014: their program imu_tk on their recording; limits: by how much it and the authors' "
    "MATLAB program differ, or what the scatter of poses and turns leaves (standard uncertainty of M_xz, expanded one "
    "of the gyro)",
    "imucal": "imucal 2.6.0 (A. Kuederle and others), results published with its example sessions",
    "pyins": "pyins 8377ede (N. Mayorov), simulated turntable, truth of the simulation; limits: the largest errors of "
    "pyins' own calibration of it",
    "TofuPilot": "TofuPilot examples fc190f7, thermal calibration: its cubic fits of the recording that ships",
    "Zhao 2023": "Zhao et al. 2023, on the errors of a two-axis turntable: its statements that hold, in closed form to "
    "leading order",
    "Tan 2021": "Tan et al. 2021, Large angle-of-attack measurement architecture for wind-tunnel models based on "
    "inertial technology: its figures, under the conditions in which they hold",
    "closed form": "a closed form or an identity that the case states",
    "truth": "the truth behind a simulation; limits from statistics",
}
