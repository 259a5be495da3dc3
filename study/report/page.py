"""What the page shows: material and its analysis in; sections, tables and sentences out, ready for the template."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from study.analysis.analyse import Analysis
from study.counting import counted
from study.experiment.stimuli.flawed import flaw_notes
from study.report import conduct, course, demographics, facts, methods, power, shortcuts, stimuli, words
from study.report.material import Material
from study.report.media import Pictures
from study.report.sections.preference.section import confirmatory_table
from study.report.sections.registry import SECTIONS
from study.report.sections.section import About, Drawing, Headline, Section, headline_table
from study.report.tables import Table


@dataclass(frozen=True, eq=False)
class Part:
    """Sentences, figures and tables under one heading."""

    sentences: tuple[str, ...] = ()
    drawings: tuple[Drawing, ...] = ()
    tables: tuple[Table, ...] = ()
    folded: tuple[Table, ...] = ()


@dataclass(frozen=True, eq=False)
class Page:
    """What the template shows."""

    title: str
    source: str
    facts: tuple[str, ...]
    warnings: tuple[str, ...]
    """`title`, `source`, `facts`, `warnings`: at the head of the page."""
    comparison: Part
    """Headlines in numbers, and the confirmatory tests."""
    sections: tuple[Section, ...]
    """One a study, in the protocol's order."""
    power: Part
    conduct: Part
    stimuli: Part
    """`power`, `conduct`, `stimuli`: participants needed; how the sessions went; what was shown."""
    pictures: Pictures
    """Strips and videos."""
    methods: tuple[tuple[str, str], ...]
    references: tuple[str, ...]
    versions: tuple[tuple[str, str], ...]
    acknowledgement: str
    """`methods`, `references`, `versions`, `acknowledgement`: at the foot."""

    @property
    def _parts(self) -> tuple[Part | Section, ...]:
        return (self.comparison, *self.sections, self.power, self.stimuli, self.conduct)

    @property
    def tables(self) -> tuple[Table, ...]:
        """Every table of the page."""
        return tuple(table for part in self._parts for table in (*part.tables, *part.folded))

    @property
    def drawings(self) -> tuple[Drawing, ...]:
        """Every figure of the page."""
        return tuple(drawing for part in self._parts for drawing in part.drawings)

    def number(self, content: Table | Drawing) -> int:
        """Return the number of a table or a figure."""
        return self._numbers[content.name, type(content)]

    @cached_property
    def _numbers(self) -> dict[tuple[str, type], int]:
        kinds: tuple[Sequence[Table | Drawing], ...] = (self.tables, self.drawings)
        return {(one.name, type(one)): place for kind in kinds for place, one in enumerate(kind, start=1)}


def compose(material: Material, analysis: Analysis) -> Page:
    """Turn material and analysis into what the page shows; pictures come later."""
    protocol, manifest, quality = material.protocol, material.manifest, analysis.quality
    mark = words.mark_of(analysis.data, manifest.synthetic)
    sections = tuple(_sections(material, analysis, mark))
    asked = quality.simulated_participants, quality.participants
    people = demographics.demographics_rows(protocol.form, material.form)
    return Page(
        title=protocol.title,
        source=words.sentence(protocol.source),
        facts=facts.facts(material, analysis),
        warnings=tuple(words.warnings_of(analysis.data, manifest.synthetic, *asked)),
        comparison=_comparison(analysis),
        sections=sections,
        power=_power(material, quality.participants),
        conduct=_conduct(material, analysis, mark, people),
        stimuli=Part(
            sentences=(
                facts.shown_sentence(material),
                *shortcuts.shortcut_sentences(material),
                *flaw_notes(manifest.records),
            ),
            folded=(
                *shortcuts.shortcut_tables(material),
                stimuli.stimulus_table(manifest),
                *stimuli.flaw_tables(manifest),
                stimuli.motion_table(manifest),
                *([shortcuts.difference_table(material)] if manifest.audits else []),
            ),
        ),
        pictures=Pictures((), ()),
        methods=tuple(
            methods.methods_paragraphs(protocol, manifest, analysis, material.presentations, facts.who(quality), people)
        ),
        references=tuple(methods.references(protocol, analysis)),
        versions=facts.versions(material),
        acknowledgement=manifest.acknowledgement,
    )


def _sections(material: Material, analysis: Analysis, mark: str) -> Iterator[Section]:
    """One section a study, in the protocol's order; studies without answers say so."""
    protocol = material.protocol
    for study in protocol.studies:
        about = About(
            name=study.name,
            title=study.title or words.sentence(words.readable(study.name)).replace("Jnd", "JND"),
            fps=protocol.fps,
            data=analysis.data,
            mark=mark,
            alpha=analysis.alpha,
            confidence=analysis.confidence,
            points=protocol.scale_points.get(study.name, 0),
            ends={item.name: (item.low, item.high) for item in study.items},
            transitions=tuple(transition.name for transition in protocol.transitions_of(study)),
            lengths={
                pair.motion: material.manifest.record(pair.stimuli[0]).blend_frames
                for pair in material.manifest.pairs
                if pair.study == study.name
            },
        )
        result = analysis.studies.get(study.name)
        made = None if result is None else SECTIONS[type(result)].section(result, about)
        made = made or _without_answers(material, about)
        sure = [row for row in analysis.how_sure if row.study == study.name]
        yield replace(made, tables=(*made.tables, conduct.sure_table(about, sure))) if sure else made


def _without_answers(material: Material, about: About) -> Section:
    asked = material.answers[material.answers["study"] == about.name]
    missed = int(asked["answer"].isna().sum())
    if asked.empty:
        why = "no participant has reached that study"
    elif missed == len(asked):
        why = f"all {counted(missed, 'question')} had no response"
    elif not missed:
        why = f"all {counted(len(asked), 'answer')} are excluded by the rules of exclusion"
    else:
        rest = counted(len(asked) - missed, "answer")
        why = f"{missed:,} of {counted(len(asked), 'question')} had no response and {rest} were excluded by rules"
    return Section(
        f"study-{about.name}", about.title, (Headline(f"{about.title}: there is no result, for {why}.", ""),)
    )


def _comparison(analysis: Analysis) -> Part:
    made = (headline_table(analysis) if analysis.headline else None, confirmatory_table(analysis.confirmatory))
    return Part(tables=tuple(table for table in made if table is not None))


def _power(material: Material, asked: int) -> Part:
    if not material.power:
        return Part()
    drawings = [power.power_drawing(found, f"power_{place + 1}", asked) for place, found in enumerate(material.power)]
    sentences = tuple(power.power_sentence(found) for found in material.power)
    return Part(sentences, tuple(drawings), (power.power_table(material.power),))


def _conduct(material: Material, analysis: Analysis, mark: str, people: Sequence[Mapping[str, Any]]) -> Part:
    answers, presented = material.answers, material.presentations
    drawings = [
        ("response_times", course.response_figure(answers, "response-times", mark),
         "Response times: all answers with the median, and the median and middle half over the session."),
        ("presentation", conduct.presentation_figure(presented, "presentation", mark),
         "The longest time between two frames of every presentation; 1 is perfect, display failures are orange."),
    ]  # fmt: skip
    sentences = (conduct.quality_sentence(analysis.quality), facts.sessions_sentence(material),
                 conduct.checks_sentence(material.checks), conduct.exclusion_sentence(analysis))  # fmt: skip
    return Part(
        sentences=tuple(sentence for sentence in sentences if sentence),
        drawings=tuple(Drawing(name, picture, caption) for name, picture, caption in drawings if picture),
        tables=(
            *([demographics.demographics_table(people)] if people else []),
            *([conduct.presentation_table(presented)] if len(presented) else []),
            *conduct.exclusion_tables(analysis),
        ),
        folded=(conduct.participant_table(analysis, material.sessions),),
    )
