"""Results as what JSON knows: the one way from a frozen dataclass to what verbs print and reports store."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any


def to_json(value: Any) -> Any:
    """Return `value` as objects, lists, texts, numbers and null.

    Dataclasses become objects with a key a field; arrays, tuples and mappings are unpacked; numbers that are not finite
    become null, since JSON has none.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(item) for item in value]
    if hasattr(value, "tolist"):  # an array, or a number of numpy's, which importing nothing heavy can't name
        return to_json(value.tolist())
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
