"""Routes that refuse query parameters which they do not know."""

from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute


class StrictRoute(APIRoute):
    """A route that answers 422 to unknown and to repeated query parameters."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The framework's handler behind the check."""
        handler = super().get_route_handler()
        known = {parameter.alias for parameter in self.dependant.query_params}

        async def checked(request: Request) -> Response:
            names = [name for name, _ in request.query_params.multi_items()]
            wrong = [(name, "Unknown parameter") for name in names if name not in known]
            wrong += [(name, "Parameter given twice") for name in known if names.count(name) > 1]
            if wrong:
                raise RequestValidationError(
                    [{"type": "query", "loc": ("query", name), "msg": text} for name, text in wrong]
                )
            return await handler(request)

        return checked


def strict_router(tag: str) -> APIRouter:
    """A router of such routes under `/api`, one chapter of the documentation."""
    return APIRouter(prefix="/api", tags=[tag], route_class=StrictRoute)
