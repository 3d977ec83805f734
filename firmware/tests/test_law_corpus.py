"""The laws answer as frozen, bit for bit; law_corpus.py freezes what is meant to change."""

from __future__ import annotations

import json

from firmware.tests.law_corpus import FILE, digests


def test_every_answer_of_the_corpus_is_the_frozen_one() -> None:
    frozen, found = json.loads(FILE.read_text(encoding="utf-8")), digests()
    different = [name for name in frozen if found.get(name) != frozen[name]]
    assert not different, "meant? python -m firmware.tests.law_corpus --write"
    assert found.keys() == frozen.keys()
