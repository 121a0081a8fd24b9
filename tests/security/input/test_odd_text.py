"""Text that no database, log or JSON likes, numbers beyond every column: everywhere in the API, on both databases."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

import pytest

from tests.gateway.harness import ScriptedAgent, running_gateway
from tests.gateway.store.conftest import store_url  # noqa: F401 - both databases
from tests.support.gateways.memory_authenticator import bearer
from tests.support.gateways.plain_http import FREE, PlainHttp, plain_http

HUGE = 10**40
# In addresses and queries, and the same in JSON: half a character and NaN can only stand in the latter.
WORDS = [
    "\0",
    "a\0b",
    "\r\nSet-Cookie: a=b",
    "\x1b[2J",
    "'; DROP TABLE users; --",
    "\U0001f4a9" * 300,
    "%s%n",
    "-" * 5000,
]
TIMES = [
    "-999999999d",
    "0001-01-01T00:00:00Z",
    "2200-01-01T00:00:00Z",
    "1900-01-01",
    "9999-12-31T23:59:59+14:00",
    "-0s",
]
NUMBERS = [str(HUGE), str(-HUGE), str(2**63), str(2**63 - 1), str(-(2**63) - 1), "NaN", "1e309", "٣"]
RAW = ['"\\u0000"', '"a\\u0000b"', '"\\ud800"', '"\\udfff\\ud800"', str(HUGE), str(-HUGE), "1e400", "NaN", "-Infinity"]
RAW += ["null", "[]", "{}", '["\\u0000"]', '["\\ud800"]', "true", '""']


def filled(path: str, word: str, *, robot: str = "sim_1") -> str:
    """A path with an odd word in the place of everything but the robot."""
    for name in ("recording_id", "alert_id", "silence_id", "check_id", "key_id", "token_id", "name"):
        path = path.replace(f"{{{name}}}", quote(word, safe=""))
    return path.replace("{robot_id}", quote(robot, safe=""))


def share(values: list[str], turn: int) -> list[str]:
    """Every sixth value: neighbours in the API get other ones, and so does each of the databases."""
    return values[turn % 6 :: 6]


def queries(operation: dict[str, Any], turn: int) -> list[dict[str, str]]:
    """Each parameter with a share of the odd values, alone beside those that have to be there."""
    parameters = [one for one in operation.get("parameters", ()) if one["in"] == "query"]
    needed = {
        one["name"]: {"t": "now", "robot": "sim_1"}.get(one["name"], "x") for one in parameters if one["required"]
    }
    odd = [*WORDS, *TIMES, *NUMBERS]
    return [needed | {one["name"]: word} for place, one in enumerate(parameters, turn) for word in share(odd, place)]


def bodies(operation: dict[str, Any], turn: int) -> list[str]:
    """Each field with a share of the odd values; the others hold something plain."""
    content = operation.get("requestBody", {}).get("content", {})
    fields = content.get("application/json", {}).get("schema", {}).get("properties", {})
    plain = {name: json.dumps(plain_value(name, schema)) for name, schema in fields.items() if "default" not in schema}
    made = []
    for place, name in enumerate(fields, turn):
        for raw in share(RAW, place):
            members = ", ".join(f'"{key}": {value}' for key, value in {**plain, name: raw}.items())
            made.append(f"{{{members}}}")
    return made


def plain_value(name: str, schema: dict[str, Any]) -> Any:
    """Something that fits."""
    known = {"role": "viewer", "name": "somebody", "service": "/a", "type": "std_srvs/srv/Trigger", "topic": "/a"}
    return known.get(name, 2000 if "integer" in str(schema) else "x")


JSON = {"Content-Type": "application/json"}


async def tell(http: PlainHttp, method: str, path: str, body: str | None = None) -> str:
    """What is wrong with the answer; "" when nothing is."""
    sent = {} if body is None else {"body": body.encode(), "headers": JSON}
    status, content = await http.request(method, path, **sent)
    offline = status == 503 and json.loads(content)["code"] == "robot_offline"
    if status < 500 or offline:
        return ""
    return f"{status} {method} {path[:200]} {str(body)[:200]}: {content[:300]!r}"


@pytest.mark.integration
async def test_nothing_odd_is_an_error_of_the_gateway(tmp_path: Path, store_url: str) -> None:  # noqa: F811
    wrong, asked = [], 0
    async with running_gateway(tmp_path, store_url=store_url, **FREE) as ready:
        async with ScriptedAgent(ready):
            pass
        key = (ready.data_dir / "local.key").read_text().strip()
        async with plain_http(ready.http_port, bearer(key)) as http:
            document = json.loads((await http.request("GET", "/api/v1/openapi.json"))[1])
            for turn, (path, operations) in enumerate(document["paths"].items(), 3 * store_url.startswith("postgres")):
                for method, operation in operations.items():
                    cases: list[tuple[str, str | None]] = []
                    for word in share(WORDS, turn):
                        if filled(path, word) != filled(path, ""):
                            cases.append((filled(path, word), None if method in ("get", "delete") else "{}"))
                        if "{robot_id}" in path:
                            cases.append((filled(path, "x", robot=word), None if method == "get" else "{}"))
                    if method == "get":
                        asked_for = (urlencode(query) for query in queries(operation, turn))
                        cases += [(f"{filled(path, 'x')}?{query}", None) for query in asked_for]
                    cases += [(filled(path, "x"), body) for body in bodies(operation, turn)]
                    for place, body in cases:
                        asked += 1
                        wrong += filter(None, [await tell(http, method.upper(), place, body)])
            page = json.loads((await http.request("GET", "/api/v1/audit?limit=1000"))[1])
            assert page["rows"], "the audit log goes on"
            assert (await http.ask("GET", "/readyz"))[0] == 200
    assert not wrong, f"{len(wrong)} of {asked}:\n" + "\n".join(wrong[:40])
    assert asked > 700, asked
