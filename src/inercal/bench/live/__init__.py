"""Live sources: an instrument by wire, measured while its rows come.

A source (serial port, UDP, TCP, MQTT, or a recording played again) is read by a thread, which tries it again where it
dies; text lines or binary frames become rows; the recursive estimator that a study asks for (`inercal.faces.stream`)
gives a row for each; sinks take these, each behind a queue of its own. Everything that came is used or counted.

In Python, for a page or a program of one's own::

    from inercal.bench.live.measurement import measure

    running = measure("udp://127.0.0.1:5005", "sting.toml", map="sting-map.toml", record="raw.csv")
    running.state               # "preparing", "waiting" for rows, "running" or "ended"
    running.alive               # False while a source that died is tried again
    running.columns             # ("t [s]", "theta [deg]", "u_theta [deg]", ...), once rows come
    running.latest["theta"]     # Quantity(value=3.21, u=0.01, unit="deg"): the last row
    running.channels["a1"]      # the last sample, as it came
    at, rows = running.rows()   # of the last minute, 50 a second at most; later running.rows(at)
    running.alarms              # what was said: Alarm(at=12.1, code="saturation", message="...")
    running.counts              # Counts: rows, lost, disordered, late, ...; str(counts) is one line for people
    running.stop(wait=10.0)     # in order: what has come is worked on, sinks and recording are closed
    running.failure             # a sentence where it ended with an error, else ""
    running.verdict             # a sentence where the rows are not to be used, else ""

What ``latest`` holds goes by the study: of kind aoa ``theta`` with u, ``rate``, ``nis``, ``status``; of selfcal
attitude and each coefficient with u; of strapdown the number of rests and each coefficient with u; of imu ``rest``,
``still``, means and noise of each channel. All of it may be asked from any thread. `RunningMeasurement` itself
takes a `MeasurementPlan`, for other estimators, a checkpoint, and functions that are told at once what happens.
"""
