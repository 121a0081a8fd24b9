"""The API's description as one page of plain HTML, made of the OpenAPI document: nothing is fetched from elsewhere.

No script runs on it, so it needs nothing of the page's Content-Security-Policy but its own style sheet.
"""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import Any

import orjson

__all__ = ["STYLE", "render_docs"]

STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #8881; --method: #2563eb }
@media (prefers-color-scheme: dark) { :root { --method: #7aa7ff } }
body { font: 15px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 60rem; padding: 1rem 1rem 4rem }
nav { columns: 12rem; padding: 0.5rem 0 1rem }
nav a { display: block }
h2 { border-bottom: 1px solid var(--line); margin-top: 2.5rem; text-transform: capitalize }
details { border: 1px solid var(--line); border-radius: 6px; margin: 0.4rem 0; padding: 0 0.8rem }
summary { cursor: pointer; padding: 0.5rem 0; overflow-wrap: anywhere }
summary b { color: var(--method); display: inline-block; font: 600 13px ui-monospace, monospace; min-width: 4.5rem }
summary code { font-weight: 600 }
summary span { display: block; opacity: 0.8; padding-left: 4.5rem }
pre { background: var(--soft); border-radius: 6px; font-size: 12.5px; padding: 0.7rem }
pre { max-height: 24rem; overflow: auto }
table { border-collapse: collapse; width: 100% }
td, th { border-bottom: 1px solid var(--line); padding: 0.25rem 0.6rem 0.25rem 0 }
td, th { text-align: left; vertical-align: top }
a { color: var(--method) }
"""


def render_docs(document: dict[str, Any]) -> str:
    """The page."""
    groups: dict[str, list[str]] = {}
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            tag = (operation.get("tags") or ["other"])[0]
            groups.setdefault(tag, []).append("".join(_operation(method, path, operation)))
    info = document["info"]
    links = "".join(f'<a href="#{escape(tag)}">{escape(tag)} ({len(rows)})</a>' for tag, rows in groups.items())
    body = "".join(
        f'<section><h2 id="{escape(tag)}">{escape(tag)}</h2>{"".join(rows)}</section>' for tag, rows in groups.items()
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(info["title"])}: API</title><link rel="stylesheet" href="/docs/style.css">'
        f"<h1>{escape(info['title'])}</h1>"
        "<p>Every operation of the REST API, with what it needs and what it answers. The same for programs: "
        '<a href="/api/v1/openapi.json">/api/v1/openapi.json</a>. Errors are <code>application/problem+json</code> '
        "with a stable <code>code</code>; a key goes behind <code>Authorization: Bearer</code>.</p>"
        f"<nav>{links}</nav><main>{body}</main></html>"
    )


def _operation(method: str, path: str, operation: dict[str, Any]) -> Iterator[str]:
    text = str(operation.get("description") or operation.get("summary") or "")
    first, _, rest = text.partition("\n")
    name = operation.get("operationId", f"{method}-{path}")
    yield f'<details id="{escape(name)}"><summary><b>{method.upper()}</b><code>{escape(path)}</code>'
    yield f"<span>{escape(first)}</span></summary>"
    if rest.strip():
        yield f"<p>{escape(rest.strip())}</p>"
    if (permission := operation.get("x-metaros-permission")) is not None:
        yield f"<p>Permission: <code>{escape(permission)}</code></p>"
    yield from _parameters(operation.get("parameters", ()))
    for kind, content in operation.get("requestBody", {}).get("content", {}).items():
        yield from _example(f"Request, {kind}", content)
    for status, answer in operation.get("responses", {}).items():
        if status < "400":
            for kind, content in answer.get("content", {}).items():
                yield from _example(f"Answer {status}, {kind}", content)
    refused = [
        f"<li><code>{escape(status)}</code> {escape(answer.get('description', ''))}</li>"
        for status, answer in operation.get("responses", {}).items()
        if status >= "400"
    ]
    yield f"<h4>Refusals</h4><ul>{''.join(refused)}</ul></details>"


def _parameters(parameters: Any) -> Iterator[str]:
    if not parameters:
        return
    yield "<table><tr><th>parameter</th><th>in</th><th>type</th><th>meaning</th></tr>"
    for item in parameters:
        needed = " (needed)" if item.get("required") else ""
        schema = item.get("schema", {})
        bounds = [f"{word} {schema[key]}" for key, word in _BOUNDS.items() if key in schema]
        meaning = "; ".join(part for part in (str(item.get("description", "")), *bounds) if part)
        yield (
            f"<tr><td><code>{escape(item['name'])}</code>{needed}</td><td>{escape(item['in'])}</td>"
            f"<td>{escape(_type(schema))}</td><td>{escape(meaning)}</td></tr>"
        )
    yield "</table>"


_BOUNDS = {"minimum": "at least", "maximum": "at most", "maxLength": "characters at most", "default": "default"}


def _type(schema: dict[str, Any]) -> str:
    if "enum" in schema:
        return " | ".join(str(value) for value in schema["enum"])
    if "anyOf" in schema:
        return " | ".join(_type(item) for item in schema["anyOf"] if item.get("type") != "null")
    if schema.get("type") == "array":
        return f"{_type(schema.get('items', {}))}, repeated"
    return str(schema.get("type", "any"))


def _example(title: str, content: dict[str, Any]) -> Iterator[str]:
    yield f"<h4>{escape(title)}</h4>"
    if "example" in content:
        text = orjson.dumps(content["example"], option=orjson.OPT_INDENT_2).decode()
        yield f"<pre>{escape(text)}</pre>"
