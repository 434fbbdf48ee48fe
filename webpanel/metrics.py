"""What is measured, for monitoring programs: the service's metric families, and the count of HTTP requests."""

from collections import Counter
from collections.abc import Iterator
from typing import Final

from prometheus_client import CollectorRegistry
from prometheus_client.exposition import choose_encoder
from prometheus_client.metrics_core import CounterMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.seam.rig import RigService

_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PATCH", "DELETE", "PUT", "OPTIONS"})


class Metrics(Collector):
    """The service's metric families, fetched anew for each scrape, and the count of HTTP requests."""

    def __init__(self, service: RigService) -> None:
        self._service = service
        self._requests: Counter[tuple[str, str]] = Counter()
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(self)

    def collect(self) -> Iterator[Metric]:
        """All metric families."""
        yield from self._service.metrics()
        requests = CounterMetricFamily(
            "svev_http_requests", "Requests by method and status.", labels=("method", "status")
        )
        for values, count in sorted(self._requests.items()):
            requests.add_metric(values, count)
        yield requests

    def text(self, accepted: str) -> tuple[bytes, str]:
        """All metric families, and the media type of the format, chosen by an Accept header."""
        encode, media_type = choose_encoder(accepted)
        return encode(self._registry), media_type

    def count(self, method: str, status: int) -> None:
        """Count one request. Call it from the event loop only."""
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
