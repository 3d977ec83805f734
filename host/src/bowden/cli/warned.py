"""Warnings of the running command: shown by `main`, added to the JSON by `output`."""

from __future__ import annotations

WARNINGS: list[str] = []
