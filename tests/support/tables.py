"""Tables of cases that are one test, which shows every case that is not as it should be."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any

import pytest

__all__ = ["cases", "refusal"]


def refusal(error: type[Exception], call: Callable[..., object], *args: Any, **options: Any) -> str:
    """What a call is refused with by that error; empty where it is not refused."""
    try:
        call(*args, **options)
    except error as refused:
        return str(refused) or repr(refused)
    return ""


def cases(names: str | tuple[str, ...], rows: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """As `pytest.mark.parametrize`, but one test, which shows each row that fails: for rows that share their fixtures.

    To start a test costs more than most rows.
    """
    wanted = (names,) if isinstance(names, str) else names
    rows = list(rows)

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def every_row(**fixtures: Any) -> None:
            faults: list[str] = []
            for row in rows:
                values = (row,) if isinstance(names, str) else tuple(row)
                try:
                    test(**fixtures, **dict(zip(wanted, values, strict=True)))
                except (Exception, pytest.fail.Exception) as fault:
                    faults.append(f"{values!r}: {type(fault).__name__}: {fault}"[:4000])
            if faults:
                pytest.fail(f"{len(faults)} rows:\n" + "\n".join(faults), pytrace=False)

        signature = inspect.signature(test)
        left = [found for name, found in signature.parameters.items() if name not in wanted]
        every_row.__signature__ = signature.replace(parameters=left)  # type: ignore[attr-defined]
        return every_row

    return decorate
