"""What functions answer is theirs to choose: nothing large of it is parsed, as nothing else would be done meanwhile."""

from __future__ import annotations

from typing import Any

import orjson
import pytest

from gateway.automation.functions import destinations, invoker
from gateway.automation.functions.directory import MappingRow
from gateway.automation.functions.invoker import error_of
from gateway.automation.functions.mappings import batch
from gateway.automation.functions.mappings.batch import failed_from
from metaros.automation.functions.calls import Outcome
from metaros.limits import LIMITS


@pytest.fixture(autouse=True)
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The sizes of what is parsed."""
    sizes: list[int] = []

    class Parser:
        JSONDecodeError = orjson.JSONDecodeError

        @staticmethod
        def loads(data: bytes) -> Any:
            sizes.append(len(data))
            return orjson.loads(data)

    for module in (destinations, invoker, batch):
        monkeypatch.setattr(module, "orjson", Parser)
    return sizes


def large(**more: Any) -> bytes:
    """A document of many small values: the slowest to be parsed."""
    return orjson.dumps({**more, "x": [{}] * 1_900_000})


def test_an_error_has_its_beginning(parsed: list[int]) -> None:
    assert error_of(Outcome(payload=b'{"errorMessage": "m"}', error_type="E")) == "m"
    assert error_of(Outcome(payload=large(errorMessage="m"), error_type="E")).startswith('{"errorMessage":"m"')
    assert len(parsed) == 1


def test_an_answer_of_a_batch_is_none(parsed: list[int]) -> None:
    row = MappingRow(uuid="u", source_arn="arn", function="f", qualifier="", enabled=True, report_failures=True)
    assert failed_from([], row, ok=True, payload=b"{}") is None
    assert failed_from([], row, ok=True, payload=large()) == 0
    assert len(parsed) == 1


def test_a_record_of_an_end_says_its_size(parsed: list[int]) -> None:
    payload = large()
    assert len(payload) > LIMITS.function_event_bytes
    assert destinations._json(payload) == {"omitted": {"reason": "too_large", "size_bytes": len(payload)}}
    assert destinations._json(b"[1]") == [1]
    assert len(parsed) == 1
