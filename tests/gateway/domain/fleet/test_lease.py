"""One driver at a time, and only while the lease is renewed."""

from __future__ import annotations

import pytest

from gateway.domain.fleet.lease import Lease, LeaseTable
from gateway.errors import LeaseRequiredError, LeaseTakenError


def test_taken_until_released() -> None:
    table = LeaseTable(valid_s=3)
    table.take("r", "ann", lease_id="a", now_s=0)
    with pytest.raises(LeaseTakenError) as caught:
        table.take("r", "bob", lease_id="b", now_s=2.9)
    assert caught.value.holder == "ann"
    assert not table.release("r", "b")
    assert table.release("r", "a")
    assert table.take("r", "bob", lease_id="b", now_s=2.9).holder == "bob"


def test_expires_unless_renewed() -> None:
    table = LeaseTable(valid_s=3)
    table.take("r", "ann", lease_id="a", now_s=0)
    assert table.renew("r", "a", now_s=2.9).expires_in_s(2.9) == pytest.approx(3)
    assert table.check("r", "a", now_s=5.8).holder == "ann"
    with pytest.raises(LeaseRequiredError):
        table.renew("r", "a", now_s=5.9)
    assert table.holder_of("r", now_s=5.9) is None


@pytest.mark.parametrize("lease_id", ["", "b"])
def test_only_the_right_id_passes(lease_id: str) -> None:
    table = LeaseTable(valid_s=3)
    with pytest.raises(LeaseRequiredError):
        table.check("r", lease_id, now_s=0)
    table.take("r", "ann", lease_id="a", now_s=0)
    with pytest.raises(LeaseRequiredError):
        table.check("r", lease_id, now_s=0)


def test_the_revision_grows_with_every_other_driver_and_with_nothing_else() -> None:
    table, seen = LeaseTable(valid_s=3), []

    def grown() -> bool:
        seen.append(table.revision)
        return len(seen) < 2 or seen[-1] > seen[-2]

    assert grown()
    table.take("r", "ann", lease_id="a", now_s=0)
    assert grown()
    table.renew("r", "a", now_s=1)
    assert not table.release("r", "b")
    assert not grown()
    assert table.release("r", "a")
    assert grown()
    table.learn("s", Lease("c", "s", "bob", 5.0))
    assert grown()
    table.learn("s", Lease("c", "s", "bob", 6.0))  # renewed there
    assert not grown()
    table.expire(now_s=6.0)
    assert grown()
    table.take("r", "ann", lease_id="d", now_s=7)
    assert grown()
    table.expire(now_s=10.0)
    assert grown()
