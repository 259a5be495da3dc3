"""Programs outside the packages, such as benchmarks, as modules."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[1]


def program(name: str) -> ModuleType:
    """The program at a path in the repository without its suffix, such as `benchmarks/fuzz`; loaded once."""
    key = name.replace("/", "_")
    if key not in sys.modules:
        spec = importlib.util.spec_from_file_location(key, ROOT / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = sys.modules[key] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)  # which may add its folder to the path, from where it imports others later
    return sys.modules[key]
