"""Commit-confirmed by hand: tried, confirmed, taken back, refused, started again."""

from __future__ import annotations

import json

from edge_agent.twin.confirm import AGAIN_S, Apply, CommitConfirm, Persist, Report, risky
from edge_agent.twin.record import OWN, Record, Version
from metaros.clock import ManualClock

BOOT = "boot-1"


def version(revision: int, **sections: object) -> Version:
    document = json.dumps(sections or {"budget": {"bytes_per_s": 1000 * revision}})
    return Version(revision=revision, document=document.encode())


class Robot:
    """A machine whose actions are done at once, and what came of them."""

    def __init__(self, record: Record | None = None, clock: ManualClock | None = None, boot_id: str = BOOT) -> None:
        self.clock = clock or ManualClock()
        self.confirm = CommitConfirm(record or Record(), self.clock, boot_id=boot_id)
        self.disk = record or Record()
        self.lives = OWN
        self.told: list[tuple[int, str]] = []
        self.disk_works = True
        self.do(self.confirm.start())

    def do(self, actions: list[Persist | Apply | Report]) -> None:
        for action in actions:
            match action:
                case Persist(record) if self.disk_works:
                    self.disk = record
                    self.confirm.persisted(record)
                case Persist():
                    return self.do(self.confirm.persist_failed("disk_full", "no space"))
                case Apply(now):
                    self.lives = now
                    self.do(self.confirm.applied())
                case Report():
                    self.told.append((self.confirm.revision, self.confirm.state))
        return None

    def desired(self, wanted: Version, window_s: float = 10.0) -> None:
        self.do(self.confirm.desired(wanted.revision, wanted.sha256, wanted.document, window_s))

    def after(self, seconds: float) -> None:
        self.clock.advance(seconds)
        self.do(self.confirm.tick())

    def up(self) -> None:
        self.do(self.confirm.link(True))

    def again(self, *, boot_id: str = BOOT) -> Robot:
        return Robot(self.disk, self.clock, boot_id)


def test_a_revision_is_kept_once_it_is_confirmed_over_a_link_that_lived_with_it() -> None:
    robot = Robot()
    robot.up()
    robot.desired(version(1))
    assert (robot.lives, robot.confirm.state) == (version(1), "applying")
    robot.after(1.9)
    assert robot.confirm.state == "applying"
    robot.after(0.2)
    assert robot.told[-1] == (1, "confirming")
    assert robot.disk.applied == OWN
    robot.do(robot.confirm.confirmed(1))
    assert (robot.disk.applied, robot.disk.pending, robot.told[-1]) == (version(1), None, (1, "applied"))
    robot.after(3600.0)
    assert (robot.lives, robot.confirm.wait_s()) == (version(1), None)


def test_what_cannot_harm_the_link_is_asked_to_be_confirmed_at_once() -> None:
    robot = Robot()
    robot.up()
    robot.desired(version(1, parameters={"/lidar": {"rate": 1.0}}))
    assert robot.told[-1] == (1, "confirming")


def test_without_a_confirmation_the_robot_goes_back_by_itself_and_does_not_try_again() -> None:
    robot = Robot()
    robot.up()
    robot.desired(version(1))
    robot.after(5.0)
    robot.do(robot.confirm.link(False))
    robot.after(5.0)
    assert (robot.lives, robot.confirm.state, robot.confirm.why[0]) == (OWN, "reverted", "not_confirmed")
    assert (robot.disk.pending, robot.disk.seen) == (None, 1)
    robot.up()
    robot.desired(version(1))
    assert (robot.lives, robot.told[-1]) == (OWN, (1, "reverted"))
    robot = robot.again()
    robot.desired(version(1))
    assert (robot.lives, robot.confirm.state) == (OWN, "reverted")
    robot.desired(version(2))
    assert robot.lives == version(2)


def test_a_link_that_breaks_is_to_live_again_for_as_long() -> None:
    robot = Robot()
    robot.up()
    robot.desired(version(1))
    robot.after(1.0)
    robot.do(robot.confirm.link(False))
    robot.after(1.5)
    assert robot.confirm.state == "applying"
    robot.up()
    robot.after(1.9)
    assert robot.confirm.state == "applying"
    robot.after(0.2)
    assert robot.told[-1] == (1, "confirming")


def test_a_late_confirmation_changes_nothing() -> None:
    robot = Robot()
    robot.up()
    robot.desired(version(1))
    robot.clock.advance(11.0)
    robot.do(robot.confirm.confirmed(1))
    assert (robot.lives, robot.disk.applied, robot.confirm.state) == (OWN, OWN, "reverted")
    robot.do(robot.confirm.confirmed(1))
    assert robot.lives == OWN


def test_a_newer_revision_takes_the_place_of_one_on_trial_and_going_back_skips_it() -> None:
    robot = Robot()
    robot.up()
    robot.desired(version(1))
    robot.desired(version(2))
    robot.do(robot.confirm.confirmed(1))
    assert (robot.lives, robot.disk.applied) == (version(2), OWN)
    robot.after(10.0)
    assert (robot.lives, robot.confirm.state) == (OWN, "reverted")


def test_a_document_that_is_wrong_or_damaged_is_refused_and_never_tried() -> None:
    robot = Robot()
    robot.up()
    robot.do(robot.confirm.desired(3, bytes(32), b"{}", 0.0))
    assert (robot.told[-1], robot.lives, robot.disk.seen) == ((3, "refused"), OWN, 3)
    robot.desired(version(4, budget={"bytes_per_s": -1}))
    assert (robot.told[-1], robot.confirm.why[0]) == ((4, "refused"), "twin_invalid")
    robot.desired(version(5))
    robot.desired(version(6, nonsense={}))
    assert (robot.lives, robot.confirm.state) == (OWN, "refused")


def test_started_again_within_the_window_the_trial_goes_on_and_its_window_does_not_grow() -> None:
    robot = Robot()
    robot.desired(version(1))
    robot.clock.advance(6.0)
    robot = robot.again()
    assert robot.lives == version(1)
    robot.after(4.0)
    assert (robot.lives, robot.confirm.state) == (OWN, "reverted")


def test_started_again_after_the_window_or_in_another_run_of_the_system_it_is_taken_back_at_once() -> None:
    robot = Robot()
    robot.desired(version(1))
    assert robot.again(boot_id="boot-2").lives == OWN
    assert robot.again(boot_id="").lives == OWN
    robot.clock.advance(10.0)
    late = robot.again()
    assert (late.lives, late.disk.pending, late.confirm.state) == (OWN, None, "reverted")


def test_a_clock_that_was_set_back_with_the_machine_ends_the_trial() -> None:
    robot = Robot(clock=ManualClock(monotonic_s=1e6))
    robot.desired(version(1))
    robot.clock = ManualClock(monotonic_s=5.0)
    assert robot.again().lives == OWN


def test_what_the_disk_does_not_take_is_not_tried_before_it_does() -> None:
    robot = Robot()
    robot.up()
    robot.disk_works = False
    robot.desired(version(1))
    assert (robot.lives, robot.told[-1], robot.confirm.why[0]) == (OWN, (1, "refused"), "disk_full")
    robot.disk_works = True
    robot.after(AGAIN_S)
    assert (robot.lives, robot.disk.pending is not None) == (version(1), True)


def test_a_confirmation_that_the_disk_does_not_take_is_tried_again_until_the_window_ends() -> None:
    robot = Robot()
    robot.up()
    robot.desired(version(1))
    robot.disk_works = False
    robot.do(robot.confirm.confirmed(1))
    assert (robot.disk.applied, robot.lives) == (OWN, version(1))
    robot.disk_works = True
    robot.after(1.0)
    assert (robot.disk.applied, robot.told[-1]) == (version(1), (1, "applied"))


def test_the_robot_goes_back_also_on_a_full_disk() -> None:
    robot = Robot()
    robot.up()
    robot.desired(version(1))
    robot.disk_works = False
    robot.after(10.0)
    assert (robot.lives, robot.told[-1]) == (OWN, (1, "reverted"))
    robot.disk_works = True
    robot.after(1.0)
    assert robot.disk.pending is None


def test_a_version_that_cannot_be_lived_by_is_refused() -> None:
    robot = Robot()
    robot.desired(version(1))
    robot.do(robot.confirm.apply_failed("twin_apply", "no"))
    assert (robot.lives, robot.confirm.state, robot.disk.seen) == (OWN, "refused", 1)


def test_what_is_risky() -> None:
    assert not risky(b"{}", b'{"parameters":{"/a":{}}}')
    assert risky(b"{}", b'{"topics":{}}')
    assert risky(b"no json", b"{}")
