"""The command line: `segue`, one module a verb or a few that belong together."""

from study.apps.cli.group import main, run, segue

__all__ = ["main", "run", "segue"]
