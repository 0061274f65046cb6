"""Traces and metrics of requests go to an OpenTelemetry collector when an operator asks for it."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest
from homsense_service import settings
from homsense_service.settings import Settings
from opentelemetry.proto.collector.metrics.v1.metrics_service_pb2 import (
    ExportMetricsServiceRequest,
)
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
from pydantic import ValidationError
from support.running import Service

TRACE = "4bf92f3577b34da6a3ce929d0e0e4736"


class Collector(ThreadingHTTPServer):
    """Keeps what is posted to it."""

    def __init__(self) -> None:
        self.posted: list[tuple[str, bytes]] = []
        super().__init__(("127.0.0.1", 0), _Keeping)

    def all_of(self, path: str, kind: type[Any]) -> list[Any]:
        """Return the messages that were posted to a path."""
        return [kind.FromString(body) for at, body in self.posted if at == path]


class _Keeping(BaseHTTPRequestHandler):
    server: Collector

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        self.server.posted.append((self.path, body))
        self.send_response(200)
        self.send_header("content-length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def collector(monkeypatch: pytest.MonkeyPatch) -> Iterator[Collector]:
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_COMPRESSION", "none")
    with Collector() as collector:
        endpoint = f"http://127.0.0.1:{collector.server_port}"
        monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", endpoint)
        serving = threading.Thread(target=collector.serve_forever)
        serving.start()
        yield collector
        collector.shutdown()
        serving.join()


def test_requests_are_traced_by_route_and_join_the_trace_of_the_caller(
    tmp_path: Path, collector: Collector
) -> None:
    with Service(tmp_path, telemetry=True) as service:
        asked = httpx.get(
            f"{service.url}/v1/sites/nowhere",
            headers={"traceparent": f"00-{TRACE}-00f067aa0ba902b7-01"},
        )
        assert asked.status_code == 404
        service.end()
    spans = [
        span
        for message in collector.all_of("/v1/traces", ExportTraceServiceRequest)
        for resource in message.resource_spans
        for scope in resource.scope_spans
        for span in scope.spans
    ]
    mine = [span for span in spans if span.trace_id.hex() == TRACE]
    assert [span.name for span in mine] == ["GET /v1/sites/{site}"]
    assert {span.name for span in spans} > {"GET /v1/sites/{site}", "GET /healthz"}
    names = {
        metric.name
        for message in collector.all_of("/v1/metrics", ExportMetricsServiceRequest)
        for resource in message.resource_metrics
        for scope in resource.scope_metrics
        for metric in scope.metrics
    }
    assert "http.server.request.duration" in names


def test_nothing_is_exported_unless_an_operator_asks(tmp_path: Path, collector: Collector) -> None:
    with Service(tmp_path) as service:
        service.end()
    assert not collector.posted


def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OTEL_EXPORTER_OTLP_ENDPOINT", raising=False)
    with pytest.raises(ValidationError, match=r"telemetry\n.*needs OTEL_EXPORTER_OTLP_ENDPOINT"):
        Settings(telemetry=True)
    monkeypatch.setattr(settings, "find_spec", lambda _: None)
    with pytest.raises(ValidationError, match=r"telemetry\n.*needs the extra homsense\[telemetry"):
        Settings(telemetry=True)
