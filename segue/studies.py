"""A study from its protocol to its report, and what its answers say."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from segue.views import View

if TYPE_CHECKING:
    import pandas as pd

    from renderer.workers import Where
    from study.analysis.analyse import Analysis
    from study.experiment.protocol.whole import Protocol
    from study.experiment.stimuli.outlook import Outlook
    from study.motion.library import Library
    from study.power.design import PlannedStudy


class Study:
    """A protocol, the library that supplies its motions, and the folder of its results.

    Parameters
    ----------
    protocol
        A TOML file, or the name of a protocol that comes with Segue.
    library
        `synthetic`, or a folder of motion files.
    out
        The results folder; `results/NAME` unless given.
    """

    def __init__(self, protocol: str | Path, library: str | Path = "synthetic", out: str | Path | None = None) -> None:
        from study.experiment.protocol.whole import find_protocol, load_protocol

        self.protocol: Protocol = load_protocol(find_protocol(protocol))
        self._library = library
        self.folder = Path(out) if out is not None else Path("results") / self.protocol.name

    @property
    def library(self) -> Library:
        """The library, opened."""
        from study.motion.library import open_library

        return open_library(self._library)

    def check(self) -> Outlook:
        """What will be shown (`rows`), what can't be (`problems`), `notes`, trials and minutes."""
        from study.experiment.stimuli.outlook import look_ahead

        return look_ahead(self.protocol, self.library)

    def render(self, workers: Where = None) -> Study:
        """Render all stimuli into the results folder; those that are there are reused."""
        from study.experiment.stimuli.prepare import prepare
        from study.experiment.stimuli.rendering import render

        render(prepare(self.protocol, self.library), self.folder, workers)
        return self

    def simulate(self, participants: int | None = None, *, seed: int | None = None, **observers: Any) -> Study:
        """Sessions of simulated observers, always marked as simulated; needs no films.

        `observers` are shares of what goes wrong: `missed`, `badly_shown`, `careless`.
        """
        from study.experiment.simulation import simulate
        from study.experiment.stimuli.manifest import read_manifest, record
        from study.experiment.stimuli.prepare import prepare
        from study.experiment.store.responses import open_responses
        from study.tasks.observer import default_observer

        record(prepare(self.protocol, self.library), self.folder)
        with open_responses(self.folder) as responses:
            simulate(
                self.protocol,
                read_manifest(self.folder),
                responses,
                participants or self.protocol.participants or 12,
                self.protocol.seed if seed is None else seed,
                settings=replace(default_observer(), **observers),
            )
        return self

    @property
    def answers(self) -> pd.DataFrame:
        """The responses that count, one row each."""
        return self._answers("trial")

    def _answers(self, role: str) -> pd.DataFrame:
        from study.experiment.store.frames import answers_frame
        from study.experiment.store.responses import open_answers

        with open_answers(self.folder, None) as responses:
            return answers_frame(responses, roles=(role,))

    def analyse(self) -> Results:
        """All analyses, as the protocol decided them."""
        from study.analysis.analyse import analyse_folder

        return Results(analyse_folder(self.protocol, self.answers, self._answers("check")), self.folder)

    def report(self, out: str | Path | None = None) -> Path:
        """Write the report: one page, with its tables and figures as files. Returns the page."""
        from study.report.document import write_report

        return write_report(self.folder, out=out)

    def power(
        self, participants: Sequence[int] = (8, 12, 16, 24, 35, 50), *, study: str | None = None, **effects: Any
    ) -> PlannedStudy:
        """How many participants a study needs, by simulation through its plan and analysis.

        `effects` are those of `segue power --help`, such as `share`, `correlation`, `longer`, `studies`, `target`.
        """
        from study.experiment.stimuli.prepare import prepare
        from study.power.planned import chosen_study, plan_power

        chosen, pairs = chosen_study(self.protocol, study), prepare(self.protocol, self.library).pairs
        return plan_power(self.protocol, chosen, pairs, participants, effects)


@dataclass(frozen=True)
class Results:
    """What answers say: typed results, and their figures where they stand in a results folder."""

    analysis: Analysis
    folder: Path | None = None

    @property
    def headline(self) -> tuple[Any, ...]:
        """What each study found: estimate, interval, test, and to whom it generalises."""
        return self.analysis.headline

    @property
    def studies(self) -> dict[str, Any]:
        """The result of each study, by name."""
        return dict(self.analysis.studies)

    def sentences(self) -> list[str]:
        """The answers of all studies in words."""
        return self.analysis.sentences()

    def plot(self) -> dict[str, View]:
        """The report's figures, by name."""
        from study.errors import AnalysisError
        from study.report.drawing import as_file
        from study.report.material import gather
        from study.report.page import compose

        if self.folder is None:
            raise AnalysisError(
                "expected results of a study's folder, found those of a table alone; use Study.analyse."
            )
        drawings = compose(gather(self.folder), self.analysis).drawings
        return {one.name: View(as_file(one.picture.svg).encode(), "image/svg+xml", one.name) for one in drawings}

    def _repr_html_(self) -> str:
        lines = "".join(f"<li>{html.escape(line)}</li>" for line in self.sentences())
        figures = [] if self.folder is None else [view._repr_html_() for view in self.plot().values()]
        return f"<ul>{lines}</ul>{''.join(figures)}"


def analyse(answers: pd.DataFrame, **options: Any) -> Results:
    """Analyse a table of responses, one row each; `docs/analysis.md` names its columns."""
    from study.analysis.analyse import analyse as analysed

    return Results(analysed(answers, **options))
