"""Figures of a run as Prometheus reads them: the library's own parser reads them here."""

import socket
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from emulator_process import free_endpoint
from khepera_protocol.zenoh.controller_payloads import Decision
from made_once import made_once
from prometheus_client.parser import text_string_to_metric_families
from short_training import train_shortly

from macor_hil.errors import MacorError, TelemetryError
from macor_hil.hardware.line.line_statistics import Durations
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions
from macor_hil.telemetry.metrics import Figures, metrics_of

PORT = "khepera://corridor?seed=1&drift=none"


def a_port() -> int:
    return int(free_endpoint().rpartition(":")[2])


def read(port: int) -> dict[str, float]:
    """All values by their names, without the label that all have; buckets with their bound."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as answer:
        text = answer.read().decode()
    values = {}
    for family in text_string_to_metric_families(text):
        assert family.documentation
        for sample in family.samples:
            labels = dict(sample.labels)
            assert labels.pop("robot")
            values["".join([sample.name, *labels.values()])] = sample.value
    return values


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def train(folder: Path) -> None:
        train_shortly(folder / "short.npz", PORT, random=80)

    return made_once(tmp_path_factory, "map-of-service", train) / "short.npz"


def test_a_run_tells_what_it_does(map_file: Path) -> None:
    port = a_port()
    seen: list[dict[str, float]] = []

    def look(decision: Decision) -> None:
        if decision.sequence == 5:
            seen.append(read(port))

    options: dict[str, Any] = {"port": PORT, "map_file": map_file, "listen": (), "connect": ()}
    serve(RunOptions(**options, commands=8, metrics_port=port), look)
    (values,) = seen
    assert values["macor_decisions_total"] == 6
    assert values["macor_collisions_total"] == values["macor_recoveries_total"] == 0
    assert values["macor_decision_seconds_count"] == 6
    assert values["macor_planning_seconds_count"] == 6
    assert values["macor_exchange_seconds_count"] > 6 * 5
    assert values["macor_exchange_seconds_bucket+Inf"] == values["macor_exchange_seconds_count"]
    assert values["macor_exchange_seconds_sum"] > 0
    assert values["macor_camera_age_seconds"] >= 0
    assert values["macor_telemetry_waiting"] == 0
    assert values["macor_driving"] == 1
    with pytest.raises(OSError, match="refused"):
        read(port)  # it ends with the run


def figures(**changes: Any) -> Callable[[], Figures]:
    values: dict[str, Any] = dict.fromkeys(
        ("decisions", "collisions", "recoveries", "learned", "failures", "waiting"), 0
    )
    times = {name: Durations((0.1, 1.0)) for name in ("exchanges", "plans", "commands")}
    given = {**values, **times, "camera_age": None, "driving": False, **changes}
    return lambda: Figures(**given)


def test_durations_are_counted_up_to_each_bound() -> None:
    times = Durations((0.1, 1.0))
    for seconds in (0.1, 0.05, 0.5, 7.0):
        times.add(seconds)
    port = a_port()
    with metrics_of(figures(plans=times), "robby", port):
        values = read(port)
    buckets = [values[f"macor_planning_seconds_bucket{bound}"] for bound in ("0.1", "1.0", "+Inf")]
    assert buckets == [2, 3, 4]
    assert values["macor_planning_seconds_sum"] == pytest.approx(7.65)
    assert "macor_camera_age_seconds" not in values  # before the first picture


def test_only_this_machine_is_answered() -> None:
    port = a_port()
    with metrics_of(figures(), "robby", port), socket.socket() as other:
        other.bind(("127.0.0.2", port))  # would be taken, were all addresses listened on


def test_a_port_that_is_taken_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(TelemetryError, match=f"127.0.0.1:{port}: Address already in use"),
            metrics_of(figures(), "robby", port),
        ):
            pass


def test_the_extra_is_named_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "prometheus_client", None)
    with (
        pytest.raises(MacorError, match="install the extra 'metrics'"),
        metrics_of(figures(), "robby", a_port()),
    ):
        pass
