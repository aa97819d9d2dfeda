"""The body of the commented study of a self-calibration."""

from __future__ import annotations

from typing import Final

SELFCAL: Final = """
schema = 1                          # version of this format

[site]                              # gravity and earth rate, in which the platform turns
latitude = "45(26) deg"             # north positive [deg]; replace it: this is anywhere in the north
height = "0(300) m"                 # above sea level [m]; replace it: this is most inhabited places
# gravity = "9.81744(2) m/s^2"      # local gravity if known [m/s^2]; wins over latitude and height

[rig]                               # the platform in its gimbals, and the base that carries them
kind = "three_axis_gimbals"         # joints x (outer), y (inner), z (of the platform)
heading = "0 deg"                   # of the base, from north to east [deg]; "0.00(2) deg" has an uncertainty
# tilt = ["0 arcsec", "0 arcsec"]   # of the base, about north and about east [arcsec]; level if absent
# frame = "nue"                     # axes of the platform at zero angles: north-up-east; or "enu", "ned"
# gimbals = ["z", "x", "y"]         # axis of the platform along which each joint lies at zero angles
# signs = [1, 1, 1]                 # of the angles: -1 where one counts left-handed

[rig.limits]                        # ranges of the joints; none if absent
# x = ["-180 deg", "180 deg"]       # lowest and highest outer angle [deg]
# y = ["-80 deg", "80 deg"]         # of the inner joint [deg]
# z = ["-360 deg", "360 deg"]       # of the joint of the platform [deg]

[plan]                              # turns one after the other: a joint and an angle, or ["rest", "60 s"]
turns = [["z", "180 deg"], ["x", "90 deg"], ["z", "-180 deg"], ["x", "90 deg"]]  # third entry: a rate of its own
# path = "best"                     # instead: a path by its name, "paper", "paper two turns", "best", "plain"
rate = "1 deg/s"                    # of the turns [deg/s]
step = "0.2 s"                      # from row to row [s]
# start = ["0 deg", "0 deg", "0 deg"]  # angles of the joints x, y, z at the start [deg]

[truth]                             # true coefficients of a simulation, x, y, z each; 0 where absent
kg0 = ["0.08 deg/h", "-0.06 deg/h", "0.10 deg/h"]  # gyro biases [deg/h]
eta = ["60 arcsec", "-90 arcsec", "120 arcsec"]  # misalignments pz, oy, oz of accelerometers [arcsec]
ds = ["60 arcsec", "-45 arcsec", "90 arcsec"]  # misalignments of gyros x, y, z about y, z, x [arcsec]
do = ["-75 arcsec", "50 arcsec", "-100 arcsec"]  # misalignments of gyros x, y, z about z, x, y [arcsec]
ka0 = ["100 ug", "-150 ug", "200 ug"]  # accelerometer biases [ug]
ka1 = ["500 ppm", "-300 ppm", "800 ppm"]  # accelerometer scale errors [ppm]
# kg1 = ["10 ppm", "0 ppm", "0 ppm"]  # gyro scale errors [ppm]
# beta = ["5 arcsec", "0 arcsec", "0 arcsec"]  # turn of the encoders' zero against the base [arcsec]

[noise]                             # of the instruments, each above zero
angle_random_walk = "5e-4 deg/sqrt(h)"  # of the gyros
accelerometer = "10 ug"             # standard deviation of a sample [ug]
encoder = "2 arcsec"                # standard deviation of a sample of an angle [arcsec]

[prior]                             # standard deviations about 0 before the test: one for a group, or three
kg0 = "0.3 deg/h"                   # of gyro biases [deg/h]
eta = "300 arcsec"                  # of misalignments eta of accelerometers, pz, oy, oz [arcsec]
ds = "300 arcsec"                   # of misalignments ds of gyros [arcsec]
do = "300 arcsec"                   # of misalignments do of gyros [arcsec]
ka0 = "500 ug"                      # of accelerometer biases [ug]
ka1 = "1500 ppm"                    # of accelerometer scale errors [ppm]
# kg1 = "100 ppm"                   # of gyro scale errors [ppm], where extended
# beta = "60 arcsec"                # of the encoders' zero [arcsec], where extended; heading and tilt add theirs

[goal]                              # wanted standard uncertainties: one for a group, or three; none if absent
# kg0 = "0.005 deg/h"               # of gyro biases [deg/h]
# eta = "1 arcsec"                  # of misalignments eta of accelerometers, pz, oy, oz [arcsec]
# ds = "1 arcsec"                   # of misalignments ds of gyros [arcsec]
# do = "1 arcsec"                   # of misalignments do of gyros [arcsec]
# ka0 = "1 ug"                      # of accelerometer biases [ug]
# ka1 = "1 ppm"                     # of accelerometer scale errors [ppm]
# kg1 = "1 ppm"                     # of gyro scale errors [ppm]
# beta = "1 arcsec"                 # of the encoders' zero [arcsec]

[filter]                            # the estimator
kind = "error-state"                # or "mukf", "svd-qukf", "gimbal-ukf", "map", "lm"; --filter overrides it
# extended = true                   # estimate gyro scale errors and the encoders' zero too [true, false]
# gating = "channel"                # near-level gating: "off", "any", "two" or "channel"
# gating_stops = "step"             # what gating stops: the "accelerometers" or the whole "step"
# factor = "svd"                    # of the covariance, for sigma points: "cholesky", "eigen", "svd"
# integration = "euler"             # of the gimbal angles, for gimbal-ukf: "rk4" or "euler"

[disturbances]                      # what a simulation adds to the model; nothing if absent
# dropouts = "1 %"                  # part of the rows without accelerometers and angles
# harmonics = [{ axis = "z", order = 2, amplitude = "5 arcsec", phase = "0 deg" }]  # errors of encoders
# command_delay = "0.2 s"           # by which the platform acts later than commanded [s]

[design]                            # search for a path
turns = 5                           # how many at most
# angle = "30 deg"                  # turns are multiples of it [deg]
# time = "540 s"                    # most that the path may take [s]; that of the plan if absent
# criterion = "mean"                # of all u on a log scale; or "worst", the largest u over goal or prior
# seed = 1                          # of the random starts
"""
"""All but the head and the tables that studies have in common; loads as it is, on a rig anywhere in the north."""
