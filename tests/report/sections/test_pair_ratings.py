"""The section of a study in which pairs were rated: headline, figure, tables, what can't be told."""

from __future__ import annotations

import csv
import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from study.analysis.ratings.analyse import PairRatings
from study.analysis.ratings.pairs import pair_ratings
from study.report.document import write_report
from study.report.sections.pair_ratings.figures import likert_figure, shades
from study.report.sections.pair_ratings.section import pair_ratings_section
from study.report.sections.section import About, Section

ENDS = {"better": ("much worse", "much better"), "natural": ("much less natural", "much more natural")}


def answers(scores: dict[str, list[int]]) -> pd.DataFrame:
    rows = [
        {"participant": f"p{person}", "item": item, "method_a": "old_cut", "method_b": "new_cut", "motion": "dance"}
        | {"a_first": person % 2 == 0, "answer": score if person % 2 == 0 else 4 - score}
        for item, own in scores.items()
        for person, score in enumerate(own)
    ]
    return pd.DataFrame(rows)


def section_of(scores: dict[str, list[int]], mark: str = "") -> Section:
    section = pair_ratings_section(
        PairRatings(pair_ratings(answers(scores), 5)), About("compared", "Compared", ends=ENDS, mark=mark)
    )
    assert section is not None
    return section


TWO = {"better": [4, 3, 3, 4, 3, 2, 3, 4], "natural": [2, 3, 2, 3, 2, 2, 1, 3]}


def test_the_headline_counts_the_questions_and_gives_each_test() -> None:
    section = section_of(TWO)
    (headline,) = section.headlines
    assert headline.statement == (
        "Compared with old cut, new cut was rated above the middle of the scale in 2 of 2 questions, in 1 of them "
        "significantly at 0.05 across 8 participants."
    )
    size = "16 answers of 8 participants, on a scale of 0 to 4, where 2 means no difference."
    assert headline.detail.startswith(f"{size} Better: 3.25 [2.66, 3.84], t(7) = ")


def test_what_is_worse_is_called_worse_and_one_question_is_told_by_its_mean() -> None:
    (headline,) = section_of({"better": [0, 1, 1, 0, 1, 2]}).headlines
    assert headline.statement == (
        "Compared with old cut, new cut was rated 0.83 on average, on a scale of 0 to 4, where 2 means no difference; "
        "across participants, for these motions, this is significant (p = .013)."
    )
    (both,) = section_of({"better": [0, 1, 1, 0], "natural": [1, 1, 0, 1]}).headlines
    assert "was rated below the middle of the scale in 2 of 2 questions" in both.statement


def test_the_tables_hold_published_and_corrected_scores() -> None:
    section = section_of(TWO)
    assert [table.name for table in section.tables] == ["compared_published", "compared_corrected"]
    assert [table.name for table in section.folded] == ["compared_points"]
    points = {(row["item"], row["point"]): row["answers"] for row in section.folded[0].rows}
    assert points[("better", 3)] == 4
    assert sum(points.values()) == 16


def test_what_can_not_be_told_is_said() -> None:
    section = section_of({"better": [3]})
    assert section.headlines[0].statement.endswith("where 2 means no difference.")
    assert "no test can be made" in section.headlines[0].detail
    assert any(note.startswith("One participant: no spread to estimate;") for note in section.notes)
    assert any(note.startswith("One order of presentation") for note in section.notes)
    section = section_of({"better": [2, 2, 2, 2], "natural": [2, 2, 2, 2]})
    assert section.headlines[0].statement == "New cut was rated the same as old cut on average."


def test_the_figure_says_its_numbers_and_its_mark() -> None:
    (drawing,) = section_of(TWO, "simulated answers, no people").drawings
    ET.fromstring(drawing.picture.svg)
    assert "better: 0 at 0, 0 at 1, 1 at 2, 4 at 3, 3 at 4; mean 3.25" in drawing.picture.svg
    for words in ("simulated answers, no people", "much worse – much better", "new cut →", "points of the scale"):
        assert words in drawing.picture.svg


@pytest.mark.parametrize("points", [2, 4, 5, 11])
def test_every_point_has_a_colour_of_its_own(points: int) -> None:
    found = shades(points)
    assert len(set(found)) == points
    few = pair_ratings(answers({"better": [0, 0, 0]}).assign(answer=[0, points - 1, 0]), points)
    assert "mean 0.00" in likert_figure(few, "place", "", {}).svg  # all at one end


@pytest.mark.parametrize(("people", "left_out"), [(4, False), (1, True)])
def test_a_whole_report_of_rated_pairs(results_folder: Callable[..., Path], people: int, left_out: bool) -> None:
    """From simulated sessions through the real database to the page, its files and its methods."""

    def edit(text: str) -> str:
        rules = "\n[analysis.exclusions]\nfastest_s = 1.2\n" if left_out else ""
        ask = 'items = [{ name = "natural", question = "Compared:", low = "worse", high = "better" }]'
        changed = text.replace('items = [{ name = "natural", question = "How natural?" }]', f'show = "pair"\n{ask}')
        return changed.replace("alpha = 0.01\n", "alpha = 0.01\n" + rules)

    folder = results_folder(people, videos=0, edit=edit)
    page = write_report(folder, resamples=10).read_text(encoding="utf-8")
    for words in (
        "Compared with geodesic, fixed was rated",
        "participants compared the second of two transitions with the first",
        "Ratings had no time limit.",
        "simulated answers, no people",
        "worse – better",
    ):
        assert words in page
    (question,) = json.loads((folder / "tables" / "analysis.json").read_text(encoding="utf-8"))["pair_ratings"][
        "naturalness"
    ]
    with (folder / "tables" / "naturalness_corrected.csv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert float(row["mean"]) == pytest.approx(question["participants"]["mean"])
    assert (folder / "figures" / "naturalness_compared.svg").exists()
    if left_out:
        with (folder / "tables" / "exclusions.csv").open(encoding="utf-8") as file:
            results = [line["result"] for line in csv.DictReader(file)]
        assert "Naturalness: points of the scale, natural: fixed compared with geodesic (2 is the same)" in results
