"""What becomes of a delivery after a try: its end, or when it is tried again. Pure but for chance."""

from __future__ import annotations

import random  # noqa: TID251 - the type only; the generator is an argument

from gateway.domain.automation.delivery import DEAD, DONE, WAITING, Dead, Delivery, Done, Policy, Result, Retry
from gateway.store.automation.deliveries import AttemptResult

__all__ = ["attempt_result", "end_of", "wait_s"]

LAMBDA_FAILURE_S = 60.0  # after the first failure of a function, twice that after the second
LEAST_S = 0.01
MESSAGE_CHARS = 2000


def end_of(delivery: Delivery, result: Result) -> Done | Dead | None:
    """How it ends with this result of a try; None where it is tried again."""
    if not isinstance(result, Retry):
        return result
    if result.counts and delivery.attempts + 1 >= delivery.put.policy.most_attempts:
        return Dead(result.code, result.message)
    return None


def attempt_result(delivery: Delivery, result: Result, *, rng: random.Random, now_ns: int) -> AttemptResult:
    """What is to be stored of a try, without what is put as it ends."""
    end = end_of(delivery, result)
    attempts = delivery.attempts + (isinstance(result, Retry) and result.counts)
    if isinstance(end, Done):
        return AttemptResult(delivery=delivery, state=DONE, attempts=attempts, message=_plain(end.note), puts=end.puts)
    if isinstance(end, Dead):
        return AttemptResult(
            delivery=delivery, state=DEAD, attempts=attempts, code=_plain(end.code), message=_plain(end.message)
        )
    assert isinstance(result, Retry)
    pause_s = result.after_s
    if pause_s is None:
        tried = attempts if result.counts else delivery.tries - attempts
        pause_s = wait_s(delivery.put.policy, tried, counts=result.counts, rng=rng)
    return AttemptResult(
        delivery=delivery,
        state=WAITING,
        attempts=attempts,
        due_ns=min(now_ns + round(max(pause_s, LEAST_S) * 1e9), delivery.expires_ns),
        code=_plain(result.code),
        message=_plain(result.message),
    )


def wait_s(policy: Policy, tried: int, *, counts: bool, rng: random.Random) -> float:
    """How long after the `tried`th time (from 1): any time up to a bound that doubles, so that those that failed
    together do not come back together. A function that failed under the `lambda` policy waits its fixed minutes.
    """
    if counts and policy.backoff == "lambda":
        return LAMBDA_FAILURE_S * tried
    bound_s = min(policy.most_s, policy.first_s * 2.0 ** min(max(tried, 1) - 1, 40))
    return rng.uniform(0.0, bound_s)


def _plain(text: str) -> str:
    """As every database takes it."""
    return text[:MESSAGE_CHARS].replace("\0", "\ufffd").encode("utf-8", "replace").decode()
