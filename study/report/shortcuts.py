"""What gives pairs away: the audit of a manifest and answers in; sentences and tables out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from study.experiment.protocol.whole import StudySpec
from study.experiment.stimuli.shortcuts import CUES, ShortcutShare, needed_share, shares_in_words, shortcuts_of
from study.report import tables, words
from study.report.material import Material
from study.report.tables import Table

if TYPE_CHECKING:
    import pandas as pd


LEAST_APART = 0.1
"""Pairs that differ by less, in standard deviations of a percept, have no stimulus with more of a property."""


def shortcut_sentences(material: Material) -> Iterator[str]:
    """Yield for each study how far observers come who see one property of the stimuli alone."""
    protocol = material.protocol
    found = shortcuts_of(protocol, material.manifest.pairs, material.manifest.audits)
    for study in protocol.studies:
        if own := [share for share in found if share.study == study.name]:
            yield _sentence(study, own, needed_share(protocol, study))


def _sentence(study: StudySpec, own: list[ShortcutShare], needed: float | None) -> str:
    name = words.sentence(study.title or words.readable(study.name))
    if needed is None:
        most = max(own, key=lambda one: abs(one.share - 0.5))
        return (
            f"{name}: an observer who sees nothing but the {most.cue} and prefers more of it (longer, further left, "
            f"larger) would choose {most.method} in {100 * most.share:.0f}% of the trials; none of the other "
            "properties looked at is tied more closely to the methods."
        )
    most = max(own, key=lambda one: one.furthest)
    return (
        f"{name}: an observer who sees nothing but the {most.cue} could be right in {100 * most.furthest:.0f}% of the "
        f"trials ({words.readable(most.motion)}, {words.signed(most.level or 0, 0)} frames); the threshold is "
        f"{100 * needed:.0f}%. No other property looked at gives more away."
    )


def shortcut_tables(material: Material) -> tuple[Table, ...]:
    """Return what shortcut observers achieve, and what participants chose, where a property differs within pairs."""
    protocol, manifest = material.protocol, material.manifest
    found = shortcuts_of(protocol, manifest.pairs, manifest.audits)
    made = []
    for study in protocol.studies:
        own = [share for share in found if share.study == study.name]
        if not own:
            continue
        needed = needed_share(protocol, study)
        rows = [
            vars(one)
            | {"percent": 100 * one.share, "furthest_percent": 100 * one.furthest, "difference_frames": one.level}
            | {"motion": words.readable(one.motion)}
            for one in own
        ]
        made.append(
            tables.make(
                f"shortcuts_{study.name}",
                f"What gives pairs away: {study.title or words.readable(study.name)}. "
                f"{words.sentence(shares_in_words(study, needed))}. For all transitions together, and for the one at "
                "which it is furthest from guessing.",
                "cue method difference_frames percent furthest_percent motion",
                rows,
                files_only=" ".join(
                    key
                    for key, told in (("method", study.others), ("difference_frames", own[0].level is not None))
                    if not told
                ),
            )
        )
    chosen = [row for study in protocol.studies for row in _choices(study, material)]
    if chosen:
        made.append(
            tables.make(
                "shortcut_choices",
                "How often participants chose the stimulus with more of a property. Beside it how often they would "
                "have if the method alone had counted: each method chosen as often as it was over the whole study. "
                "Pairs that do not differ in the property are left out.",
                "study cue answers percent expected_percent",
                chosen,
                headings={"cue": "chosen", "percent": "observed"},
            )
        )
    return tuple(made)


def _choices(study: StudySpec, material: Material) -> Iterator[dict[str, Any]]:
    """Yield for each property the share of answers for the stimulus that has more of it, and what methods explain."""
    answers: pd.DataFrame = material.answers
    own = answers[(answers["study"] == study.name) & answers["chose_a"].notna()]
    if own.empty or needed_share(material.protocol, study) is not None:
        return
    chose_b = ~own["chose_a"].astype(bool)
    share_b = chose_b.groupby([own["method_a"], own["method_b"]]).transform("mean")
    audits = {one.pair: one for one in material.manifest.audits}
    for cue in CUES:
        more = own["pair"].map(lambda name, cue=cue: cue.more(audits[name]) if name in audits else 0.0)
        differs = more.abs() >= LEAST_APART
        if differs.any():
            b_has_more = more[differs] > 0
            expected = share_b[differs].where(b_has_more, 1 - share_b[differs])
            yield {
                "study": words.sentence(study.title or words.readable(study.name)),
                "cue": cue.prefers,
                "answers": int(differs.sum()),
                "percent": 100 * float((chose_b[differs] == b_has_more).mean()),
                "expected_percent": 100 * float(expected.mean()),
            }


def difference_table(material: Material) -> Table:
    """Return how the stimuli of every pair differ in what is not judged."""
    rows = []
    for one in material.manifest.audits:
        row: dict[str, Any] = {"pair": one.pair, "longer_s": one.seconds[1] - one.seconds[0]}
        row |= {f"first_{key}": value for key, value in vars(one.first).items()}
        row |= {f"last_{key}": value for key, value in vars(one.last).items()}
        row["faster_m_s"] = one.speeds_m_s[1] - one.speeds_m_s[0]
        row["farther_m"] = one.paths_m[1] - one.paths_m[0]
        rows.append(row)
    return tables.make(
        "pair_differences",
        "How the stimuli of each pair differ besides the blend: comparison against reference. Seconds longer; the "
        "figure's outline in the first and in the last frame: shifted to the right and down (heights of the figure), "
        "times as high, and mean distance of the joints once place and size are taken away (heights); mean speed and "
        "length of the path over the floor.",
        "pair longer_s first_right first_down first_size first_pose last_right last_down last_size last_pose "
        "faster_m_s farther_m",
        rows,
    )
