"""The teleop lease over several gateways: one driver at most, and the home of the link decides."""

from __future__ import annotations

import asyncio

import pytest

from gateway.errors import LeaseRequiredError, LeaseTakenError, RobotOfflineError
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from tests.support.gateways.relay_rig import ROBOT, RelayRig, relay_rig, settle


def driven(rig: RelayRig) -> list[link_pb2.Teleop]:
    return [frame.teleop for frame in rig.frames if frame.HasField("teleop")]


def granted(rig: RelayRig) -> list[str]:
    return [frame.command.grant_lease.lease_id for frame in rig.frames if frame.command.HasField("grant_lease")]


async def test_somebody_drives_from_a_gateway_that_has_not_the_link() -> None:
    async with relay_rig("abc") as rig:
        drive = await rig["b"].teleop.take(ROBOT, "ann")
        assert granted(rig) == [drive.lease_id]
        await rig["b"].teleop.drive(drive, linear=0.5, angular=0.1)
        rig.clock.advance(LIMITS.lease_s - 0.1)
        await rig["b"].teleop.drive(drive, linear=0.5, angular=0.1)
        await settle()
        rig.clock.advance(LIMITS.lease_s - 0.1)  # longer than the lease since it was taken: driving renews it
        await rig["b"].teleop.drive(drive, linear=0.5, angular=0.1)
        await settle()
        assert [item.seq for item in driven(rig)] == [1, 2, 3]
        assert {item.lease_id for item in driven(rig)} == {drive.lease_id}
        assert granted(rig) == [drive.lease_id]  # never taken a second time
        await rig["b"].teleop.release(drive)
        await settle()
        assert rig.frames[-1].command.release_lease.lease_id == drive.lease_id
        assert driven(rig)[-1].seq > 3  # the stop
        for half in rig.halves.values():
            assert half.leases.holder_of(ROBOT, now_s=rig.clock.monotonic_s()) is None


@pytest.mark.parametrize(("first", "second"), [("a", "b"), ("b", "a"), ("b", "c"), ("b", "b")])
async def test_nobody_drives_beside_another_one(first: str, second: str) -> None:
    async with relay_rig("abc") as rig:
        drive = await rig[first].teleop.take(ROBOT, "ann")
        with pytest.raises(LeaseTakenError) as caught:
            await rig[second].teleop.take(ROBOT, "bob")
        assert caught.value.holder == "ann"
        await rig[first].teleop.release(drive)
        assert (await rig[second].teleop.take(ROBOT, "bob")).holder == "bob"


async def test_of_two_who_take_it_at_the_same_moment_one_has_it() -> None:
    async with relay_rig("abc") as rig:
        takes = [rig[name].teleop.take(ROBOT, f"of {name}") for name in "abc"]
        got = await asyncio.gather(*takes, return_exceptions=True)
        assert sum(not isinstance(item, BaseException) for item in got) == 1
        assert sum(isinstance(item, LeaseTakenError) for item in got) == 2
        assert len(set(granted(rig))) == 1


async def test_every_gateway_says_who_drives_and_lets_the_lease_in_but_none_shows_its_id() -> None:
    async with relay_rig("abc") as rig:
        drive = await rig["b"].teleop.take(ROBOT, "ann")
        await settle()
        now_s = rig.clock.monotonic_s()
        for half in rig.halves.values():
            lease = half.leases.find(ROBOT)
            assert lease is not None
            assert lease.holder == "ann"
            half.fleet.check_lease(ROBOT, f"/{ROBOT}/cmd_vel", drive.lease_id)
            for wrong in ("", "x", lease.mark):
                with pytest.raises(LeaseRequiredError):
                    half.leases.check(ROBOT, wrong, now_s=now_s)
        third = rig["c"].leases.find(ROBOT)
        assert third is not None
        assert third.lease_id == ""
        assert drive.lease_id not in repr(third)
        assert [half.leases.held(now_s=now_s) for half in rig.halves.values()] == [1, 0, 0]


async def test_a_lease_is_renewed_and_ended_at_any_gateway_by_its_id() -> None:
    async with relay_rig("abc") as rig:
        drive = await rig["b"].teleop.take(ROBOT, "ann")
        rig.clock.advance(LIMITS.lease_s - 0.5)
        assert (await rig["c"].teleop.renew(ROBOT, drive.lease_id)).holder == "ann"
        rig.clock.advance(LIMITS.lease_s - 0.5)
        await settle()
        assert rig["a"].leases.check(ROBOT, drive.lease_id, now_s=rig.clock.monotonic_s()).holder == "ann"
        with pytest.raises(LeaseRequiredError):
            await rig["c"].teleop.renew(ROBOT, "x")
        await rig["c"].teleop.end(ROBOT, "x")
        assert rig["a"].leases.held(now_s=rig.clock.monotonic_s()) == 1
        await rig["c"].teleop.end(ROBOT, drive.lease_id)
        assert rig["a"].leases.held(now_s=rig.clock.monotonic_s()) == 0
        assert rig.frames[-1].command.release_lease.lease_id == drive.lease_id


async def test_a_driver_who_was_silent_for_too_long_has_it_again_only_if_nobody_took_it() -> None:
    async with relay_rig("abc") as rig:
        drive = await rig["b"].teleop.take(ROBOT, "ann")
        rig.clock.advance(LIMITS.lease_s + 0.1)
        await rig["b"].teleop.drive(drive, linear=0.1, angular=0)
        await settle()
        assert granted(rig) == [drive.lease_id] * 2
        rig.clock.advance(LIMITS.lease_s + 0.1)
        other = await rig["c"].teleop.take(ROBOT, "bob")
        before = len(driven(rig))
        with pytest.raises(LeaseTakenError):
            await rig["b"].teleop.drive(drive, linear=0.1, angular=0)
        await settle()
        assert len(driven(rig)) == before
        assert granted(rig)[-1] == other.lease_id


async def test_a_drive_command_that_is_late_does_not_reach_the_robot() -> None:
    """The gateway of the driver thinks that it holds the lease; the home knows better, and says so."""
    async with relay_rig() as rig:
        drive = await rig["b"].teleop.take(ROBOT, "ann")
        await settle()
        rig["a"].leases.release(ROBOT, drive.lease_id)
        rig["a"].leases.take(ROBOT, "bob", lease_id="x", now_s=rig.clock.monotonic_s())
        await rig["b"].teleop.drive(drive, linear=0.1, angular=0)
        await settle()
        assert driven(rig) == []
        with pytest.raises(LeaseTakenError):
            await rig["b"].teleop.drive(drive, linear=0.1, angular=0)


@pytest.mark.parametrize("change", ["", "b", "c", "kill"])
async def test_with_the_link_the_lease_is_over_everywhere(change: str) -> None:
    async with relay_rig("abc") as rig:
        drive = await rig["b"].teleop.take(ROBOT, "ann")
        await settle()
        if change == "kill":
            rig.kill("a")
        else:
            rig.link(change)
        await settle()
        assert drive.lost
        with pytest.raises(LeaseRequiredError):
            await rig["b"].teleop.drive(drive, linear=0.1, angular=0)
        for half in rig.halves.values():
            assert half.leases.find(ROBOT) is None
        if change in ("b", "c"):
            assert (await rig["b"].teleop.take(ROBOT, "bob")).holder == "bob"


async def test_a_driver_whose_gateway_dies_does_not_keep_the_wheel() -> None:
    async with relay_rig("abc") as rig:
        await rig["b"].teleop.take(ROBOT, "ann")
        rig.kill("b")
        await settle()
        rig.clock.advance(LIMITS.lease_s)
        assert (await rig["c"].teleop.take(ROBOT, "bob")).holder == "bob"


async def test_what_the_robot_refuses_is_nobodys_lease() -> None:
    async with relay_rig() as rig:
        rig.answer = lambda command: link_pb2.CommandResult(command_id=command.command_id, code="busy")
        with pytest.raises(Exception, match="busy"):
            await rig["b"].teleop.take(ROBOT, "ann")
        for half in rig.halves.values():
            assert half.leases.find(ROBOT) is None
        rig.link("")
        with pytest.raises(RobotOfflineError):
            await rig["b"].teleop.take(ROBOT, "ann")


async def test_a_gateway_that_comes_later_hears_who_drives() -> None:
    async with relay_rig() as rig:
        await rig["a"].teleop.take(ROBOT, "ann")
        late = rig.add("c")
        await settle()
        lease = late.leases.find(ROBOT)
        assert lease is not None
        assert lease.holder == "ann"
