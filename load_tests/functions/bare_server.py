"""The least that answers a call over HTTP here: uvicorn, a few lines of ASGI and our engine; nobody is asked for a key.

    python -m load_tests.functions.bare_server FOLDER CODE PORT

It is a reference, how much of a gateway's call is neither HTTP nor the worker, and no program for anybody.
"""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import uvicorn

from gateway.main import new_event_loop
from load_tests.functions.clients import Endpoint, call_one_by_one
from load_tests.functions.engine_side import running_engine, spec_of
from metaros.automation.functions.calls import Invocation
from tests.support.ports import free_port
from tests.support.processes.processes import end
from tests.support.waiting import wait_until

__all__ = ["running_bare_server"]


@contextmanager
def running_bare_server(folder: Path, code: Path) -> Iterator[Endpoint]:
    """It serves the function of a folder, and has answered once."""
    endpoint = Endpoint(free_port(), "/")
    command = [sys.executable, "-m", __name__, str(folder), str(code), str(endpoint.port)]
    process = subprocess.Popen(command, start_new_session=True)
    try:
        wait_until(lambda: not call_one_by_one(endpoint, 1).failed, timeout_s=30.0)
        yield endpoint
    finally:
        end(process)


async def _serve(folder: Path, code: Path, port: int) -> None:
    async with running_engine(folder) as engine:
        spec, number = spec_of(code), 0

        async def app(scope: Any, receive: Any, send: Any) -> None:
            nonlocal number
            number += 1
            body, more = b"", True
            while more:
                message = await receive()
                body, more = body + message["body"], message["more_body"]
            outcome = await engine.invoke(spec, Invocation(request_id=f"r{number}", payload=body))
            headers = [(b"content-length", str(len(outcome.payload)).encode())]
            await send({"type": "http.response.start", "status": 200, "headers": headers})
            await send({"type": "http.response.body", "body": outcome.payload})

        config = uvicorn.Config(app, port=port, http="httptools", lifespan="off", log_config=None, access_log=False)
        await uvicorn.Server(config).serve()


if __name__ == "__main__":
    with asyncio.Runner(loop_factory=new_event_loop) as runner:
        runner.run(_serve(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])))
