"""What is kept stays within its bound of memory; what is used stays longest."""

from __future__ import annotations

from bowden.estimation.kept import Kept


def test_the_oldest_go_first_and_never_more_is_kept_than_allowed() -> None:
    kept: Kept[str] = Kept(most_bytes=10)
    for key in "abc":
        kept.keep(key, key.upper(), 4)  # two fit
    assert [kept.get(key) for key in "abc"] == [None, "B", "C"]
    kept.keep("d", "D", 10)  # takes the room of both
    assert [kept.get(key) for key in "bcd"] == [None, None, "D"]


def test_what_was_used_since_stays() -> None:
    kept: Kept[str] = Kept(most_bytes=10)
    kept.keep("a", "A", 5)
    kept.keep("b", "B", 5)
    assert kept.get("a") == "A"
    kept.keep("c", "C", 5)
    assert [kept.get(key) for key in "abc"] == ["A", None, "C"]


def test_what_is_larger_than_the_bound_displaces_nothing() -> None:
    kept: Kept[str] = Kept(most_bytes=10)
    kept.keep("a", "A", 10)
    kept.keep("b", "B", 11)
    assert (kept.get("a"), kept.get("b")) == ("A", None)


def test_the_same_result_twice_takes_room_once() -> None:
    kept: Kept[str] = Kept(most_bytes=10)
    for key in "aaab":
        kept.keep(key, key.upper(), 5)
    assert (kept.get("a"), kept.get("b")) == ("A", "B")
