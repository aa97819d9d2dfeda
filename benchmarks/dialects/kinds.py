"""The dialects: how the logs of people, instruments and programs look, each from what its maker says in public.

A dialect has a name, a motion, a rate, a maker of its bytes, and what is in it. ``asks`` is the word that a reader has to
ask for, since nothing in the file tells; ``rate`` 0: the file has no times, and the reader is told the rate.
"""

from dataclasses import dataclass

from .written import json_lines, messages, table

ALL = "ax {a},ay {a},az {a},gx {g},gy {g},gz {g}"


@dataclass(frozen=True)
class Dialect:
    name: str
    file: str
    make: object
    acc: bool = True
    gyro: bool = True
    t: bool = True
    motion: str = "poses"
    rate: float = 100.0
    asks: str = ""
    counts: bool = False  # outputs of unknown scale: compared as they are


def both(a="m/s^2", g="rad/s", first="t s"):
    return f"{first}," + ALL.format(a=a, g=g)


def text(name, keys, header, file="log.csv", say=None, **how):
    return Dialect(name, file, lambda truth: table(truth, keys, header, **how), **(say or {}))


SI = both()
PHONES = [
    text(
        "phyphox acceleration",
        "t s,ax m/s^2,ay m/s^2,az m/s^2,9.8",
        '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)","Absolute acceleration (m/s^2)"',
        say={"gyro": False},
    ),
    text(
        "phyphox gyroscope",
        "t s,gx rad/s,gy rad/s,gz rad/s,0.1",
        '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)","Absolute (rad/s)"',
        "Gyroscope.csv",
        {"acc": False},
        mark="\t",
    ),
    text(
        "phyphox decimal comma",
        "t s,gx rad/s,gy rad/s,gz rad/s,0.1",
        '"Time (s)";"Gyroscope x (rad/s)";"Gyroscope y (rad/s)";"Gyroscope z (rad/s)";"Absolute (rad/s)"',
        "Gyroscope.csv",
        {"acc": False},
        mark=";",
        decimal=",",
    ),
    text(
        "Sensor Logger accelerometer",
        "t unix_ns,t s,az m/s^2,ay m/s^2,ax m/s^2",
        "time,seconds_elapsed,z,y,x",
        "TotalAcceleration.csv",
        {"gyro": False},
    ),
    text(
        "Sensor Logger gyroscope",
        "t unix_ns,t s,gz rad/s,gy rad/s,gx rad/s",
        "time,seconds_elapsed,z,y,x",
        "Gyroscope.csv",
        {"acc": False},
    ),
    text(
        "SensorLog iOS",
        "@%Y-%m-%d %H:%M:%S.%L,t unix,ax g,ay g,az g,t s,gx rad/s,gy rad/s,gz rad/s,mx,my,mz",
        "loggingTime(txt),loggingSample(N),accelerometerAccelerationX(G),accelerometerAccelerationY(G),accelerometerAccelerationZ(G),gyroTimestamp_sinceReboot(s),gyroRotationX(rad/s),gyroRotationY(rad/s),gyroRotationZ(rad/s),magnetometerX(µT),magnetometerY(µT),magnetometerZ(µT)",
    ),
    text("Physics Toolbox", "t s,ax g,ay g,az g,gx rad/s,gy rad/s,gz rad/s", "time,gFx,gFy,gFz,wx,wy,wz"),
    text(
        "AndroSensor",
        "ax m/s^2,ay m/s^2,az m/s^2,0.1,0.2,9.8,gx rad/s,gy rad/s,gz rad/s,mx,my,mz,t ms,@%Y-%m-%d %H:%M:%S:%L",
        "ACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);ACCELEROMETER Z (m/s²);GRAVITY X (m/s²);GRAVITY Y (m/s²);GRAVITY Z (m/s²);GYROSCOPE X (rad/s);GYROSCOPE Y (rad/s);GYROSCOPE Z (rad/s);MAGNETIC FIELD X (μT);MAGNETIC FIELD Y (μT);MAGNETIC FIELD Z (μT);Time since start in ms;YYYY-MO-DD HH-MI-SS_SSS",
        mark=";",
    ),
    text(
        "Matlab Mobile",
        "@%d-%b-%Y %H:%M:%S.%L,ax m/s^2,ay m/s^2,az m/s^2",
        "Timestamp,X,Y,Z",
        "Acceleration.csv",
        {"gyro": False},
    ),
    text(
        "HyperIMU",
        "t unix_ms,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        "Timestamp,ACC.x,ACC.y,ACC.z,GYRO.x,GYRO.y,GYRO.z",
    ),
    text(
        "Sensor Kinetics",
        "t s,ax m/s^2,ay m/s^2,az m/s^2",
        "time,X_value,Y_value,Z_value",
        "accelerometer.csv",
        {"gyro": False},
        above="# name: Accelerometer Sensor\n# vendor: X\n# resolution: 0.0011",
    ),
    text(
        "Arduino Science Journal",
        "t unix_ms,ax m/s^2,ay m/s^2,az m/s^2",
        "timestamp,AccX,AccY,AccZ",
        say={"gyro": False},
    ),
    Dialect(
        "JSON array of an app",
        "log.json",
        lambda truth: json_lines(
            truth,
            {
                "time": "t unix_ms",
                "acc": {"x": "ax m/s^2", "y": "ay m/s^2", "z": "az m/s^2"},
                "gyro": {"x": "gx rad/s", "y": "gy rad/s", "z": "gz rad/s"},
            },
            whole=True,
        ),
    ),
]
VENDORS = [
    text(
        "Xsens MT Manager",
        "row 100,t s,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s,mx,my,mz",
        "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tMag_X\tMag_Y\tMag_Z",
        "MT_012005D6.txt",
        mark="\t",
        above="// General information:\n//  MT Manager version: 2022\n//  Update Rate: 100.0Hz\n//  Filter Profile: General",
    ),
    text(
        "Movella DOT",
        "row,t us,ax m/s^2,ay m/s^2,az m/s^2,gx deg/s,gy deg/s,gz deg/s",
        "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z",
        above="sep=,\nDeviceTag: left foot\nFirmwareVersion: 2.2.0\nOutputRate: 100Hz",
    ),
    text(
        "Shimmer",
        "t unix_ms,ax m/s^2,ay m/s^2,az m/s^2,gx deg/s,gy deg/s,gz deg/s",
        "Shimmer_7A1B_Timestamp_Unix_CAL\tShimmer_7A1B_Accel_LN_X_CAL\tShimmer_7A1B_Accel_LN_Y_CAL\tShimmer_7A1B_Accel_LN_Z_CAL\tShimmer_7A1B_Gyro_X_CAL\tShimmer_7A1B_Gyro_Y_CAL\tShimmer_7A1B_Gyro_Z_CAL",
        mark="\t",
        units="ms\tm/(s^2)\tm/(s^2)\tm/(s^2)\tdeg/s\tdeg/s\tdeg/s",
        above='"sep=\t"',
    ),
    text(
        "x-io x-IMU3",
        "t us,gx deg/s,gy deg/s,gz deg/s,ax g,ay g,az g",
        "Timestamp (us),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)",
        "Inertial.csv",
    ),
    text(
        "x-IMU CalInertialAndMag",
        "row,gx deg/s,gy deg/s,gz deg/s,ax g,ay g,az g,mx,my,mz",
        "Packet number,Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g),Magnetometer X (G),Magnetometer Y (G),Magnetometer Z (G)",
        "LoggedData_CalInertialAndMag.csv",
        {"t": False},
    ),
    text(
        "MbientLab accelerometer",
        "t unix_ms,@%Y-%m-%dT%H:%M:%S.%L,t s,ax g,ay g,az g",
        "epoc (ms),timestamp (+0200),elapsed (s),x-axis (g),y-axis (g),z-axis (g)",
        "MetaWear_Accelerometer.csv",
        {"gyro": False},
    ),
    text(
        "MbientLab gyroscope",
        "t unix_ms,@%Y-%m-%dT%H:%M:%S.%L,t s,gx deg/s,gy deg/s,gz deg/s",
        "epoc (ms),timestamp (+0200),elapsed (s),x-axis (deg/s),y-axis (deg/s),z-axis (deg/s)",
        "MetaWear_Gyroscope.csv",
        {"acc": False},
    ),
    text(
        "WitMotion",
        "@%Y-%m-%d %H:%M:%S.%L,=WTB-1,ax g,ay g,az g,gx deg/s,gy deg/s,gz deg/s,0.1,0.2,0.3,T",
        "time\tDeviceName\tAccX(g)\tAccY(g)\tAccZ(g)\tAsX(°/s)\tAsY(°/s)\tAsZ(°/s)\tAngleX(°)\tAngleY(°)\tAngleZ(°)\tTemperature(°C)",
        "20251127.txt",
        mark="\t",
    ),
    text(
        "Noraxon",
        "t s,ax mg,ay mg,az mg,gx deg/s,gy deg/s,gz deg/s",
        "time,Noraxon MyoMotion-Segments-Pelvis-Accel X (mG),Noraxon MyoMotion-Segments-Pelvis-Accel Y (mG),Noraxon MyoMotion-Segments-Pelvis-Accel Z (mG),Noraxon MyoMotion-Segments-Pelvis-Gyro X (deg/s),Noraxon MyoMotion-Segments-Pelvis-Gyro Y (deg/s),Noraxon MyoMotion-Segments-Pelvis-Gyro Z (deg/s)",
    ),
    text(
        "Delsys with a column of times each",
        "t s,ax g,t s,ay g,t s,az g",
        "X [s],Avanti 1: ACC.X 1 [g],X [s],Avanti 1: ACC.Y 1 [g],X [s],Avanti 1: ACC.Z 1 [g]",
        say={"gyro": False},
    ),
    text(
        "ST Unicleo",
        "t ms,ax mg,ay mg,az mg,gx mdeg/s,gy mdeg/s,gz mdeg/s",
        "T [ms]\tACC_X [mg]\tACC_Y [mg]\tACC_Z [mg]\tGYRO_X [mdps]\tGYRO_Y [mdps]\tGYRO_Z [mdps]",
        "log.txt",
        mark="\t",
    ),
    text(
        "ST AlgoBuilder",
        "t s,ax g,ay g,az g,gx deg/s,gy deg/s,gz deg/s",
        "timestamp[s]\tacc_x[g]\tacc_y[g]\tacc_z[g]\tgyro_x[dps]\tgyro_y[dps]\tgyro_z[dps]",
        "log.tsv",
        mark="\t",
    ),
    text(
        "Bosch counts",
        "t us,ax lsb16384,ay lsb16384,az lsb16384,gx lsb16.4,gy lsb16.4,gz lsb16.4",
        "t_us,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z",
        "bmi270.csv",
        {"counts": True},
    ),
    text(
        "ADI evaluation",
        "row,gx lsb10,gy lsb10,gz lsb10,ax lsb800,ay lsb800,az lsb800,T",
        "SEQ,X_GYRO,Y_GYRO,Z_GYRO,X_ACCL,Y_ACCL,Z_ACCL,TEMP",
        "adis16470.csv",
        {"t": False, "counts": True},
    ),
    text(
        "LORD SensorConnect",
        "t unix_ns,ax g,ay g,az g,gx rad/s,gy rad/s,gz rad/s",
        "Time,6284.91.scaledAccelX,6284.91.scaledAccelY,6284.91.scaledAccelZ,6284.91.scaledGyroX,6284.91.scaledGyroY,6284.91.scaledGyroZ",
        above="DATA_START",
    ),
    Dialect(
        "VectorNav VNIMU",
        "vn.txt",
        lambda truth: messages(
            truth,
            [
                "$VNIMU,{mx},{my},{mz},{ax m/s^2},{ay m/s^2},{az m/s^2},{gx rad/s},{gy rad/s},{gz rad/s},{T},{P}*CS"
            ],
        ),
        t=False,
    ),
    Dialect(
        "VectorNav YMR",
        "vn100.log",
        lambda truth: messages(
            truth,
            [
                "$VNYMR,+010.071,+000.278,-002.026,{mx},{my},{mz},{ax m/s^2},{ay m/s^2},{az m/s^2},{gx rad/s},{gy rad/s},{gz rad/s}*CS"
            ],
        ),
        t=False,
    ),
    Dialect(
        "Razor AHRS",
        "razor.txt",
        lambda truth: messages(
            truth,
            [
                "#A-R={ax lsb256},{ay lsb256},{az lsb256}",
                "#M-R={mx},{my},{mz}",
                "#G-R={gx lsb14.375},{gy lsb14.375},{gz lsb14.375}",
            ],
        ),
        t=False,
        counts=True,
    ),
    Dialect(
        "SBG ASCII",
        "sbg.txt",
        lambda truth: messages(
            truth,
            ["{t us}\t0x01FF\t{ax m/s^2}\t{ay m/s^2}\t{az m/s^2}\t{gx deg/s}\t{gy deg/s}\t{gz deg/s}\t{T}"],
            above="timestamp\tstatus\taccelX\taccelY\taccelZ\tgyroX\tgyroY\tgyroZ\ttemp\n(us)\t(NA)\t(m.s^-2)\t(m.s^-2)\t(m.s^-2)\t(deg.s^-1)\t(deg.s^-1)\t(deg.s^-1)\t(degC)",
        ),
    ),
    text(
        "Inertial Sense",
        "t s,gx rad/s,gy rad/s,gz rad/s,ax m/s^2,ay m/s^2,az m/s^2",
        "time(s),pqr[0](rad/s),pqr[1](rad/s),pqr[2](rad/s),acc[0](m/s^2),acc[1](m/s^2),acc[2](m/s^2)",
        "LOG_IMU.csv",
    ),
    text(
        "KVH",
        "row,gx rad/s,gy rad/s,gz rad/s,ax g,ay g,az g,T",
        "Seq,GyroX_rad_per_sec,GyroY_rad_per_sec,GyroZ_rad_per_sec,AccelX_g,AccelY_g,AccelZ_g,Temp_C",
        say={"t": False},
    ),
    text(
        "APDM",
        "t unix_us,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        "Time_us,Accelerometer_X,Accelerometer_Y,Accelerometer_Z,Gyroscope_X,Gyroscope_Y,Gyroscope_Z",
        "Monitor-738.csv",
    ),
    text(
        "Emlid",
        "t s,ax g,ay g,az g,gx deg/s,gy deg/s,gz deg/s",
        "time_s acc_x_g acc_y_g acc_z_g gyro_x_dps gyro_y_dps gyro_z_dps",
        "navio.txt",
        mark=" ",
    ),
]
ROBOTS = [
    text(
        "EuRoC",
        "t unix_ns,gx rad/s,gy rad/s,gz rad/s,ax m/s^2,ay m/s^2,az m/s^2",
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
        "data.csv",
    ),
    text(
        "Kalibr",
        "t unix_ns,gx rad/s,gy rad/s,gz rad/s,ax m/s^2,ay m/s^2,az m/s^2",
        "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z",
        "imu0.csv",
    ),
    text(
        "TUM",
        "t unix,ax m/s^2,ay m/s^2,az m/s^2",
        "# timestamp ax ay az",
        "accelerometer.txt",
        {"gyro": False},
        mark=" ",
        above="# accelerometer data\n# file: 'freiburg1'",
    ),
    text(
        "rostopic echo -p",
        "t unix_ns,row,t unix_ns,=imu_link,qx,qy,qz,qw,gx rad/s,gy rad/s,gz rad/s,ax m/s^2,ay m/s^2,az m/s^2",
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.orientation.x,field.orientation.y,field.orientation.z,field.orientation.w,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z",
        "imu.txt",
    ),
    text(
        "PlotJuggler",
        "t unix,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        "__time,/imu/linear_acceleration/x,/imu/linear_acceleration/y,/imu/linear_acceleration/z,/imu/angular_velocity/x,/imu/angular_velocity/y,/imu/angular_velocity/z",
    ),
    Dialect("ros2 topic echo", "imu.yaml", lambda truth: _ros_documents(truth)),
    text(
        "PX4 ulog2csv",
        "t us,gx rad/s,gy rad/s,gz rad/s,4000,0,ax m/s^2,ay m/s^2,az m/s^2,4000",
        "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt,accelerometer_timestamp_relative,accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2],accelerometer_integral_dt",
    ),
    Dialect(
        "ArduPilot text log",
        "log.log",
        lambda truth: messages(
            truth,
            [
                "IMU, {t us}, 0, {gx rad/s}, {gy rad/s}, {gz rad/s}, {ax m/s^2}, {ay m/s^2}, {az m/s^2}",
                "BARO, {t us}, 12.1, {P}, {T}",
            ],
            above="FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nFMT, 131, 52, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\nFMT, 132, 30, BARO, Qfff, TimeUS,Alt,Press,Temp\nPARM, 900, SYSID, 1",
        ),
    ),
    text(
        "Betaflight blackbox",
        "row,t us,gx lsb1,gy lsb1,gz lsb1,ax lsb2048,ay lsb2048,az lsb2048",
        "loopIteration,time (us),gyroADC[0],gyroADC[1],gyroADC[2],accSmooth[0],accSmooth[1],accSmooth[2]",
        "LOG00001.csv",
        {"counts": True},
    ),
    text(
        "INAV",
        "t us,gx lsb1,gy lsb1,gz lsb1,ax lsb512,ay lsb512,az lsb512",
        "time (us),gyroADC[0],gyroADC[1],gyroADC[2],accSmooth[0],accSmooth[1],accSmooth[2]",
        say={"counts": True},
    ),
    Dialect(
        "Gyroflow gcsv",
        "log.gcsv",
        lambda truth: table(
            truth,
            "row,gx lsb16.4,gy lsb16.4,gz lsb16.4,ax lsb2048,ay lsb2048,az lsb2048",
            "t,gx,gy,gz,ax,ay,az",
            above="GYROFLOW IMU LOG\nversion,1.3\nid,custom\norientation,YxZ\ntscale,0.01\ngscale,0.00106526443\nascale,0.00048828125",
        ),
    ),
    text(
        "KITTI raw",
        "ax m/s^2,ay m/s^2,az m/s^2,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        "ax ay az af al au wx wy wz",
        "oxts.txt",
        {"t": False, "asks": "which"},
        mark=" ",
    ),
    text(
        "NCLT",
        "t unix_us,mx,my,mz,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        "utime,mag_x,mag_y,mag_z,accel_x,accel_y,accel_z,rot_r,rot_p,rot_h",
        "ms25.csv",
        {"gyro": True},
    ),
    text(
        "OpenVINS states",
        "t s,gx rad/s,gy rad/s,gz rad/s,ax m/s^2,ay m/s^2,az m/s^2",
        "# time(s) wm(3) am(3)",
        "imu.txt",
        {"asks": "gyro"},
        mark=" ",
    ),
    text("ADVIO", "t s,ax g,ay g,az g", "", "accelerometer.csv", {"gyro": False}),
    text("ADVIO gyro", "t s,gx rad/s,gy rad/s,gz rad/s", "", "gyro.csv", {"acc": False, "asks": "gyro"}),
    text(
        "RealSense",
        "=Gyro,row,t ms,gx rad/s,gy rad/s,gz rad/s",
        "Stream Type,F#,HW Timestamp (ms),X,Y,Z",
        "d435i.csv",
        {"acc": False},
    ),
    text(
        "ZED",
        "t unix_ns,ax m/s^2,ay m/s^2,az m/s^2,gx deg/s,gy deg/s,gz deg/s",
        "timestamp_ns,linear_acceleration_x,linear_acceleration_y,linear_acceleration_z,angular_velocity_x,angular_velocity_y,angular_velocity_z",
    ),
    text(
        "UZH-FPV",
        "row,t unix,gx rad/s,gy rad/s,gz rad/s,ax m/s^2,ay m/s^2,az m/s^2",
        "# id timestamp ang_vel_x ang_vel_y ang_vel_z lin_acc_x lin_acc_y lin_acc_z",
        "imu.txt",
        mark=" ",
    ),
    text(
        "RIDI",
        "t ns,gx rad/s,gy rad/s,gz rad/s,ax m/s^2,ay m/s^2,az m/s^2,0.1,0.2,9.8,qw,qx,qy,qz",
        "time,gyro_x,gyro_y,gyro_z,acce_x,acce_y,acce_z,grav_x,grav_y,grav_z,ori_w,ori_x,ori_y,ori_z",
    ),
]


def _ros_documents(truth):
    """``ros2 topic echo``: documents with two blanks a level."""
    template = "header:\n  stamp:\n    sec: 100\n    nanosec: {t ns}\n  frame_id: imu\norientation:\n  x: 0.0\n  y: 0.0\n  z: 0.0\n  w: 1.0\nangular_velocity:\n  x: {gx rad/s}\n  y: {gy rad/s}\n  z: {gz rad/s}\nlinear_acceleration:\n  x: {ax m/s^2}\n  y: {ay m/s^2}\n  z: {az m/s^2}\n---"
    return messages(truth, [template])


MAKERS = [
    Dialect(
        "Serial plotter words",
        "putty.log",
        lambda truth: messages(
            truth,
            [
                "AccX:{ax m/s^2} AccY:{ay m/s^2} AccZ:{az m/s^2} GyroX:{gx rad/s} GyroY:{gy rad/s} GyroZ:{gz rad/s}"
            ],
        ),
        t=False,
    ),
    Dialect(
        "Adafruit sketch",
        "capture.txt",
        lambda truth: messages(
            truth,
            [
                "\t\tTemperature {T} deg C",
                "\t\tAccel X: {ax m/s^2} \tY: {ay m/s^2} \tZ: {az m/s^2} m/s^2 ",
                "\t\tGyro X: {gx rad/s} \tY: {gy rad/s} \tZ: {gz rad/s} radians/s ",
            ],
        ),
        t=False,
    ),
    Dialect(
        "SparkFun sketch",
        "capture.log",
        lambda truth: messages(
            truth,
            [
                "Scaled. Acc (mg) [ {ax mg}, {ay mg}, {az mg} ], Gyr (DPS) [ {gx deg/s}, {gy deg/s}, {gz deg/s} ], Mag (uT) [ {mx}, {my}, {mz} ], Tmp (C) [ {T} ]"
            ],
        ),
        t=False,
    ),
    Dialect(
        "MPU6050 tabs a/g",
        "teraterm.log",
        lambda truth: messages(
            truth,
            ["a/g:\t{ax lsb16384}\t{ay lsb16384}\t{az lsb16384}\t{gx lsb131}\t{gy lsb131}\t{gz lsb131}"],
        ),
        t=False,
        counts=True,
    ),
    Dialect(
        "Arduino IDE stamps",
        "monitor.txt",
        lambda truth: messages(
            truth, ["{@%H:%M:%S.%L} -> {ax g},{ay g},{az g},{gx deg/s},{gy deg/s},{gz deg/s}"]
        ),
    ),
    text(
        "OpenLog Artemis",
        "@%m/%d/%Y,@%H:%M:%S.%L,ax mg,ay mg,az mg,gx deg/s,gy deg/s,gz deg/s,mx,my,mz,T,100.0,row",
        "rtcDate,rtcTime,aX,aY,aZ,gX,gY,gZ,mX,mY,mZ,imu_degC,output_Hz,count",
        "dataLog00001.TXT",
    ),
    text(
        "micro seconds, short names",
        "t us,ax m/s^2,ay m/s^2,az m/s^2,gx deg/s,gy deg/s,gz deg/s",
        "micros,ax,ay,az,gx,gy,gz",
    ),
    text(
        "German CSV",
        "t s,ax m/s^2,ay m/s^2,az m/s^2,gx deg/s,gy deg/s,gz deg/s",
        "Zeit [s];Beschleunigung X [m/s²];Beschleunigung Y [m/s²];Beschleunigung Z [m/s²];Drehrate X [°/s];Drehrate Y [°/s];Drehrate Z [°/s]",
        mark=";",
        decimal=",",
        encoding="latin-1",
    ),
    text(
        "French CSV",
        "t s,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        "temps (s);accélération x (m/s²);accélération y (m/s²);accélération z (m/s²);vitesse angulaire x (rad/s);vitesse angulaire y (rad/s);vitesse angulaire z (rad/s)",
        mark=";",
        decimal=",",
    ),
    text(
        "Spanish CSV",
        "t s,ax m/s^2,ay m/s^2,az m/s^2,gx deg/s,gy deg/s,gz deg/s",
        "tiempo;aceleracion_x;aceleracion_y;aceleracion_z;giro_x;giro_y;giro_z",
        mark=";",
    ),
    text(
        "Italian CSV",
        "t ms,ax g,ay g,az g,gx deg/s,gy deg/s,gz deg/s",
        "tempo_ms,accelerazione_x,accelerazione_y,accelerazione_z,giroscopio_x,giroscopio_y,giroscopio_z",
    ),
    text(
        "Chinese CSV",
        "t s,ax g,ay g,az g,gx deg/s,gy deg/s,gz deg/s",
        "时间(s),加速度X(g),加速度Y(g),加速度Z(g),角速度X(°/s),角速度Y(°/s),角速度Z(°/s)",
    ),
    text(
        "camel case with units",
        "t ms,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        "timeMs,accelXMps2,accelYMps2,accelZMps2,gyroXRadps,gyroYRadps,gyroZRadps",
    ),
    text(
        "snake case with units",
        SI,
        "timestamp_s,linear_accel_x_m_s2,linear_accel_y_m_s2,linear_accel_z_m_s2,angular_rate_x_rad_s,angular_rate_y_rad_s,angular_rate_z_rad_s",
    ),
    text(
        "units row in brackets",
        both("g", "deg/s"),
        "Time,AccX,AccY,AccZ,GyrX,GyrY,GyrZ",
        units="[s],[g],[g],[g],[deg/s],[deg/s],[deg/s]",
    ),
    text("numbered axes", both("g", "deg/s"), "Time_s,Acc1_g,Acc2_g,Acc3_g,Gyro1_dps,Gyro2_dps,Gyro3_dps"),
    text(
        "index and names of a frame",
        "row,t s,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        ",time,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z",
    ),
    text(
        "R table with row names",
        "row 1,t s,ax m/s^2,ay m/s^2,az m/s^2,gx rad/s,gy rad/s,gz rad/s",
        '"time" "ax" "ay" "az" "gx" "gy" "gz"',
        "log.txt",
        mark=" ",
    ),
    text(
        "trailing commas", both("g", "deg/s"), "time,accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z,", tail=","
    ),
    text(
        "carriage returns and a mark",
        both("g", "deg/s"),
        "\ufefftime (s),accel x (g),accel y (g),accel z (g),gyro x (dps),gyro y (dps),gyro z (dps)",
        end="\r\n",
    ),
    text(
        "UTF-16",
        both("g", "deg/s"),
        "time (s)\taccel x (g)\taccel y (g)\taccel z (g)\tgyro x (dps)\tgyro y (dps)\tgyro z (dps)",
        "export.txt",
        mark="\t",
        encoding="utf-16",
    ),
    text("no heading, times", both(), "", "raw.txt", mark=" "),
    text("no heading, tabs, g", both("g", "rad/s"), "", "imu.dat", mark="\t"),
    text(
        "no heading, gyro first", "t s,gx rad/s,gy rad/s,gz rad/s,ax m/s^2,ay m/s^2,az m/s^2", "", "imu.txt"
    ),
    text("no heading, at rest", both(), "", "static.txt", {"motion": "rest", "asks": "gyro"}, mark=","),
    text("no heading, no times", ALL.format(a="g", g="deg/s"), "", "samples.csv", {"t": False}),
    text("heading behind a hash", both(), "# t, ax, ay, az, wx, wy, wz"),
    text(
        "semicolons of a preamble",
        both("mg", "deg/s"),
        "t;ax;ay;az;gx;gy;gz",
        mark=";",
        above="Test;Gyro 7;;;;;\nOperator;A. B.;;;;;\nUnits;s;mg;mg;mg;deg/s;deg/s;deg/s",
    ),
    text(
        "counts with a clock",
        "t ms,ax lsb4096,ay lsb4096,az lsb4096,gx lsb32.8,gy lsb32.8,gz lsb32.8",
        "ms,AX,AY,AZ,GX,GY,GZ",
        say={"counts": True},
    ),
    text(
        "blanks to columns",
        both("m/s^2", "deg/s"),
        "      t        fx        fy        fz        p        q        r",
        "flight.txt",
        mark="    ",
    ),
    text("rates p q r", both("m/s^2", "rad/s"), "time_s,fx_mps2,fy_mps2,fz_mps2,p_radps,q_radps,r_radps"),
    Dialect(
        "JSON lines",
        "log.jsonl",
        lambda truth: json_lines(
            truth,
            {
                "ts": "t unix_ms",
                "accel": {"x": "ax g", "y": "ay g", "z": "az g"},
                "gyro": {"x": "gx deg/s", "y": "gy deg/s", "z": "gz deg/s"},
            },
        ),
    ),
    Dialect(
        "JSON lines, flat",
        "log.json",
        lambda truth: json_lines(
            truth,
            {
                "timestamp": "@%Y-%m-%dT%H:%M:%S.%L",
                "ax": "ax m/s^2",
                "ay": "ay m/s^2",
                "az": "az m/s^2",
                "wx": "gx rad/s",
                "wy": "gy rad/s",
                "wz": "gz rad/s",
            },
        ),
    ),
    text(
        "LabVIEW lvm",
        both("g", "deg/s"),
        "X_Value\tAcc X\tAcc Y\tAcc Z\tGyro X\tGyro Y\tGyro Z\tComment",
        "run.lvm",
        mark="\t",
        tail="\t",
        above="LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\nTime_Pref\tAbsolute\nDate\t2025/11/27\n***End_of_Header***\t\t\n\t\nChannels\t6\t\t\t\t\t\t\nSamples\t1000\t1000\t1000\t1000\t1000\t1000\t\nY_Unit_Label\tg\tg\tg\tdeg/s\tdeg/s\tdeg/s\t\nX_Dimension\tTime\tTime\tTime\tTime\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t0.0E+0\t0.0E+0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.01\t0.01\t0.01\t0.01\t0.01\t0.01\t\n***End_of_Header***\t\t\t\t\t\t\t",
    ),
    text(
        "stamps, US order",
        "@%m/%d/%Y %I:%M:%S.%L %p,ax g,ay g,az g",
        "Date Time,X (g),Y (g),Z (g)",
        "accel.csv",
        {"gyro": False},
    ),
    text(
        "stamps, German order",
        "@%d.%m.%Y %H:%M:%S.%L,ax g,ay g,az g,gx deg/s,gy deg/s,gz deg/s",
        "Zeitstempel;ax [g];ay [g];az [g];gx [°/s];gy [°/s];gz [°/s]",
        mark=";",
    ),
    text(
        "three accelerometers of a bench",
        "t s,ax g,ay g,az g",
        "Time (s)\tCh1 AccX (g)\tCh2 AccY (g)\tCh3 AccZ (g)",
        "daq.txt",
        {"gyro": False},
        mark="\t",
    ),
    text("single gyro", "t s,gz deg/s", "time [s],gyro_z [deg/s]", say={"acc": False, "motion": "poses"}),
]
NONE = [
    text("trajectory", "t s,px,py,pz", "time,x,y,z", "traj.csv"),
    text(
        "TUM trajectory",
        "t unix,px,py,pz,qx,qy,qz,qw",
        "# timestamp tx ty tz qx qy qz qw",
        "groundtruth.txt",
        mark=" ",
    ),
    text("quaternions alone", "t s,qw,qx,qy,qz", "t,q0,q1,q2,q3", "att.csv"),
    text("point cloud", "px,py,pz", "x,y,z", "cloud.csv"),
    text("point cloud with normals", "px,py,pz,qx,qy,qz", "x y z nx ny nz", "cloud.xyz", mark=" "),
    text("magnetometer", "t s,mx,my,mz", "time,x (uT),y (uT),z (uT)", "Magnetometer.csv"),
    text("magnetometer without units", "t s,mx,my,mz", "t,mag_x,mag_y,mag_z", "mag.csv"),
    text("weather", "@%Y-%m-%d %H:%M:%S,T,H,P", "datetime,temperature,humidity,pressure", "weather.csv"),
    text("wind", "t s,px,py,pz,T,P", "time,u,v,w,temp,pressure", "sonic.csv"),
    text("GPS track", "t unix,48.1,11.5,519.0,px", "time,lat,lon,alt,speed", "track.csv"),
    text("NMEA-like velocity", "t s,px,py,pz", "t,vn,ve,vd", "vel.csv"),
    text("Euler angles", "t s,px,py,pz", "t,roll,pitch,yaw", "att.csv"),
    text(
        "forces of a plate",
        "t s,px,py,pz,qx,qy,qz",
        "time,Fx (N),Fy (N),Fz (N),Mx (Nm),My (Nm),Mz (Nm)",
        "plate.csv",
    ),
    text("EMG", "t s,px,py,pz", "t,emg1,emg2,emg3", "emg.csv"),
    text("voltages", "t s,px,py,pz", "t,V1,V2,V3", "volts.csv"),
    text("stock prices", "@%Y-%m-%d,px,py,pz,row", "Date,Open,High,Low,Volume", "stock.csv"),
    text("covariances", "t s,px,py,pz", "t,acc_cov_xx,acc_cov_yy,acc_cov_zz", "cov.csv"),
    text("setpoints", "t s,px,py,pz", "t,setpoint_roll,setpoint_pitch,setpoint_yaw", "set.csv"),
    text("biases of a filter", "t s,px,py,pz", "t,bias_acc_x,bias_acc_y,bias_acc_z", "bias.csv"),
    text("joint angles of a robot", "t s,px,py,pz,qx,qy,qz", "t,q1,q2,q3,q4,q5,q6", "joints.csv"),
    text("colours", "px,py,pz", "r,g,b", "colours.csv"),
]
NONE = [Dialect(f"none: {d.name}", d.file, d.make, acc=False, gyro=False, t=False) for d in NONE]
DIALECTS = [*PHONES, *VENDORS, *ROBOTS, *MAKERS, *NONE]
