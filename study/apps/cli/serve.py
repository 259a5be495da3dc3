"""The verb `serve`: sessions in the browser."""

from __future__ import annotations

import re
import tempfile
from functools import partial
from pathlib import Path

import click

from study.apps.cli.console import database_option, library_option, say, workers_options
from study.apps.cli.shared import (
    OUT,
    check_database,
    load_for_people,
    prepare_stimuli,
    render_stimuli,
    results_folder,
)


@click.command()
@click.argument("protocol")
@library_option
@OUT
@workers_options
@database_option
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to listen at: 127.0.0.1 for this computer alone, 0.0.0.0 for others on the network too.",
)
@click.option(
    "--port", type=click.IntRange(0, 65535), default=8000, show_default=True, help="Port; 0 for any free one."
)
@click.option(
    "--participants",
    type=click.IntRange(min=1),
    help="Most participants (default: no limit); places of drop-outs become available again.",
)
@click.option(
    "--groups", type=click.IntRange(min=1), help="Number of groups to fill evenly (default: what the protocol needs)."
)
@click.option(
    "--parameter",
    "parameters",
    multiple=True,
    metavar="NAME",
    help="Also store this parameter of the link, such as LAB; may be repeated.",
)
@click.option(
    "--completion-code", default="", help="Code shown at the end, as a recruiting service gives it (default: none)."
)
@click.option(
    "--completion-url",
    default="",
    metavar="URL",
    help="Where the last button leads, such as https://app.prolific.com/submissions/complete?cc=CODE "
    "(default: nowhere).",
)
@click.option("--failed-code", default="", help="Code shown instead after failed attention checks (default: the same).")
@click.option(
    "--failed-url", default="", metavar="URL", help="Where the last button leads after these (default: the same)."
)
@click.option(
    "--dry-run", is_flag=True, help="Walk one simulated participant through the real server, keep nothing, and stop."
)
@click.option(
    "--preview", is_flag=True, help="Show the study to yourself, from any trial on (/?trial=12); nothing is kept."
)
@click.option(
    "--researcher-token",
    envvar="SEGUE_RESEARCHER_TOKEN",
    help="What the researcher's page asks for, at least 16 characters (default: a new one at each start).",
)
@click.option("--behind-proxy", is_flag=True, help="Trust X-Forwarded-* headers from a local reverse proxy.")
@click.option(
    "--public-url",
    "public_urls",
    multiple=True,
    metavar="URL",
    help="Address that participants open (default: this computer's own); needed behind a proxy, may be repeated.",
)
@click.option(
    "--root-path",
    default="",
    metavar="PATH",
    help="Path under which the proxy shows this study, such as /study (default: none).",
)
def serve(
    protocol: str,
    library: str | None,
    out: Path | None,
    workers: int | str | None,
    database: str | None,
    host: str,
    port: int,
    participants: int | None,
    groups: int | None,
    parameters: tuple[str, ...],
    completion_code: str,
    completion_url: str,
    failed_code: str,
    failed_url: str,
    dry_run: bool,
    preview: bool,
    researcher_token: str | None,
    behind_proxy: bool,
    public_urls: tuple[str, ...],
    root_path: str,
) -> None:
    """Sessions in the browser. Renders missing stimuli first; Ctrl-C stops it, the same command resumes.

    Levels of adaptive procedures are rendered while sessions run, before they are due (`segue render`: beforehand).

    A completely rendered results folder can be served on any machine without --library.
    """
    from study.apps.server.names import own_names
    from study.apps.server.running import run
    from study.apps.server.settings import Settings
    from study.experiment.stimuli.rendering import RenderAhead, rendered_before
    from study.experiment.store.participants import new_token

    checked = load_for_people(protocol)
    folder = results_folder(checked, out)
    for name, url in (("completion", completion_url), ("failed", failed_url)):
        if url and not url.startswith(("https://", "http://")):
            raise click.UsageError(f"expected a {name} URL that starts with https://, found {url!r}.")
    if root_path and not re.fullmatch(r"(/[\w.~-]+)+", root_path, re.ASCII):
        raise click.UsageError(f"expected a path such as /study, without a slash at its end, found {root_path!r}.")
    own_names(host, public_urls)  # refuses what is no address, before anything is rendered
    settings = Settings(
        researcher_token=new_token() if researcher_token is None else researcher_token,
        most_participants=participants,
        groups=groups,
        completion_code=completion_code,
        completion_url=completion_url,
        failed_code=failed_code,
        failed_url=failed_url,
        preview=preview,
        parameters=(*Settings.parameters, *parameters, *(["trial"] if preview else [])),
    )
    rendered, ahead = None if library is not None else rendered_before(checked, folder), None
    if rendered is None:
        stimuli = prepare_stimuli(checked, library)
        check_database(database, stimuli)
        if render_stimuli(stimuli, folder, workers, all_levels=False)["videos"] < len(stimuli.stimuli):
            ahead = partial(RenderAhead, stimuli, folder, workers)
    else:
        check_database(database, rendered)

    if dry_run:
        from study.apps.server.dry_run import walk_through

        say(str(walk_through(checked, folder, settings, ahead)))
        return

    def started(address: str, place: str) -> None:
        if preview:
            say(f"preview       {address}/?trial=1  (any trial; nothing is kept)")
            say("Ctrl-C stops it.")
            return
        say(f"participants  {address}/")
        # What is printed ends up in logs: a token of the researcher's own is not repeated.
        token = f"#{settings.researcher_token}" if researcher_token is None else "  (asks for your token)"
        say(f"researcher    {address}/researcher{token}")
        say(f"answers       {place}")
        if behind_proxy and not public_urls:
            say(
                "Only localhost, this machine's name and IP addresses are answered: give the proxy's with --public-url."
            )
        say("Ctrl-C stops it; the same command resumes.")

    with tempfile.TemporaryDirectory() as nothing_kept:
        run(
            checked,
            folder,
            settings,
            host=host,
            port=port,
            behind_proxy=behind_proxy,
            root_path=root_path,
            database=nothing_kept if preview else database,
            public_urls=public_urls,
            ahead=ahead,
            started=started,
        )
