"""What a silence may be, before it is one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gateway.domain.alert import Silence, new_alert_id
from gateway.domain.finding import SEVERITIES, FindingSeverity
from gateway.errors import InvalidRequestError
from metaros.limits import Limits

__all__ = ["checked_silence", "checked_text", "within"]

GLOB_CHARS = 128


def checked_silence(
    *,
    robots: Sequence[str],
    causes: Sequence[str],
    up_to: FindingSeverity,
    from_ns: int,
    until_ns: int,
    reason: str,
    by: str,
    now_ns: int,
    limits: Limits,
) -> Silence:
    """A new silence; `from_ns` 0 is now. InvalidRequestError names what does not fit, and the limit."""
    from_ns = from_ns or now_ns
    if up_to not in SEVERITIES:
        raise InvalidRequestError(f"up_to is one of {', '.join(SEVERITIES)}")
    if not max(from_ns, now_ns) < until_ns:
        raise InvalidRequestError("a silence ends after it begins, and in the future")
    if until_ns - min(from_ns, now_ns) > limits.silence_s * 1e9:
        raise InvalidRequestError(f"a silence is over in {limits.silence_s / 86_400:.0f} days at the latest")
    return Silence(
        id=new_alert_id(now_ns),
        robots=_globs("robots", robots, limits),
        causes=_globs("causes", causes, limits),
        up_to=up_to,
        from_ns=from_ns,
        until_ns=until_ns,
        by=by,
        reason=checked_text("reason", reason, limits),
    )


def checked_text(name: str, text: str, limits: Limits) -> str:
    """Words of somebody; InvalidRequestError where they are too many, or no database takes them."""
    if len(text) > limits.alert_text_chars:
        raise InvalidRequestError(f"{name} has {len(text)} characters, at most {limits.alert_text_chars} are kept")
    if "\0" in text or (not text.isascii() and any("\ud800" <= char <= "\udfff" for char in text)):
        raise InvalidRequestError(f"{name} holds characters that are none")
    return text


def within(silence: Silence, sees: Callable[[str], bool]) -> bool:
    """Whether somebody with a scope may know of a silence: it names robots of the scope only, each by its id."""
    return bool(silence.robots) and all(not set(name) & set("*?") and sees(name) for name in silence.robots)


def _globs(name: str, globs: Sequence[str], limits: Limits) -> tuple[str, ...]:
    if len(globs) > limits.silence_globs:
        raise InvalidRequestError(f"{name} are {len(globs)}, at most {limits.silence_globs} may be")
    for glob in globs:
        if not 0 < len(glob) <= GLOB_CHARS or not glob.isprintable():
            raise InvalidRequestError(f"one of {name} is no pattern of 1 to {GLOB_CHARS} characters")
    return tuple(dict.fromkeys(globs))
