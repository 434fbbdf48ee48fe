"""The routes for monitoring programs: metrics in the text format of Prometheus or of OpenMetrics, and health."""

from http import HTTPStatus
from typing import Annotated, Final

from fastapi import Header, Response
from fastapi.responses import PlainTextResponse

from rig.api.fields import Model
from webpanel.routes.common import Responses, strict_router
from webpanel.routes.dependencies import Service, TheMetrics


class Health(Model):
    """Whether the service itself works."""

    healthy: bool


_UNWELL: Final[Responses] = {503: {"description": "The service is unwell.", "model": Health}}

router = strict_router("Observing", prefix="")


@router.get("/metrics", response_class=PlainTextResponse)
def get_metrics(metrics: TheMetrics, accept: Annotated[str, Header(include_in_schema=False)] = "") -> Response:
    """What has been measured, for Prometheus; in the format of OpenMetrics for those that accept it."""
    text, media_type = metrics.text(accept)
    return Response(text, media_type=media_type, headers={"Vary": "Accept"})


@router.get("/healthz", responses=_UNWELL)
def get_health(service: Service, response: Response) -> Health:
    """Whether the service itself works. Needs no token."""
    healthy = service.healthy()
    response.status_code = HTTPStatus.OK if healthy else HTTPStatus.SERVICE_UNAVAILABLE
    return Health(healthy=healthy)
