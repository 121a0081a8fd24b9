"""Finding functions and versions among the records, and what there is to say where there is none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gateway.automation.functions.catalogue.names import LATEST, function_arn, parse_function
from gateway.automation.functions.catalogue.records import ALIAS, FUNCTION, VERSION, Records
from gateway.automation.functions.errors import FunctionChangedError, UnknownFunctionError
from gateway.store.automation.functions import Record

__all__ = ["check_revision", "named", "place", "unknown", "version_of"]


def named(records: Records, name: str) -> Record:
    """What is being worked on of a function; UnknownFunctionError."""
    record = records.get(FUNCTION, name, LATEST)
    if record is None:
        raise unknown(name, "")
    return record


def version_of(records: Records, text: str, qualifier: str = "") -> tuple[Record, str]:
    """The version that a name or ARN and a qualifier mean, and the qualifier; of an alias its main one.

    Raises:
        UnknownFunctionError: there is none.
    """
    name, said = parse_function(text, qualifier)
    if said in ("", LATEST):
        return named(records, name), said
    number = said
    if not said.isdigit():
        alias = records.get(ALIAS, name, said)
        if alias is None:
            raise unknown(name, said)
        number = alias.document["version"]
        if number == LATEST:
            return named(records, name), said
    record = records.get(VERSION, name, number)
    if record is None:
        raise unknown(name, said)
    return record, said


def check_revision(record: Record, asked: Mapping[str, Any], *, whose: str = "GetFunction") -> None:
    """FunctionChangedError where a RevisionId is asked for that is not the record's."""
    if asked.get("RevisionId") and asked["RevisionId"] != record.document["revision"]:
        raise FunctionChangedError(f"The RevisionId provided does not match the latest one: {whose} tells it")


def place(record: Record) -> str:
    """Where a version stands in a list: by name, $LATEST first, then by number."""
    return f"{record.owner}:{record.id.rjust(12) if record.id != LATEST else ''}"


def unknown(name: str, qualifier: str) -> UnknownFunctionError:
    """There is no such function, version or alias."""
    return UnknownFunctionError(f"Function not found: {function_arn(name, qualifier)}")
