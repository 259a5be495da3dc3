"""Settings: fields of frozen dataclasses that a protocol's tables give values to, with words for who writes a protocol.

Parts of methods and procedures declare theirs here; `study.experiment.protocol.settings` checks tables by them.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any


class SettingsError(ValueError):
    """Settings that do not fit together: the key where it shows, and what was expected, found, and to do."""

    def __init__(self, key: str, words: str) -> None:
        self.key = key
        super().__init__(words)


def setting(default: Any, words: str) -> Any:
    """A setting with the words that explain it; `[unit]` may stand at their end."""
    return field(default=default, metadata={"words": words})


def required(words: str) -> Any:
    """A setting without a default."""
    return field(metadata={"words": words})
