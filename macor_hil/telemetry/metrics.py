"""Figures of a live run for Prometheus, on this machine's loopback alone; extra `metrics`.

The figures are plain numbers that the loop which drives counts; they are read when somebody asks.
So whoever drives shares no lock with whoever looks, and waits for nobody.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import accumulate
from typing import Final

from khepera_protocol.extras import how_to_install

from macor_hil.errors import MacorError, TelemetryError
from macor_hil.hardware.line.line_statistics import Durations

_HOST: Final = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of a run at one moment.

    Attributes:
        decisions, collisions, recoveries: how many so far.
        learned: commands learned while driving, those of earlier runs included.
        failures: requests to the robot that were not answered.
        waiting: samples that have not gone out to watchers yet.
        camera_age: seconds since the last picture that was decided on; None: there was none.
        driving: whether the robot is driven, and nothing is waited for.
        exchanges, plans, commands: times of requests to the robot, of planning, and of commands
            from one decision to the next.
    """

    decisions: int
    collisions: int
    recoveries: int
    learned: int
    failures: int
    waiting: int
    camera_age: float | None
    driving: bool
    exchanges: Durations
    plans: Durations
    commands: Durations


_COUNTERS: Final = {
    "decisions": "Commands driven.",
    "collisions": "Collisions.",
    "recoveries": "Failures of robot or camera that the run recovered from.",
    "learned": "Commands learned while driving, those of earlier runs included.",
    "failures": "Requests to the robot without a reply, or with a wrong one.",
}
_GAUGES: Final = {
    "waiting": ("telemetry_waiting", "Samples that have not gone out to watchers yet."),
    "camera_age": ("camera_age_seconds", "Age of the last picture that was decided on."),
    "driving": ("driving", "1 while the robot is driven, 0 while it is waited for."),
}
_TIMES: Final = {
    "exchanges": ("exchange_seconds", "Round trips of requests to the robot."),
    "plans": ("planning_seconds", "Times of planning."),
    "commands": ("decision_seconds", "Times from one decision to the next."),
}


@contextmanager
def metrics_of(read: Callable[[], Figures], robot: str, port: int) -> Iterator[None]:
    """Serve the figures of a run to whoever asks for /metrics.

    Args:
        read: returns them; called in other threads.
        robot: name of the robot, a label of all of them.
        port: TCP port on the loopback.

    Raises:
        TelemetryError: the port cannot be had.
        MacorError: the extra is not installed.
    """
    try:
        from prometheus_client import CollectorRegistry, start_http_server
        from prometheus_client.registry import Collector
    except ImportError as error:
        raise MacorError(
            f"{error.name} is not installed; install the extra 'metrics' with:"
            f" {how_to_install('metrics')}"
        ) from None

    class RunCollector(Collector):
        def collect(self) -> Iterator[object]:  # type: ignore[override]
            yield from _families(read(), robot)

    registry = CollectorRegistry()
    registry.register(RunCollector())
    try:
        server, thread = start_http_server(port, _HOST, registry)
    except OSError as error:
        raise TelemetryError(
            f"cannot serve metrics on {_HOST}:{port}: {error.strerror}; give another --metrics-port"
        ) from None
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def _families(figures: Figures, robot: str) -> Iterator[object]:
    from prometheus_client.core import (
        CounterMetricFamily,
        GaugeMetricFamily,
        HistogramMetricFamily,
    )

    for field, text in _COUNTERS.items():
        counter = CounterMetricFamily(f"macor_{field}", text, labels=["robot"])
        counter.add_metric([robot], getattr(figures, field))
        yield counter
    for field, (name, text) in _GAUGES.items():
        gauge = GaugeMetricFamily(f"macor_{name}", text, labels=["robot"])
        if (value := getattr(figures, field)) is not None:
            gauge.add_metric([robot], float(value))
        yield gauge
    for field, (name, text) in _TIMES.items():
        histogram = HistogramMetricFamily(f"macor_{name}", text, labels=["robot"])
        times: Durations = getattr(figures, field)
        bounds = [*map(str, times.bounds), "+Inf"]
        sums = accumulate(times.counts)
        histogram.add_metric([robot], list(zip(bounds, sums, strict=True)), times.sum)
        yield histogram
