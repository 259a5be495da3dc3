"""Settings: how a study is run. What depends on the place and the recruiting service, and so is in no protocol."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta

from study.errors import SessionError
from study.experiment.store.participants import DROPPED_AFTER

SHORTEST_TOKEN = 16
"""Characters of the researcher's token."""


@dataclass(frozen=True)
class Settings:
    """How a study is run.

    `most_participants` is None for as many as come. `parameters` are the names that are kept of a link; those in
    `identifying` name one person, who takes part once. `failed_code` and `failed_url` take the place of the
    completion's where attention checks were failed. With `preview` everybody who opens a page begins anew, at the trial
    that the link names (`trial`).
    """

    researcher_token: str
    most_participants: int | None = None
    groups: int | None = None
    completion_code: str = ""
    completion_url: str = ""
    failed_code: str = ""
    failed_url: str = ""
    preview: bool = False
    parameters: tuple[str, ...] = ("PROLIFIC_PID", "STUDY_ID", "SESSION_ID", "participant")
    identifying: tuple[str, ...] = ("PROLIFIC_PID", "participant")
    dropped_after: timedelta = DROPPED_AFTER

    def completion(self, outcome: str) -> tuple[str, str]:
        """Code and address at the end of a session; those of `failed-checks` are the usual ones unless given."""
        if outcome == "finished":
            return self.completion_code, self.completion_url
        return self.failed_code or self.completion_code, self.failed_url or self.completion_url

    def __post_init__(self) -> None:
        """A token that cannot be guessed; an empty one would admit everybody."""
        if len(self.researcher_token) < SHORTEST_TOKEN:
            raise SessionError(
                f"Expected a researcher's token of {SHORTEST_TOKEN} characters or more, found one of "
                f"{len(self.researcher_token)}; leave it out, and one is made up."
            )
