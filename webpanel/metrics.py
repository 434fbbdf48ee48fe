"""What the service has measured, in the text format of Prometheus."""

from collections import Counter
from collections.abc import Iterator

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
)
from prometheus_client.metrics_core import Metric as Family
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from webpanel.rig_service import Metric, Quantity, RigService

_METHODS = frozenset({"GET", "HEAD", "POST", "PATCH", "DELETE", "PUT", "OPTIONS"})


class Metrics(Collector):
    """The service's values, asked for whenever somebody looks, and the count of requests; a registry of its own."""

    def __init__(self, service: RigService) -> None:
        self._service = service
        self._requests: Counter[tuple[str, str]] = Counter()
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(self)

    def collect(self) -> Iterator[Family]:
        """All families."""
        yield from (_family(metric) for metric in self._service.metrics())
        requests = CounterMetricFamily(
            "svev_http_requests", "Requests by method and status.", labels=("method", "status")
        )
        for values, count in sorted(self._requests.items()):
            requests.add_metric(values, count)
        yield requests

    def text(self) -> bytes:
        """Everything, as Prometheus reads it."""
        return generate_latest(self._registry)

    def count(self, method: str, status: int) -> None:
        """Count one request; only from the event loop."""
        self._requests[method if method in _METHODS else "other", str(status)] += 1


class CountRequests:
    """ASGI middleware: counts requests by method and status."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""

        async def send_counted(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._metrics.count(scope["method"], message["status"])
            await send(message)

        await self._app(scope, receive, send_counted if scope["type"] == "http" else send)


def _family(metric: Metric) -> Family:
    labels = [metric.label] if metric.label else []
    if metric.quantity is Quantity.HISTOGRAM:
        buckets = sorted(metric.values.items(), key=lambda bucket: float(bucket[0]))
        return HistogramMetricFamily(metric.name, metric.help, buckets=buckets, sum_value=metric.total)
    kind = CounterMetricFamily if metric.quantity is Quantity.COUNTER else GaugeMetricFamily
    family = kind(metric.name, metric.help, labels=labels)
    for label, value in metric.values.items():
        family.add_metric([label] if labels else [], value)
    return family
