"""`segue doctor`: what this machine can draw and encode with, and what would make it better."""

from __future__ import annotations

import click

from study.apps.cli.console import emit, json_option


@click.command()
@click.option("--quiet", is_flag=True, help="Print nothing; the exit status says whether stimuli can be rendered.")
@json_option
def doctor(quiet: bool) -> None:
    """What this machine has for rendering stimuli, and what to install. Exit status 2 if something is missing."""
    from renderer.context import describe

    found = describe()
    able = found["kind"] is not None and found["h264"] is not None
    if not quiet:
        lines = [
            f"OpenGL:   {found['kind'] or 'none'}, {found['gl_version'] or '-'}, {found['gl_renderer'] or '-'}",
            f"encoder:  {found['h264'] or 'none'}",
            *(f"advice:   {sentence}" for sentence in found["advice"]),
            "Stimuli can be rendered." if able else "Stimuli can't be rendered until the above is mended.",
        ]
        emit({**found, "able": able}, "\n".join(lines))
    if not able:
        raise click.exceptions.Exit(2)
