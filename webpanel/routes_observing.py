"""What other programs watch: metrics and health."""

from http import HTTPStatus
from typing import Final

from fastapi import APIRouter, Response
from fastapi.responses import PlainTextResponse
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4

from webpanel.api_errors import Responses
from webpanel.metrics import Metrics
from webpanel.models import Health
from webpanel.rig_service import RigService
from webpanel.strict_route import StrictRoute

_UNWELL: Final[Responses] = {503: {"description": "The service is unwell.", "model": Health}}


def observing_router(service: RigService, metrics: Metrics) -> APIRouter:
    """The routes outside `/api`."""
    router = APIRouter(tags=["Observing"], route_class=StrictRoute)

    @router.get("/metrics", response_class=PlainTextResponse)
    def get_metrics() -> Response:
        """What has been measured, for Prometheus."""
        return Response(metrics.text(), media_type=CONTENT_TYPE_PLAIN_0_0_4)

    @router.get("/healthz", responses=_UNWELL)
    def get_health(response: Response) -> Health:
        """Whether the service itself works. Needs no token."""
        healthy = service.healthy()
        response.status_code = HTTPStatus.OK if healthy else HTTPStatus.SERVICE_UNAVAILABLE
        return Health(healthy=healthy)

    return router
