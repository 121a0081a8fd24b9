"""The API's page: every operation is on it, and nothing on it comes from elsewhere or runs."""

from __future__ import annotations

import re
from pathlib import Path

from gateway.api.openapi.docs_page import render_docs
from tests.gateway.harness import client, running_gateway


async def test_every_operation_is_on_the_page_and_nothing_from_remote(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key="") as http:
        page = await http.get("/docs")
        assert (page.status_code, page.headers["content-type"]) == (200, "text/html; charset=utf-8")
        policy = page.headers["content-security-policy"]
        assert "default-src 'none'" in policy or "default-src 'self'" in policy
        document = (await http.get("/api/v1/openapi.json")).json()
        for path, methods in document["paths"].items():
            for method in methods:
                assert f"<b>{method.upper()}</b><code>{path}</code>" in page.text, (method, path)
        assert "<script" not in page.text
        assert " style=" not in page.text
        sources = re.findall(r'(?:src|href)="([^"#]+)"', page.text)
        assert set(sources) == {"/docs/style.css", "/api/v1/openapi.json"}
        style = await http.get("/docs/style.css")
        assert (style.status_code, style.headers["content-type"]) == (200, "text/css; charset=utf-8")
        assert "url(" not in style.text
        assert "@import" not in style.text


def test_what_a_document_says_is_text() -> None:
    operation = {
        "summary": "<script>alert(1)</script>",
        "parameters": [
            {"name": "a<b", "in": "query", "schema": {"anyOf": [{"type": "array", "items": {"enum": [1]}}]}}
        ],
        "responses": {"200": {"content": {"application/json": {"example": {"x": "</pre><b>"}}}}},
    }
    page = render_docs({"info": {"title": "<i>"}, "paths": {"/x<y": {"get": operation}}})
    assert "<script>" not in page
    assert "<i>" not in page
    assert "</pre><b>" not in page
    assert "1, repeated" in page
