"""The body of the commented study of an angle of attack."""

from __future__ import annotations

from typing import Final

AOA: Final = """
schema = 1                          # version of this format

[site]                              # its gravity is what the accelerometers measure the angle by
latitude = "45(26) deg"             # north positive [deg]; replace it: this is anywhere in the north
height = "0(300) m"                 # above sea level [m]; replace it: this is most inhabited places
# gravity = "9.81744(2) m/s^2"      # local gravity if known [m/s^2]; wins over latitude and height

[rig]                               # what carries the model
kind = "sting"                      # it pitches about a pivot; x forward, y left, z up, nose-up positive

# Accelerometers are a1, a2, .. without a hole: two or more, not all parallel; gyros: gyro, gyro_roll, gyro_yaw.
[sensors.a1]                        # by the name of its column; reads +g where its axis points up
axis = "-z"                         # where its input axis points: "+x", "-x", "+z" or "-z"
# angle = "90 deg"                  # instead: from +x (forward) towards -z (down) [deg]
r = "-0.25 m"                       # how far ahead of the pivot it sits [m, mm]
# z = "0 mm"                        # how far above the pivot [m, mm]
# scale = "0.5 g/V"                 # of a column in V or count; "16384 count/g" works too; a number corrects one in g
# bias = "1 mg"                     # what it indicates at zero input [mg], or in volts or counts
# range = "2 g"                     # at or beyond which it is saturated [g]
# scale_slope = "50 ppm/K"          # change of the scale with temperature [ppm/K]
# bias_slope = "10 ug/K"            # change of the bias with temperature [ug/K]
# temperature = "20 degC"           # at which scale and bias hold [degC]
# calibration = "a1.json"           # instead of scale and bias: a file that `inercal calibrate` wrote
# channel = "x"                     # axis of that calibration that this sensor is; "-x" where a map turns its sign

[sensors.a2]                        # the same keys
axis = "+x"                         # forward: the sine of the angle
r = "0.20 m"                        # how far ahead of the pivot it sits [m, mm]

[sensors.a3]                        # the same keys
axis = "+z"                         # up, against a1: the difference of the two is free of a common bias
r = "0.25 m"                        # how far ahead of the pivot it sits [m, mm]

[sensors.gyro]                      # nose-up positive (else sign = -1 in the map); gyro_roll, gyro_yaw likewise
# scale = "10 mV/(deg/s)"           # of a column in V or count; a number corrects one in deg/s
# bias = "0.1 deg/s"                # what it indicates at zero input [deg/s], or in volts or counts
# range = "40 deg/s"                # at or beyond which it is saturated [deg/s]
# scale_slope = "50 ppm/K"          # change of the scale with temperature [ppm/K]
# bias_slope = "1 deg/h/K"          # change of the bias with temperature [deg/h/K]
# temperature = "20 degC"           # at which scale and bias hold [degC]
# calibration = "gyro.json"         # instead of scale and bias: a file that `inercal calibrate` wrote
# channel = "-y"                    # axis of that calibration that this sensor is; "-y" where a map turns its sign

[noise]                             # standard deviations, each above zero
accelerometer = "1e-4 g"            # of a sample of an accelerometer [g]
accelerometer_bias = "1e-4 g"       # of the accelerometers' biases, half its variance common to all [g]
gyro = "0.2 deg/s"                  # of a sample of a gyro [deg/s]
gyro_bias = "5 deg/h"               # of the gyros' biases [deg/h]

[prior]                             # what else is not known of the sensors: standard deviations
# lever_common = "3 mm"             # of all positions r together, the pivot [mm]
# lever = "1 mm"                    # of each position r [mm]
# height = "5 mm"                   # of each height z [mm]
# gyro_scale = "0.1 %"              # of the gyro's scale [%]
# gyro_delay = "5 ms"               # of the gyro's delay, where it is estimated [ms]

[prior.heave]                       # flexure of the sting along z
# frequency = "9 Hz"                # of its resonance [Hz]
# damping = "0.3"                   # relative to critical
# level = "0.01 g"                  # standard deviation of the acceleration [g]

[prior.axial]                       # flexure of the sting along x
# frequency = "12 Hz"               # of its resonance [Hz]
# damping = "0.5"                   # relative to critical
# level = "0.01 g"                  # standard deviation of the acceleration [g]

[motion]                            # of a simulation; a recording can do without
kind = "sine"                       # or "static", "pitch-pause", "two-tone", "chirp", "buffet", "file"
duration = "60 s"                   # of all kinds but pitch-pause [s]; all of a file if absent
sample_rate = "1 kHz"               # samples per second [Hz]
mean = "30 deg"                     # sine, two-tone, chirp, buffet: middle [deg]
amplitude = "10 deg"                # sine, two-tone, chirp: half of the swing [deg]
frequency = "1 Hz"                  # sine, two-tone: of the sine [Hz]
# second_amplitude = "2 deg"        # two-tone: of the second sine [deg]
# second_frequency = "3 Hz"         # two-tone: of the second sine [Hz]
# low = "0.1 Hz"                    # chirp, buffet, pitch-pause: lowest frequency [Hz]
# high = "5 Hz"                     # chirp, buffet, pitch-pause: highest frequency [Hz]
# rms = "0.2 deg"                   # buffet, pitch-pause: of the random part [deg]
# first = "-10 deg"                 # static, pitch-pause: angle at the start [deg]
# last = "90 deg"                   # static, pitch-pause: angle at the end [deg]
# step = "10 deg"                   # pitch-pause: from pause to pause, negative downward [deg]
# move = "1.5 s"                    # pitch-pause: time of a move [s]
# pause = "4 s"                     # pitch-pause: time of a pause [s]
# file = "pitch.csv"                # file: a record with the columns t and theta_ref, beside the study

[disturbances]                      # what a simulation adds to the model; nothing if absent
# pitch = { rms = "0.1 deg", low = "8 Hz", high = "10 Hz" }  # flexure of the sting in pitch [deg]
# heave = { rms = "0.03 g", low = "8 Hz", high = "10 Hz" }  # flexure along z [g]
# axial = { rms = "0.005 g", low = "14 Hz", high = "16 Hz" }  # flexure along x [g]
# roll = { amplitude = "1 deg", frequency = "8 Hz" }  # roll coupled in [deg]; adds gyro_roll and gyro_yaw
# yaw = { amplitude = "1 deg", frequency = "8 Hz" }  # yaw coupled in [deg]; adds gyro_roll and gyro_yaw
# pivot = "3 mm"                    # added to all positions r [mm]
# heights = ["5 mm", "-3 mm", "5 mm"]  # added to the heights z, one for each accelerometer [mm]
# gyro_scale = "0.1 %"              # scale error of the gyro [%]
# gyro_delay = "2 ms"               # by which the gyro comes later than the accelerometers [ms]
# common_delay = "0.5 ms"           # by which all sensors come later than their stamps [ms]
# bandwidth = "100 Hz"              # of all sensors, first order [Hz]; no limit if absent
# spikes = "0.01 %"                 # part of the samples of each sensor that are spikes [%]
# spike = "0.5 g"                   # size of a spike [g], of a gyro 1 rad/s for each g
# clip = false                      # limit sensors to their ranges [true, false]
# dropouts = "1 %"                  # part of the rows that are empty [%]

[timing]                            # delays, positive where outputs come late
# gyro_delay = "estimate"           # of the gyro against the accelerometers: or "2 ms" [ms]; 0 if absent
# common_delay = "0.5(1) ms"        # of all sensors against the stamps [ms]: none of them sees it; 0 if absent

[estimator]                         # the fusion of all sensors
states = 19                         # or 15, 11, 8: fewer errors of the sensors are estimated [8, 11, 15, 19]
# smooth = true                     # use later samples too [true, false]
# prior = "last.json"               # result of an earlier run: its posterior is the prior of this one
# snap = "2e7 rad^2/s^7"            # density of the angle's fourth derivative; 1e7, 1e8 from 15 states on, if absent
# gate = 16.0                       # innovation squared over its variance from which samples are held back; 25

[methods]                           # the paper's way, where --static, --centrifugal or --tangential asks for it
# static = "difference"             # "segmented", "complementary", "improved" if absent, "difference", "gls"
# centrifugal = "decision"          # "none", "low-pass", "mechanical" if absent, "decision"
# tangential = "differentiated"     # "none", "differentiated", "dual" if absent

[model]                             # how the model lies beside its pitch: then alpha and beta are given too
# roll = "2.0(1) deg"               # right wing down [deg]
# yaw = "0.5(1) deg"                # nose left of the tunnel's axis [deg]

[flow]                              # angularity of the flow: then alpha and beta are given too
# upwash = "0.10(2) deg"            # of a stream that rises [deg]
# sidewash = "0.05(2) deg"          # of a stream that comes from the right [deg]

# [zero]                            # take the "# " from the next lines too for a stretch wind off, at a known angle
# start = "0 s"                     # of the stretch, in the record's time [s]
# end = "5 s"                       # of the stretch [s]
# angle = "0.00(1) deg"             # pitch in that stretch, with its standard uncertainty [deg]
"""
"""All but the head and the tables that studies have in common; loads as it is, in a tunnel anywhere in the north."""
