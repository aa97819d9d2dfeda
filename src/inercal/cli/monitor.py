"""``inercal monitor``."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import MapFile, Output
from inercal.cli.streaming import StreamFile, StreamOptions, run_stream
from inercal.errors import InputError


def monitor(
    file: StreamFile = None,
    /,
    *,
    map_file: MapFile = None,
    every: Annotated[
        str | None, Parameter(help='Time from one line out to the next, such as "1 s"; each row if absent.')
    ] = None,
    streaming: StreamOptions = StreamOptions(),  # noqa: B008  (frozen)
    output: Output = Output(),  # noqa: B008  (frozen)
) -> None:
    """Tell rest from motion, live, and measure the noise at rest."""
    from inercal._jit import compiling
    from inercal.noise.running import load_kernels
    from inercal.stream.monitor import Monitor
    from inercal.units import parse_quantity

    interval = 0.0 if every is None else parse_quantity(every, "time", "--every").value
    if every is not None and interval <= 0.0:
        raise InputError("--every", f"found {every}, expected a time above 0")
    streaming.check(output, (file, map_file))
    with compiling("monitor", output.say):
        load_kernels()
    run_stream(lambda lines: Monitor(lines, interval), file, map_file, output, streaming)
