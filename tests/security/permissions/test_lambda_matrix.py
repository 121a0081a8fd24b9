"""Who may do what over the Lambda API: every operation that is here, by keys of every role, and of some robots."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from botocore import xform_name
from botocore.exceptions import ClientError

from gateway.automation.functions.catalogue.operations import OPERATIONS
from gateway.automation.functions.catalogue.shapes import model
from gateway.domain.principal import Role
from gateway.identity.permissions import permission
from tests.support.gateways.lambda_gateway import LambdaGateway, lambda_gateway

# The table a second time, from the other side: the least role of each group of operations.
LEAST = {"functions.read": Role.VIEWER, "functions.invoke": Role.OPERATOR, "functions.write": Role.ADMIN}
TEXTS = {
    "Resource": "arn:aws:lambda:local:000000000000:function:none",
    "Arn": "arn:aws:lambda:local:000000000000:layer:none:1",
    "UUID": "00000000-0000-4000-8000-000000000000",
    "Role": "arn:aws:iam::000000000000:role/any",
}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LambdaGateway]:
    """A gateway with nothing in it."""
    folder: Path = tmp_path_factory.mktemp("lambda")
    with lambda_gateway(folder) as running:
        yield running


def smallest(shape: Any, name: str = "") -> Any:
    """The least that botocore lets out for a shape: what is asked does not exist, which is known after who asks."""
    if shape.type_name == "structure":
        return {key: smallest(shape.members[key], key) for key in shape.required_members}
    texts = TEXTS.get(name, "1" if name == "Qualifier" else "none")
    return {"string": texts, "integer": 1, "long": 1, "map": {}, "list": [], "blob": b"", "boolean": False}[
        shape.type_name
    ]


def refused(client: Any, operation: str) -> bool:
    """Whether the operation is denied, whatever else may be wrong about it."""
    members = smallest(model().operation_model(operation).input_shape)
    try:
        getattr(client, xform_name(operation))(**members)
    except ClientError as error:
        code = str(error.response["Error"]["Code"])
    else:
        code = ""
    assert code not in ("ServiceException", "InvalidSignatureException", "UnrecognizedClientException"), operation
    return code == "AccessDeniedException"


@pytest.mark.parametrize("role", ["viewer", "operator", "admin"])
def test_an_operation_is_for_who_has_its_role(served: LambdaGateway, role: str) -> None:
    client, wrong = served.client(served.key(role)), []
    for operation, row in OPERATIONS.items():
        expected = Role.of(role) < LEAST[row.permission]
        if refused(client, operation) is not expected:
            wrong.append((operation, row.permission, expected))
    assert wrong == []


def test_who_sees_some_robots_reaches_nothing(served: LambdaGateway) -> None:
    client = served.client(served.key("operator", robots=["sim_1"]))
    assert [operation for operation in OPERATIONS if not refused(client, operation)] == []


def test_the_table_of_permissions_says_the_same() -> None:
    for name, least in LEAST.items():
        assert permission(name).least is least
