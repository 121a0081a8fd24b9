"""The built dashboard: hashed assets for ever, the page itself never cached, and the page for every path of its own."""

from __future__ import annotations

import os
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

__all__ = ["Dashboard"]

IMMUTABLE = "public, max-age=31536000, immutable"
NOT_BUILT = """<!doctype html><meta charset="utf-8"><title>Meta-ROS</title>
<h1>The dashboard is not built</h1><p>Run <code>make setup</code> in the clone, then reload this page.
The API works: <a href="/api/v1/robots">/api/v1/robots</a>.</p>"""


class Dashboard(StaticFiles):
    """Files under `folder`; a path without a dot, and any robot's, is a view of the single page."""

    def __init__(self, folder: Path) -> None:
        super().__init__(directory=folder, check_dir=False)
        self.config_checked = True  # a folder that is not there is answered with a page, not with an exception
        self._index = folder / "index.html"

    async def get_response(self, path: str, scope: Scope) -> Response:
        """The file, the page, or why there is none."""
        view = path == "." or path.startswith("robots/") or "." not in os.path.basename(path)
        if view and not _is_api(path):
            if not self._index.is_file():
                return HTMLResponse(NOT_BUILT, status_code=503)
            path = "index.html"
        if _is_api(path):
            raise HTTPException(404)
        response = await super().get_response(path, scope)
        response.headers["cache-control"] = IMMUTABLE if path.startswith("assets/") else "no-cache"
        return response


def _is_api(path: str) -> bool:
    return path == "api" or path.startswith("api/")
