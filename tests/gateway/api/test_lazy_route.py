"""Routes that are prepared when they are first asked for."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import httpx
import pytest
from fastapi import FastAPI

from gateway.api.lazy_route import LazyRoute, api_router


async def test_a_route_is_prepared_when_it_is_asked_and_not_before() -> None:
    router = api_router("/things", tags=["things"])

    @router.get("/{name}")
    async def show(name: str, count: int = 1) -> dict[str, str | int]:
        return {"name": name, "count": count}

    @router.delete("/{name}", status_code=204)
    async def remove(name: str) -> None: ...

    shown, removed = router.routes
    app = FastAPI(routes=router.routes, openapi_url=None)
    client = httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://here")
    assert (await client.get("/thing")).status_code == 404
    assert "dependant" not in vars(shown), "who asks for something else prepares nothing"
    assert (await client.get("/things/lamp", params={"count": 2})).json() == {"name": "lamp", "count": 2}
    assert (await client.get("/things/lamp", params={"count": "x"})).status_code == 422
    assert "dependant" in vars(shown)
    assert "dependant" not in vars(removed)
    assert (await client.post("/things/lamp")).status_code == 405
    assert (await client.delete("/things/lamp")).status_code == 204


def test_gateways_of_several_threads_prepare_it_once() -> None:
    made = []

    class Counted(LazyRoute):
        def __setattr__(self, name: str, value: object) -> None:
            made.extend([name] * (name == "dependant"))
            super().__setattr__(name, value)

    async def answer() -> None: ...

    route, together = Counted("/one", answer, methods={"GET"}), Barrier(8)

    def ask(_: int) -> object:
        together.wait(60)
        return route.dependant.call

    with ThreadPoolExecutor(8) as threads:
        assert set(threads.map(ask, range(8))) == {answer}
    assert made == ["dependant"]
    with pytest.raises(AttributeError, match="colour"):
        route.colour  # noqa: B018
