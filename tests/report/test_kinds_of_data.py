"""Every kind of data, through the real plan and database: true headlines, and pages without gaps or faults."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from walking_through import Behaviour, attentive, missing, perfect, sit, stubborn, stuttering

from study.errors import AnalysisError
from study.experiment.store.participants import erase
from study.experiment.store.responses import open_responses
from study.report.document import write_report

MakeFolder = Callable[..., Path]
RULES = """
[analysis.exclusions]
fastest_s = 0.25
badly_shown = true
most_missed = 0.3
most_failed_checks = 0.5
"""


def with_rules(text: str) -> str:
    """The protocol with rules of exclusion, and attention checks that they can speak of."""
    text = text.replace("alpha = 0.01\n", "alpha = 0.01\n" + RULES)
    return text.replace('task = "preference"', 'task = "preference"\nattention_checks = 2')


def words_of(folder: Path) -> str:
    """The report's text, its drawings and styles left out, every blank one space."""
    page = write_report(folder, resamples=20).read_text(encoding="utf-8")
    text = re.sub(r"<svg.*?</svg>|<style>.*?</style>|<[^>]*>", " ", page, flags=re.DOTALL)
    text = re.sub(r"\s+", " ", text.replace("&#39;", "'").replace("&#34;", '"'))
    assert not re.search(r"\bNone\b(?! of them)|\bnan\b|\binf\b", text)
    return text


def headlines(text: str) -> str:
    """What stands under "In short"."""
    return text[text.index("In short") : text.index("What was shown")]


def rows(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / "tables" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("behave", "people", "expected"),
    [
        (attentive, 1, ["of 1 person is estimated at", "one participant says nothing about others"]),
        (
            perfect, 5,
            ["is estimated at less than 5 frames longer and less than 5 frames shorter", "100.0% of 10 answers",
             "had equal mean ratings"],
        ),
        (stubborn, 4, ["is estimated at more than 20 frames longer and more than 15 frames shorter"]),
        (
            missing, 2,
            ["No just noticeable difference can be given: all 56 questions had no response",
             "there is no result, for all 4 questions had no response"],
        ),
    ],
)  # fmt: skip
def test_headlines_say_what_the_answers_can_tell(
    results_folder: MakeFolder, behave: Behaviour, people: int, expected: list[str]
) -> None:
    folder = results_folder(0, synthetic=False, videos=0)
    for number in range(people):
        sit(folder, f"p{number}", behave, group=number)
    said = headlines(words_of(folder))
    for sentence in expected:
        assert sentence in said


def test_a_few_answers_and_an_empty_session_make_no_claim(results_folder: MakeFolder) -> None:
    folder = results_folder(0, synthetic=False, videos=0)
    sit(folder, "p1", attentive, most_answers=3)
    sit(folder, "p2", attentive, most_answers=0)
    text = words_of(folder)
    assert "No just noticeable difference can be given from the answers of 1 person." in headlines(text)
    assert "there is no result, for no participant has reached that study" in headlines(text)
    assert "1 session without an analysed response" in text


def test_people_and_simulated_observers_together_are_marked_everywhere(results_folder: MakeFolder) -> None:
    folder = results_folder(2, synthetic=False, videos=0)
    sit(folder, "p1", attentive)
    text = words_of(folder)
    assert "2 of 3 participants are simulated observers" in text
    assert "3 participants, people and simulated observers together, is estimated at" in headlines(text)
    figures = list((folder / "figures").glob("*.svg"))
    assert len(figures) >= 6
    for figure in figures:
        assert "people’s and simulated answers mixed" in figure.read_text(encoding="utf-8"), figure.name
    assert {row["kind"] for row in rows(folder, "participants")} == {"person", "simulated"}


def test_who_and_what_is_left_out_stands_with_counts_and_both_results(results_folder: MakeFolder) -> None:
    folder = results_folder(0, synthetic=False, videos=0, edit=with_rules)
    for number, behave in enumerate((attentive, attentive, stuttering, missing, stubborn)):
        sit(folder, f"p{number}", behave, group=number)
    text = words_of(folder)
    counted = {row["rule"]: (int(row["participants"]), int(row["answers"])) for row in rows(folder, "exclusion_rules")}
    assert counted["participants with no response in more than 30% of their trials"] == (1, 34)
    assert counted["participants who failed more than 50% of the attention checks"] == (1, 34)
    badly = counted["answers after a display failure"][1]
    assert badly > 0
    assert f"{68 + badly} answers of 170 are excluded from all results above; 2 participants entirely" in text
    assert "6 of 10 attention checks by 5 participants were passed" in text
    left_out = {row["participant"]: row["left_out"] for row in rows(folder, "participants")}
    assert (left_out["p0"], left_out["p3"]) == ("", "missed 100%")
    assert left_out["p4"] == "failed 100% of the checks"
    both = {row["result"]: row for row in rows(folder, "exclusions")}
    compared = both["Geodesic vs fixed: percent favouring geodesic over fixed"]
    assert compared["value"] != compared["all_value"]
    (shown,) = rows(folder, "presentation")
    assert int(shown["badly"]) > 0
    assert int(shown["again"]) > 0
    assert int(shown["frames_lost"]) == 3 * int(shown["badly"])
    assert float(shown["longest_gap"]) == 4.0
    assert (folder / "figures" / "presentation.svg").is_file()


def test_all_answers_left_out_is_said(results_folder: MakeFolder) -> None:
    folder = results_folder(0, synthetic=False, videos=0, edit=with_rules)
    sit(folder, "p0", stubborn)
    said = headlines(words_of(folder))
    assert "Just noticeable difference: there is no result, for all 28 answers are excluded by the rules" in said


def test_those_who_withdrew_are_counted_and_gone(results_folder: MakeFolder) -> None:
    folder = results_folder(0, synthetic=False, videos=0)
    sessions = [sit(folder, f"p{number}", attentive, group=number) for number in range(2)]
    with open_responses(folder) as responses:
        erase(responses, sessions[0])
    text = words_of(folder)
    assert "1 participant withdrew, and their answers are deleted" in text
    assert [row["participant"] for row in rows(folder, "participants")] == ["p1"]
    with open_responses(folder) as responses:
        erase(responses, sessions[1])
    with pytest.raises(AnalysisError, match=r"found none \(2 withdrawn\)"):
        write_report(folder)
