"""What a test of misuse expects."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import armlet as al


def refused(call: Callable[[], Any], *words: str) -> None:
    """An InputError whose message holds these words, and what was expected."""
    with pytest.raises(al.InputError) as caught:
        call()
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, al.ArmletError)
    message = str(caught.value)
    for word in ("expected", *words):
        assert word in message, (word, message)
