"""The whole OpenAPI of a gateway, tried by schemathesis as one asker: how many cases, and all that went wrong."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import httpx
import schemathesis
from schemathesis.config import SchemathesisConfig
from schemathesis.engine import events, from_schema
from schemathesis.engine.recorder import ScenarioRecorder

from gateway.identity.permissions import permission

# What a schema cannot say: which times, names and rights go together. There, data that fits may be answered with 400.
RULES = {
    "GET /api/v1/export.mcap": "start before end, and times that are some",
    "GET /api/v1/robots/{robot_id}/at": "a time",
    "GET /api/v1/robots/{robot_id}/messages": "times, and a cursor that was given",
    "GET /api/v1/robots/{robot_id}/metrics/range": "times",
    "GET /api/v1/robots/{robot_id}/timeline": "times",
    "POST /api/v1/robots/{robot_id}/publish": "a topic's name and type, and a message of it",
    "POST /api/v1/robots/{robot_id}/services/call": "a service's name and type, and a request of it",
    "POST /api/v1/robots/{robot_id}/services/{service}": "the same",
    "POST /api/v1/robots/{robot_id}/actions/{action}": "an action's name and type, and a goal of it",
    "POST /api/v1/commands": "a selector's grammar",
    "POST /api/v1/robots/{robot_id}/commands": "what each kind of command asks for",
    "POST /api/v1/robots/{robot_id}/recordings": "either a length or a span",
    "POST /api/v1/users": "passwords that are hard to guess; an admin sees every robot",
    "PATCH /api/v1/users/{name}": "the same",
    "POST /api/v1/auth/password": "the same",
    "POST /api/v1/auth/links": "a user who may sign in",
    "POST /api/v1/keys": "printable names, known scopes; an admin's key sees every robot",
    "POST /api/v1/enrol": "a robot's name, a token and a CSR",
    "POST /api/v1/enrol/renew": "certificates and a CSR",
    "POST /api/v1/enrolment-tokens": "a robot's name",
    "POST /api/v1/robots/{robot_id}/revoke": "a reason",
    "PUT /api/v1/robots/{robot_id}/twin": "a twin's document",
    "PATCH /api/v1/robots/{robot_id}/twin": "the same",
    "PATCH /api/v1/robots/{robot_id}/labels": "labels' own grammar",
    "POST /api/v1/robots/{robot_id}/twin/revert": "what makes a whole document with the templates of now",
    "PATCH /api/v1/groups": "a selector, and labels' own grammar",
    "GET /api/v1/robots/{robot_id}/snapshot": "patterns of topics",
    "GET /api/v1/robots/{robot_id}/types/{package}/{kind}/{name}": "a type that is known",
    "POST /api/v1/auth/tickets": "patterns of robots",
    "PATCH /api/v1/twins": "a selector, and a part of a twin's document",
    "PUT /api/v1/templates/{name}": "the same, and a name",
    "POST /api/v1/templates/{name}/revert": "what is a whole document with the robots' own of now",
    "DELETE /api/v1/templates/{name}": "what is left of robots' documents has to be whole",
    "POST /api/v1/updates/bundles": "a bundle's zip file, and a group's name",
    "POST /api/v1/updates/metadata": "documents that are signed",
    "POST /api/v1/rollouts": "a version, a selector, names of nodes and bundles, waves",
    "POST /api/v1/rollouts/{rollout_id}/resume": "a version",
    "GET /api/v1/nodes": "the grammar of selectors",
    "POST /api/v1/nodes/{verb}": "the same, a node's name, and a signal where the verb is signal",
    "PATCH /api/v1/nodes/{node}": "the same, and a part of a node's row",
    "POST /api/v1/robots/{robot_id}/nodes/{node}/{verb}": "a node's name, and a signal where the verb is signal",
    "PUT /api/v1/robots/{robot_id}/nodes/{node}": "a node's name and its row",
    "PATCH /api/v1/robots/{robot_id}/nodes/{node}": "the same",
    "DELETE /api/v1/robots/{robot_id}/nodes/{node}": "a node's name; what is left of the document has to be whole",
    "PATCH /api/v1/robots/{robot_id}/nodes/{node}/parameters": "parameters' names and values",
    "POST /api/v1/robots/{robot_id}/nodes/{node}/lifecycle": "a node's own name",
    "GET /api/v1/robots/{robot_id}/nodes/{node}/parameters": "the same",
    "GET /api/v1/robots/{robot_id}/nodes/{node}/lifecycle": "the same",
    "GET /api/v1/robots/{robot_id}/nodes/{node}/log": "a cursor that was given",
    "GET /api/v1/robots/{robot_id}/nodes/{node}/log/tail": "the same",
    "PUT /api/v1/alert-checks/{check_id}": "something to change, and bounds that the check has",
    "GET /api/v1/robots/{robot_id}/watch/band": "times",
    "POST /api/v1/silences": "patterns that can be printed",
    "POST /api/v1/backtests": "times, and changes of checks that there are",
    "GET /api/v1/happenings": "times, and robots' ids",
    "POST /api/v1/happenings": "types, sources, times and ids of happenings",
    "POST /api/v1/hooks": "a hook's name",
    "POST /api/v1/rules/dry-run": "a rule's document, or the name of one, and times",
    "PUT /api/v1/rules/{name}": "a rule's document",
    "PATCH /api/v1/rules/{name}": "what makes one",
    "POST /api/v1/schedules/preview": "an expression, and a time zone",
    "PUT /api/v1/functions/{name}": "a function's settings as AWS has them, and a zip file",
    "GET /api/v1/functions/{name}": "a function's name",
    "DELETE /api/v1/functions/{name}": "a function's name",
    "PUT /api/v1/functions/{name}/code": "the same, and a zip file",
    "GET /api/v1/functions/{name}/code": "a version's number",
    "GET /api/v1/functions/{name}/code/text": "the same, and a file's name",
    "POST /api/v1/functions/{name}/versions": "a function's name",
    "PUT /api/v1/functions/{name}/aliases/{alias}": "an alias' name, numbers of versions, and shares",
    "DELETE /api/v1/functions/{name}/aliases/{alias}": "an alias' name",
    "PUT /api/v1/functions/{name}/aliases/{alias}/canary": "the same",
    "POST /api/v1/functions/{name}/invoke": "a qualifier, and JSON",
    "POST /api/v1/functions/{name}/replay": "times, and a pattern",
    "GET /api/v1/functions/{name}/invocations": "a cursor that was given",
    "GET /api/v1/functions/{name}/logs": "the same",
    "GET /api/v1/dead-letters": "the same",
    "POST /api/v1/dead-letters/redrive": "some, or all of them",
    "DELETE /api/v1/dead-letters": "the same",
}
# Lists: fields that the items have, and a cursor that was given and is still there.
LISTS = [
    "/api/v1/robots",
    "/api/v1/events",
    "/api/v1/groups",
    "/api/v1/graph",
    "/api/v1/commands",
    "/api/v1/twins",
    "/api/v1/templates",
    "/api/v1/rollouts",
    "/api/v1/recordings",
    "/api/v1/alerts",
    "/api/v1/silences",
    "/api/v1/alert-checks",
    "/api/v1/alert-routes",
    "/api/v1/users",
    "/api/v1/keys",
    "/api/v1/enrolment-tokens",
    "/api/v1/identities",
    "/api/v1/audit",
    "/api/v1/robots/{robot_id}/topics",
    "/api/v1/robots/{robot_id}/metrics",
    "/api/v1/robots/{robot_id}/gaps",
    "/api/v1/robots/{robot_id}/services",
    "/api/v1/robots/{robot_id}/actions",
    "/api/v1/robots/{robot_id}/goals",
    "/api/v1/robots/{robot_id}/watch",
    "/api/v1/rules",
    "/api/v1/schedules",
    "/api/v1/hooks",
    "/api/v1/functions",
]
RULES |= {f"GET {path}": "fields that there are, a cursor that was given, perhaps a selector" for path in LISTS}
schemathesis.serializer.alias(["application/zip", "application/cdr"], "application/octet-stream")
LONGEST_URI = 8000
AWAY = ("robot_offline", "command_timeout")  # a robot that does not answer is no fault of the gateway's


@dataclass
class Report:
    """What happened: `wrong` is empty, or something is to be repaired."""

    cases: int = 0
    wrong: list[str] = field(default_factory=list)
    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)

    @property
    def reached(self) -> set[str]:
        """Operations that were carried out at least once."""
        return {label for label, status in self.statuses if 200 <= status < 400}


def fuzz_api(
    url: str,
    *,
    key: str,
    granted: set[str],
    hidden: str,
    seed: int,
    examples: int,
    phases: tuple[str, ...] = ("coverage", "fuzzing", "stateful"),
    anonymous: bool = False,
    one_in: int = 1,
) -> Report:
    """Try everything; `granted` are the permissions that the asker has, `hidden` is a word that no answer may hold.

    Of `one_in` paths one is tried. The schema's own bounds ("coverage") are tried where the asker may pass: behind a
    refusal they find no other code.
    """
    checks = {
        "unsupported_method": {"enabled": False},
        "ignored_auth": {"enabled": not anonymous},
        "negative_data_rejection": {"expected-statuses": [400, 401, 403, 404, 409, 413, 415, 429, 503]},
    }
    config: dict[str, Any] = {
        "seed": seed,
        "continue-on-failure": True,
        "request-timeout": 60,
        "headers": {"Authorization": f"Bearer {key}"} if key else {},
        "generation": {
            "max-examples": examples,
            "deterministic": True,
            "database": "none",
            "no-shrink": True,
            "with-security-parameters": False,
            "allow-x00": False,  # a NUL is refused everywhere, which a schema cannot say; see test_odd_text.py
        },
        "checks": checks,
        "phases": {name: {"enabled": name in phases} for name in ("examples", "coverage", "fuzzing", "stateful")},
    }
    config["phases"]["coverage"]["unexpected-methods"] = []
    answer = httpx.get(f"{url}/api/v1/openapi.json", headers=config["headers"], timeout=60)
    document = _without_tuples(answer.raise_for_status().json())
    document["paths"] = dict(list(document["paths"].items())[::one_in])
    if refused := _refused(document, granted):
        config["operations"] = [{"include-name": refused, "phases": {"coverage": {"enabled": False}}}]
    schema = schemathesis.openapi.from_dict(document, config=SchemathesisConfig.from_dict(config))
    schema.config.base_url = url
    report = Report()
    for event in from_schema(schema).execute():
        if isinstance(event, events.ScenarioFinished):
            _take(report, event.recorder, granted=granted, hidden=hidden)
        elif isinstance(event, events.NonFatalError | events.FatalError):
            report.wrong.append(f"{type(event).__name__}: {getattr(event, 'value', None) or event.exception!r}")
    return report


def _without_tuples(part: Any) -> Any:
    """Arrays of any of a tuple's items instead of it: of answers schemathesis takes `prefixItems` for `items`."""
    if isinstance(part, list):
        return [_without_tuples(item) for item in part]
    if not isinstance(part, dict):
        return part
    plain = {name: _without_tuples(item) for name, item in part.items()}
    if isinstance(items := plain.pop("prefixItems", None), list):
        plain["items"] = {"anyOf": items}
    return plain


def _refused(document: dict[str, Any], granted: set[str]) -> list[str]:
    """The operations that the asker may not carry out."""
    return [
        f"{method.upper()} {path}"
        for path, operations in document["paths"].items()
        for method, operation in operations.items()
        if operation["x-metaros-permission"] not in granted
    ]


def _take(report: Report, recorder: ScenarioRecorder, *, granted: set[str], hidden: str) -> None:
    """Count a scenario's cases and look for what is wrong with them."""
    for case_id, interaction in recorder.interactions.items():
        report.cases += 1
        response, case = interaction.response, recorder.cases.get(case_id)
        if case is None or response is None:
            report.wrong.append(f"no answer: {interaction.request.method} {interaction.request.uri[:300]}")
            continue
        operation = case.value.operation
        label, status = operation.label, response.status_code
        report.statuses[label, status] += 1
        if len(interaction.request.uri) > LONGEST_URI and status in (400, 414, 431):
            continue  # the HTTP server's own answer: no request came to the API
        body = (interaction.request.body or b"")[:300]
        asked = f"{interaction.request.method} {interaction.request.uri[:300]} {body!r}"
        row = permission(operation.definition.raw["x-metaros-permission"])
        if row.name not in granted and status < 400:
            report.wrong.append(f"may not, and did: {label} {status}: {asked}")
        if status >= 500 and not (row.robots and _code(response) in AWAY):
            report.wrong.append(f"{status}: {asked} -> {response.content[:300]!r}")
        if hidden and status < 400 and hidden.encode() in response.content:
            report.wrong.append(f"shows what is hidden: {label}: {asked} -> {response.content[:300]!r}")
        for check in recorder.checks.get(case_id, ()):
            failure = check.failure_info.failure if check.failure_info is not None else None
            if failure is None or _excused(type(failure).__name__, failure.message, label, status):
                continue
            what = f"{type(failure).__name__} {failure.message[:300]}"
            report.wrong.append(f"{what}: {asked} -> {response.content[:300]!r}")


def _excused(failure: str, message: str, label: str, status: int) -> bool:
    """Whether it is one of our own checks' business, or no failure."""
    if failure == "AcceptedNegativeData" and "in query - violates `anyOf`" in message:
        return True  # neither a list nor null as JSON; but in a query all is text, and one text is a list
    return failure == "ServerError" or (failure == "RejectedPositiveData" and status == 400 and label in RULES)


def _code(response: Any) -> str:
    try:
        return str(response.json().get("code", ""))
    except ValueError:
        return ""
