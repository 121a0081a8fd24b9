"""Routes that FastAPI prepares when they are first asked for: two hundred of them would hold up every start."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from typing import Any

from fastapi import APIRouter
from fastapi.routing import APIRoute
from starlette.routing import compile_path

from gateway.api.problem import JsonResponse

__all__ = ["LazyRoute", "api_router"]

_ONE_AT_A_TIME = threading.RLock()  # gateways of one process share the routes


class LazyRoute(APIRoute):
    """Matches requests at once; everything else is made when an attribute is first read."""

    def __init__(self, path: str, endpoint: Callable[..., Any], *, methods: Collection[str], **options: Any) -> None:
        self.path, self.endpoint, self.methods = path, endpoint, set(methods)
        self.path_regex, self.path_format, self.param_convertors = compile_path(path)
        self._options = {"path": path, "endpoint": endpoint, "methods": methods, **options}

    def __getattr__(self, name: str) -> Any:
        with _ONE_AT_A_TIME:
            options = self.__dict__.pop("_options", None)
            if options is not None:
                super().__init__(**options)
        try:
            return self.__dict__[name]
        except KeyError:
            raise AttributeError(name) from None


def api_router(prefix: str, *, tags: list[str]) -> APIRouter:
    """A router of such routes, which answer with JSON."""
    return APIRouter(prefix=prefix, tags=[*tags], default_response_class=JsonResponse, route_class=LazyRoute)
