"""Keeps results that are costly to make again, those used last, up to a bound of memory."""

from __future__ import annotations

from collections.abc import Hashable
from threading import Lock
from typing import Generic, TypeVar

T = TypeVar("T")


class Kept(Generic[T]):
    """The results that were used last, by key; safe to share between threads.

    Parameters
    ----------
    most_bytes : int
        Of all that is kept together; those not used for longest go first. What is larger than
        that is not kept.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes, self._bytes = most_bytes, 0
        self._each: dict[Hashable, tuple[T, int]] = {}
        self._lock = Lock()

    def get(self, key: Hashable) -> T | None:
        """Return a result; None where it is not kept."""
        with self._lock:
            found = self._each.pop(key, None)
            if found is None:
                return None
            self._each[key] = found  # the latest
        return found[0]

    def keep(self, key: Hashable, result: T, size_bytes: int) -> None:
        """Keep a result of so many bytes."""
        if size_bytes > self._most_bytes:
            return
        with self._lock:
            if key in self._each:
                return
            while self._bytes + size_bytes > self._most_bytes:
                _, oldest_bytes = self._each.pop(next(iter(self._each)))
                self._bytes -= oldest_bytes
            self._each[key] = result, size_bytes
            self._bytes += size_bytes
