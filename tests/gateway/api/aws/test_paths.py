"""Every path that botocore makes is read back as its operation, with what stands in it."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from gateway.api.aws.paths import find_operation
from gateway.api.aws.prefix import is_lambda
from gateway.automation.functions.catalogue.shapes import model

ARN = "arn:aws:lambda:local:000000000000:function:name:1"


def test_every_operation_is_found_by_its_path() -> None:
    wrong = []
    for operation in model().operation_names:
        http: dict[str, Any] = model().operation_model(operation).http
        path, _, query = http["requestUri"].partition("?")
        names = [part[1:-1] for part in path.split("/") if part.startswith("{")]
        for text in ("name", ARN):
            filled = path
            for name in names:
                filled = filled.replace(f"{{{name}}}", quote(text, safe=""))
            found = find_operation(http["method"], f"/lambda{filled}", query)
            if found is None or (found.operation, found.members) != (operation, dict.fromkeys(names, text)):
                wrong.append((operation, text, found))
    assert wrong == []
    assert len(model().operation_names) > 50


def test_what_is_none_is_none() -> None:
    for method, path in (
        ("GET", "/lambda"),
        ("GET", "/lambda/"),
        ("PATCH", "/lambda/2015-03-31/functions"),
        ("GET", "/lambda/2015-03-30/functions"),
        ("GET", "/lambda/2015-03-31/functions/a/b/c/d"),
    ):
        assert find_operation(method, path, "") is None


def test_an_old_clients_last_slash_is_taken() -> None:
    found = find_operation("GET", "/lambda/2015-03-31/functions/", "")
    assert found is not None
    assert found.operation == "ListFunctions"


def test_where_the_api_is() -> None:
    assert [is_lambda(path) for path in ("/lambda", "/lambda/x", "/lambdas", "/api/v1/lambda")] == [
        True,
        True,
        False,
        False,
    ]
