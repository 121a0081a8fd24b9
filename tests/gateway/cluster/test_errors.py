"""An error of another gateway is the same error here."""

from __future__ import annotations

import pytest

from gateway.api.problem import error_code
from gateway.automation.functions.errors import FunctionsOffError
from gateway.cluster.errors import PeerRefusedError, pack_error, unpack_error
from gateway.errors import (
    CommandRefusedError,
    IdentityError,
    InvalidRequestError,
    LeaseTakenError,
    RobotOfflineError,
    StoreError,
    TooManyRequestsError,
    error_row,
)
from metaros.errors import FieldError, MetarosError

SAME = [
    RobotOfflineError("robot r1 is offline"),
    LeaseTakenError("alice drives r1", holder="alice"),
    TooManyRequestsError("too often", retry_after_s=1.5),
    CommandRefusedError("no", agent_code="busy"),
    StoreError("the database is away"),
]
OTHERS = [
    FunctionsOffError("none"),
    FieldError("x is 0 to 3"),
    IdentityError("token_used", "used"),
    InvalidRequestError("x"),
]


@pytest.mark.parametrize("error", [*SAME, *OTHERS], ids=lambda error: type(error).__name__)
def test_an_error_that_crossed_answers_as_the_first_did(error: MetarosError) -> None:
    again = unpack_error(pack_error(error))
    assert (error_code(again), str(again), error_row(again)) == (error_code(error), str(error), error_row(error))


@pytest.mark.parametrize("error", SAME, ids=lambda error: type(error).__name__)
def test_what_others_catch_is_of_its_own_kind(error: MetarosError) -> None:
    again = unpack_error(pack_error(error))
    assert type(again) is type(error)
    assert vars(again) == vars(error)


def test_a_mistake_tells_nothing_of_itself() -> None:
    again = unpack_error(pack_error(KeyError("secret")))
    assert "secret" not in str(again)
    assert error_row(again).http == 500
    assert isinstance(again, PeerRefusedError)
