"""Reads what pip-audit found; exit status 0: nothing is known, 1: vulnerabilities, 2: packages weren't looked up.

    python scripts/audited.py SERVICE FILE.json

pip-audit ends well where a package could only be skipped; that would pass for an audit, so it is counted here.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path


def audited(service: str, content: str) -> tuple[int, list[str]]:
    """The status, and lines that say why."""
    try:
        packages = json.loads(content)["dependencies"]
    except (ValueError, KeyError, TypeError):
        return 2, [f"{service} could not be asked, or gave no answer."]
    # Segue itself, installed from a folder, is on no index.
    packages = [package for package in packages if package["name"] != "segue"]
    looked_up = [package for package in packages if "skip_reason" not in package]
    found = [package for package in looked_up if package.get("vulns")]
    lines = [f"{service}: {len(looked_up)} of {len(packages)} packages looked up, {len(found)} with vulnerabilities."]
    for package in found:
        for each in package["vulns"]:
            fixed = ", ".join(each.get("fix_versions") or []) or "no version"
            lines.append(f"  {package['name']} {package['version']}: {each['id']}, mended in {fixed}")
    if found:
        return 1, lines
    if not packages or len(looked_up) < len(packages):
        missing = [package["name"] for package in packages if "skip_reason" in package]
        return 2, [*lines, f"  not looked up: {', '.join(missing[:5])}{' and others' if len(missing) > 5 else ''}"]
    return 0, lines


def main() -> int:
    service, file = sys.argv[1:]
    status, lines = audited(service, Path(file).read_text(encoding="utf-8"))
    print("\n".join(lines))
    return status


if __name__ == "__main__":
    sys.exit(main())
