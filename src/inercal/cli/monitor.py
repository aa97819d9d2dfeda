"""``inercal monitor``."""

from __future__ import annotations

from inercal.cli.options import MapFile, Output
from inercal.cli.streaming import Every, StreamFile, StreamOptions, interval_of, run_stream


def monitor(
    file: StreamFile = None,
    /,
    *,
    map_file: MapFile = None,
    every: Every = None,
    streaming: StreamOptions = StreamOptions(),  # noqa: B008  (frozen)
    output: Output = Output(),  # noqa: B008  (frozen)
) -> None:
    """Tell rest from motion, live, and measure the noise at rest."""
    from inercal._jit import compiling
    from inercal.noise.running import load_kernels
    from inercal.stream.monitor import Monitor

    interval = interval_of(every)
    streaming.check(output, (file, map_file))
    with compiling("monitor", output.say):
        load_kernels()
    run_stream(lambda lines: Monitor(lines, interval), file, map_file, output, streaming)
