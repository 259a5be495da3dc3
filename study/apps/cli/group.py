"""The `segue` command: verbs, exit statuses, and one line for each refusal.

Exit status 0: done. 2: bad input (one line: what was expected, what was found, where, what to do). 1: a fault of ours.
Verbs are imported when they are called or listed; nothing heavy is imported before one runs.
"""

from __future__ import annotations

import gc
import importlib
import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from contextlib import suppress

import click

from renderer.errors import RendererError
from renderer.files import REASONS
from study import __version__
from study.apps.cli.console import say
from study.apps.cli.examples import explain
from study.apps.cli.streams import hush, print_in_any_encoding
from study.errors import SegueError
from study.files import refused

# Verb -> module and name of its click command, in the order of a study's life.
VERBS = {
    "demo": "study:demo",
    "new": "new:new",
    "motions": "motions:motions",
    "preview": "motions:preview",
    "blend-length": "transition:blend_length",
    "transition": "transition:transition",
    "cost-matrix": "cost_matrix:cost_matrix",
    "label": "weights:label",
    "fit-weights": "weights:fit_weights",
    "one-hop": "one_hop_variants:one_hop",
    "advise": "advise:advise",
    "check": "study:check",
    "render": "study:render",
    "play": "play:play",
    "serve": "serve:serve",
    "simulate": "study:simulate",
    "analyse": "study:analyse",
    "report": "study:report",
    "export": "export:export",
    "export-stimuli": "elsewhere:export_stimuli",
    "import-answers": "elsewhere:import_answers",
    "export-engine": "export_engine:export_engine",
    "fit": "fit:fit",
    "power": "power:power",
    "doctor": "doctor:doctor",
}


class Verbs(click.Group):
    """A group whose commands are imported on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """All verbs, in order."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """One verb, imported now."""
        if cmd_name not in VERBS:
            return None
        module, _, name = VERBS[cmd_name].partition(":")
        command: click.Command = getattr(importlib.import_module(f"study.apps.cli.{module}"), name)
        explain(command, cmd_name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with the nearest verb named where there is none of that name."""
        import difflib

        if args and args[0] not in VERBS and not args[0].startswith("-"):
            near = difflib.get_close_matches(args[0], VERBS, n=1)
            hint = f" Did you mean {near[0]!r}?" if near else " `segue --help` lists the verbs."
            raise click.UsageError(f"no verb {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)


@click.command(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="segue")
def segue() -> None:
    """Perceptual studies of motion transitions: from motion capture to thresholds, preferences and a report."""


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line on arguments (default: the process's own) and return the exit status."""
    streams = sys.stdout, sys.stderr
    try:
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_: say(f"segue: warning: {message}")
            given = list(sys.argv[1:] if arguments is None else arguments)
            # Without its standalone mode click returns the status of a verb that asks to exit.
            status = segue.main(given, prog_name="segue", standalone_mode=False)
            return status if isinstance(status, int) else 0
    except click.ClickException as refusal:
        return _refuse(refusal.format_message())
    except (SegueError, RendererError) as refusal:
        return _refuse(str(refusal))
    except (KeyboardInterrupt, click.Abort):
        say("segue: interrupted; finished work is kept, and the same command resumes.")
        return 130
    except SystemExit:
        # The reader of our output went away (`segue ... | head`), at which click wraps the streams and exits: no fault.
        if (sys.stdout, sys.stderr) == streams:
            raise
        sys.stdout, sys.stderr = streams
        hush()
        return 0
    except Exception as fault:  # the one place where everything is caught: to say whose fault it is
        if isinstance(fault, OSError) and (fault.filename is not None or fault.errno in REASONS):
            return _refuse(str(refused(fault)))
        traceback.print_exc()
        say(f"segue: a fault of Segue's own ({type(fault).__name__}); please report the lines above.")
        return 1


def _refuse(why: str) -> int:
    with suppress(BrokenPipeError):
        say(f"segue: {why}")
    return 2


def main() -> None:
    """Entry point of the `segue` script."""
    # Read when numpy is loaded: our matrices are too small to share, and threads that wait for each other take more
    # than they give, most of all on a machine that does other work.
    for library in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
        os.environ.setdefault(library, "1")
    # Imports and tables are many objects that stay: looking through them for garbage takes a tenth of a report's time.
    gc.set_threshold(100_000, 20, 20)
    print_in_any_encoding()
    sys.exit(run())
