"""Whose turn it is."""

from __future__ import annotations

from gateway.queue.agenda import Agenda
from gateway.store.deliveries import Ready, Wish


def noted(*targets: str, due_ns: int = 0, most: int = 100) -> Agenda:
    """An agenda with something due for these."""
    agenda = Agenda(most=most)
    agenda.note(Ready("k", target, due_ns) for target in targets)
    return agenda


def test_room_is_shared_and_whoever_was_served_comes_last() -> None:
    agenda = noted("a", "b", "c")
    wishes = agenda.wishes("k", now_ns=1, room=7, of_target=lambda target: 100)
    assert wishes == [Wish("k", "a", 3), Wish("k", "b", 2), Wish("k", "c", 2)]
    assert len(agenda) == 0
    agenda = noted("a", "b", "c")
    (first,) = agenda.wishes("k", now_ns=1, room=1, of_target=lambda target: 100)
    agenda.note([Ready("k", "a", 0)])
    (second,) = agenda.wishes("k", now_ns=1, room=1, of_target=lambda target: 100)
    assert (first.target, second.target) == ("a", "b")


def test_a_target_without_room_keeps_its_place_and_leaves_its_share() -> None:
    agenda = noted("a", "b")
    assert agenda.wishes("k", now_ns=1, room=9, of_target=lambda t: 0 if t == "a" else 100) == [Wish("k", "b", 9)]
    assert agenda.wishes("k", now_ns=1, room=9, of_target=lambda target: 5) == [Wish("k", "a", 5)]


def test_only_what_is_due_and_of_the_kind() -> None:
    agenda = noted("a", due_ns=50)
    agenda.note([Ready("other", "a", 0), Ready("k", "a", 70), Ready("k", "b", 90)])
    assert agenda.wishes("k", now_ns=49, room=9, of_target=lambda target: 9) == []
    assert agenda.next_ns(49) == 50
    assert agenda.next_ns(50) == 90
    assert agenda.wishes("k", now_ns=50, room=9, of_target=lambda target: 9) == [Wish("k", "a", 9)]
    assert agenda.wishes("other", now_ns=50, room=0, of_target=lambda target: 9) == []


def test_a_full_agenda_takes_news_of_those_it_has_only() -> None:
    agenda = noted("a", "b", due_ns=9, most=2)
    agenda.note([Ready("k", "c", 0), Ready("k", "b", 3)])
    assert [wish.target for wish in agenda.wishes("k", now_ns=9, room=9, of_target=lambda target: 9)] == ["a", "b"]
