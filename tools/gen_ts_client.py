"""Write `dashboard/src/api/schema.ts`, the types of every REST operation, from the gateway's own OpenAPI document.

python tools/gen_ts_client.py           write
python tools/gen_ts_client.py --check   exit 1 if the file differs from what would be written
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(REPOSITORY))

from fastapi import FastAPI  # noqa: E402

from gateway.api import ROUTERS  # noqa: E402
from gateway.api.openapi.permissions import describe_permissions  # noqa: E402

TARGET = REPOSITORY / "dashboard" / "src" / "api" / "schema.ts"
BASE = "/api/v1"
JSON = "application/json"
HEAD = """/**
 * The documents of the gateway's REST interface, and what each operation takes and answers.
 *
 * Written by tools/gen_ts_client.py from the gateway's OpenAPI: do not edit.
 */

"""
PLAIN = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}
Schema = dict[str, Any]


def document() -> Schema:
    """The OpenAPI document, as a running gateway serves it."""
    app = FastAPI(title="Meta-ROS gateway", version="1", routes=[one for router in ROUTERS for one in router.routes])
    describe_permissions(app, ROUTERS)
    return app.openapi()


def render(found: Schema) -> str:
    """The whole file."""
    schemas = sorted(found["components"]["schemas"].items())
    parts = [_declared(name, schema) for name, schema in schemas]
    operations = sorted(_operations(found["paths"]))
    rows = "".join(f"{_comment(about, 2)}  {json.dumps(key)}: {body};\n" for key, about, body in operations)
    about = "/** Nothing is taken. */\nexport type None = Record<never, never>;\n\n"
    about += "/** Every operation by its method and its path below /api/v1. */\n"
    return HEAD + "\n".join(parts) + f"\n{about}export interface Operations {{\n{rows}}}\n"


def _declared(name: str, schema: Schema) -> str:
    about, title = _comment(schema.get("description", ""), 0), type_name(name)
    if "properties" not in schema:
        return f"{about}export type {title} = {typed(schema)};\n"
    required = set(schema.get("required", ()))
    fields = "".join(_field(key, one, needed=key in required) for key, one in schema["properties"].items())
    return f"{about}export interface {title} {{\n{fields}}}\n"


def _field(name: str, schema: Schema, *, needed: bool) -> str:
    return f"{_comment(schema.get('description', ''), 2)}  {_key(name)}{'' if needed else '?'}: {typed(schema)};\n"


def typed(schema: Schema) -> str:
    """A JSON Schema as a TypeScript type; what it does not say is unknown."""
    if "$ref" in schema:
        return type_name(schema["$ref"].rpartition("/")[2])
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(json.dumps(word) for word in schema["enum"])
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return " | ".join(dict.fromkeys(typed(one) for one in schema[key]))
    if "allOf" in schema:
        return " & ".join(typed(one) for one in schema["allOf"])
    kind = schema.get("type")
    if kind == "array":
        return _array(schema)
    if kind == "object" or "properties" in schema:
        return _object(schema)
    return PLAIN.get(str(kind), "unknown")


def _array(schema: Schema) -> str:
    if "prefixItems" in schema:
        return f"[{', '.join(typed(one) for one in schema['prefixItems'])}]"
    item = typed(schema.get("items", {}))
    return f"({item})[]" if " " in item else f"{item}[]"


def _object(schema: Schema) -> str:
    if "properties" in schema:
        required = set(schema.get("required", ()))
        fields = (
            f"{_key(key)}{'' if key in required else '?'}: {typed(one)}" for key, one in schema["properties"].items()
        )
        return f"{{ {'; '.join(fields)} }}"
    inner = schema.get("additionalProperties")
    return f"Record<string, {typed(inner) if isinstance(inner, dict) else 'unknown'}>"


def _operations(paths: Schema) -> Iterator[tuple[str, str, str]]:
    for path, methods in paths.items():
        if path.startswith(f"{BASE}/"):
            for method, operation in methods.items():
                key = f"{method.upper()} {path.removeprefix(BASE)}"
                yield key, operation.get("description", "").partition("\n")[0], _operation(operation)


def _operation(operation: Schema) -> str:
    named = operation.get("parameters", ())
    body = _content(operation.get("requestBody", {}))
    answers = (_content(answer) for status, answer in operation["responses"].items() if status < "300")
    answer = " | ".join(dict.fromkeys(one for one in answers if one)) or "unknown"
    given = {place: [one for one in named if one["in"] == place] for place in ("path", "query")}
    parts = [f"{place}: {_parameters(ones)}" for place, ones in given.items()]
    return f"{{ {'; '.join(parts)}; body: {body or 'undefined'}; answer: {answer} }}"


def _parameters(ones: list[Schema]) -> str:
    if not ones:
        return "None"
    fields = (f"{_key(one['name'])}{'' if one.get('required') else '?'}: {typed(one['schema'])}" for one in ones)
    return f"{{ {'; '.join(fields)} }}"


def _content(answer: Schema) -> str:
    schema = answer.get("content", {}).get(JSON, {}).get("schema")
    return typed(schema) if schema else ""


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z_]\w*", name) else json.dumps(name)


def type_name(name: str) -> str:
    """A schema's name as TypeScript takes it."""
    return re.sub(r"\W", "_", name)


def _comment(text: str, indent: int) -> str:
    margin, lines = " " * indent, text.replace("*/", "* /").strip().splitlines()
    if not lines:
        return ""
    if len(lines) == 1:
        return f"{margin}/** {lines[0]} */\n"
    return f"{margin}/**\n" + "".join(f"{margin} * {line}".rstrip() + "\n" for line in lines) + f"{margin} */\n"


def main() -> None:
    """Write or check the file."""
    text = render(document())
    if "--check" not in sys.argv[1:]:
        TARGET.write_text(text)
    elif TARGET.read_text() != text:
        print(f"{TARGET.relative_to(REPOSITORY)} is stale: run python tools/gen_ts_client.py", file=sys.stderr)
        raise SystemExit(1)


if __name__ == "__main__":
    main()
