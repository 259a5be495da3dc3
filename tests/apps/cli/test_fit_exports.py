"""`segue fit` on exports as PsychoPy, jsPsych and Gorilla really write them, in every task it takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm


def chance_different(frames: float) -> float:
    delta = abs(frames) * 0.35
    return float(norm.sf((2 - delta) / 2**0.5) + norm.cdf((-2 - delta) / 2**0.5))


def psychopy_pairs(rng: np.random.Generator, *, sep: str = ",", decimal: str = ".", keys: str = "{}") -> str:
    """PsychoPy, wide: practice rows, screens without a trial, rows that end in a delimiter, empty rows."""
    names = ["trials.thisN", "phase", "difference", "order", "key_resp.keys", "key_resp.rt", "participant", "date", ""]
    rows = [sep.join(names), sep.join(["", "", "", "", "space", f"3{decimal}1", "7", "2026-11-22_10h", ""])]
    for number in range(330):
        phase = "practice" if number < 8 else "main"
        difference = (-15, -10, -5, 0, 5, 10, 20)[number % 7]
        key = "d" if rng.random() < chance_different(difference) else "s"
        order = ("ref", "comp")[rng.integers(2)]
        shown = f"{difference}{decimal}0"
        rows.append(sep.join([str(number), phase, shown, order, keys.format(key), f"0{decimal}71", "7", "2026", ""]))
        if number % 50 == 0:
            rows += ["", sep * 8]
    rows.append(sep.join(["330", "main", f"5{decimal}0", "ref", "None", "", "7", "2026", ""]))
    return "\r\n".join(rows) + "\r\n"


PAIRS = ("--task", "same-different", "--level", "difference", "--answer", "key_resp.keys", "--yes", "d",
         "--participant", "participant", "--where", "phase=main")  # fmt: skip


@pytest.mark.parametrize(
    ("sep", "decimal", "keys"), [(",", ".", "{}"), (";", ",", "{}"), ("\t", ",", "{}"), (",", ".", "['{}']")]
)
def test_psychopy_pairs_in_any_locale(fitted: Callable[..., dict[str, Any]], sep: str, decimal: str, keys: str) -> None:
    text = psychopy_pairs(np.random.default_rng(1), sep=sep, decimal=decimal, keys=keys)
    found = fitted(text, *PAIRS, "--order", "order", "--reference-first", "ref")
    assert (found["used"], found["missed"]) == (322, 1)
    assert found["model"]["jnd"]["longer"]["frames"] == pytest.approx(8.4, abs=2.5)
    assert abs(found["order_test"]["difference_percent"]) < 15
    plain = fitted(text, *PAIRS)
    assert plain["model"]["jnd"] == found["model"]["jnd"]
    assert plain["order_test"]["difference_percent"] is None


def test_an_effect_of_the_order_is_seen_through_its_column(fitted: Callable[..., dict[str, Any]]) -> None:
    """The same answers with an order that decided them: the test sees it, and turned round it sees the same."""
    rng = np.random.default_rng(2)
    rows = ["who,difference,order,answer"]
    for trial in range(840):
        difference, first = (-15, -10, -5, 0, 5, 10, 20)[trial % 7], bool(rng.integers(2))
        chance = min(max(chance_different(difference) + (0.2 if first else -0.2), 0), 1)
        rows.append(
            f"{trial % 6},{difference},{'AB' if first else 'BA'},{'different' if rng.random() < chance else 'same'}"
        )
    common = ("--task", "same-different", "--level", "difference", "--answer", "answer", "--participant", "who")
    one = fitted("\n".join(rows), *common, "--order", "order", "--reference-first", "AB")
    other = fitted("\n".join(rows), *common, "--order", "order", "--reference-first", "ba")
    assert one["order_test"]["p_value"] < 0.001
    assert other["order_test"]["p_value"] == pytest.approx(one["order_test"]["p_value"])


def test_an_order_that_says_nothing_is_refused(refused: Callable[..., str]) -> None:
    text = "difference,order,answer\n0,AB,same\n5,BA,different\n-5,,same\n"
    common = ("--task", "same-different", "--level", "difference", "--answer", "answer", "--order", "order")
    assert "expected --reference-first with --order: which of '', 'AB', 'BA'" in refused(text, *common)
    assert "expected 'XY' and another word" in refused(text, *common, "--reference-first", "XY")
    assert "expected 'AB' and another word in every row" in refused(text, *common, "--reference-first", "AB")


def preferences(rng: np.random.Generator, people: int = 12) -> list[tuple[str, str, str, str, str]]:
    """Who, motion, first, second, chosen method: 80% for geodesic."""
    rows = []
    for person in range(people):
        for motion in ("walk", "run", "turn", "stand", "jog", "idle"):
            pair = ["geodesic", "fixed"]
            rng.shuffle(pair)
            rows.append((f"P{person}", motion, *pair, "geodesic" if rng.random() < 0.8 else "fixed"))
    return rows


def test_jspsych_preferences_with_objects_in_their_cells(fitted: Callable[..., dict[str, Any]]) -> None:
    """jsPsych: all cells quoted, an object a response, other screens between the trials."""
    rows = ['"rt","stimulus","response","trial_type","subject","first","second","motion"']
    for who, motion, first, second, chosen in preferences(np.random.default_rng(3)):
        rows.append(f'"812","","","preload","{who}","","",""')
        button = "first" if chosen == first else "second"
        rows.append(
            f'"1023","[""a.mp4"",""b.mp4""]","{{""choice"":""{button}""}}","survey-multi-choice","{who}","{first}",'
            f'"{second}","{motion}"'
        )
    rows.append('"5000","","{""age"":""31"",""comment"":""nice,\nreally""}","survey-text","P0","","",""')
    found = fitted(
        "\n".join(rows),
        *("--task", "preference", "--first", "first", "--second", "second", "--answer", "response.choice"),
        *("--participant", "subject", "--motion", "motion"),
    )
    (compared,) = found["preference"]["preference"]
    assert {compared["method_a"], compared["method_b"]} == {"geodesic", "fixed"}
    percent = compared["published"]["percent"]
    assert (percent if compared["method_a"] == "geodesic" else 100 - percent) == pytest.approx(80, abs=12)
    assert compared["published"]["answers"] == found["used"] == 72
    assert compared["participants"]["participants"] == 12
    assert len(compared["motions"]) == 6
    assert compared["order"]["answers"] == 72
    assert "favoured" in found["answer"]


def test_preferences_named_by_the_method_chosen_with_ties(fitted: Callable[..., dict[str, Any]]) -> None:
    rows = ["left;right;choice;id", *(f"{a};{b};{c};{w}" for w, _, a, b, c in preferences(np.random.default_rng(4)))]
    rows += ["geodesic;fixed;no difference;P0", "geodesic;fixed;;P1", ";;;"]
    common = (
        "--task",
        "preference",
        "--first",
        "left",
        "--second",
        "right",
        "--answer",
        "choice",
        "--participant",
        "id",
    )
    found = fitted("\n".join(rows), *common, "--tie", "no difference")
    (compared,) = found["preference"]["preference"]
    assert (compared["ties"], found["missed"], compared["published"]["answers"]) == (1, 1, 72)


def gorilla_ratings(rng: np.random.Generator) -> str:
    """Gorilla: a mark at the start, an event index, rows of other zones, END OF FILE at the end; two questions."""
    rows = ["Event Index,UTC Date,Participant Private ID,Zone Type,Method,Question,Response"]
    event = 0
    for person in range(14):
        own = rng.normal(scale=0.5)
        methods = ["cut-a", "cut-b"] if person % 2 else ["cut-b", "cut-a"]
        for method in methods:
            event += 1
            rows.append(f"{event},2026-11-22,{900 + person},content_video,{method},,")
            for question in ("natural", "quality"):
                event += 1
                lean = 3 + own + (1.0 if method == "cut-b" else 0.0) + 0.7 * rng.normal()
                point = int(np.clip(round(lean), 1, 5))
                rows.append(f"{event},2026-11-22,{900 + person},response_rating_scale,{method},{question},{point}")
    rows.append("END OF FILE,,,,,,")
    return "\ufeff" + "\r\n".join(rows) + "\r\n"


def test_gorilla_ratings(fitted: Callable[..., dict[str, Any]]) -> None:
    found = fitted(
        gorilla_ratings(np.random.default_rng(5)),
        *("--task", "rating", "--answer", "Response", "--method", "Method", "--item", "Question"),
        *("--participant", "Participant Private ID", "--where", "Zone Type=response_rating_scale"),
    )
    assert (found["rows"], found["used"]) == (84, 56)
    table = {(row["item"], row["method"]): row for row in found["ratings"]["rating"]}
    assert len(table) == 4
    assert table["natural", "cut-b"]["mean"] > table["natural", "cut-a"]["mean"]
    question = found["rating_anova"]["rating"][0]
    assert question["anova"][0]["error_degrees_of_freedom"] == 24
    assert question["difference"]["of"] == "cut-b minus cut-a"
    assert "F(1, 24)" in found["answer"]


def test_jspsych_likert_answers_by_name(fitted: Callable[..., dict[str, Any]]) -> None:
    rows = ["method,response,run"]
    rows += [f'{m},"{{""Q0"":{i % 5},""Q1"":{i % 3}}}",{i % 4}' for i in range(20) for m in ("a", "b")]
    common = ("--task", "rating", "--method", "method", "--participant", "run", "--answer")
    first, second = fitted("\n".join(rows), *common, "response.Q0"), fitted("\n".join(rows), *common, "response.Q1")
    assert first["used"] == second["used"] == 40
    assert first["ratings"] != second["ratings"]


def test_utf16_and_files_joined_with_their_headings(fitted: Callable[..., dict[str, Any]]) -> None:
    part = "level\tanswer\n" + "\n".join(f"{level}\t{int(level > 2)}" for level in range(6) for _ in range(5)) + "\n"
    text = "\ufeff" + part + "\ufeff" + part
    found = fitted(text.encode("utf-16"), "--task", "yes-no", "--level", "level", "--answer", "answer")
    assert found["used"] == found["rows"] == 60


@pytest.mark.parametrize(
    ("text", "more", "message"),
    [
        ("level;answer\n1,234;1\n2,500;0\n", (), "row 2, column 'level': '1,234' may be thousands or decimals"),
        ("level;answer\n0,5;1\n0.7;0\n", (), "one way to write decimals, found '0,5' in row 2 and '0.7' in row 3"),
        ("level,answer\n1,1,extra\n", (), "row 2: expected 2 cells as in the heading, found 3"),
        ('level,answer\n1,"{""Q0"":1,""Q1"":0}"\n', (), "expected one answer, found 2; name one of them: answer.Q0 or"),
        ("level,answer\n1,\"['left', 'right']\"\n", (), "row 2, column 'answer': expected one answer"),
        ("level,answer,answer\n1,1,0\n", (), "expected one column 'answer', found 2"),
        ("level;answer\n1.234,5;1\n", ("--decimal", "comma"), "row 2, column 'level': expected a number"),
        ("level,answer\ninf,1\n", (), "row 2, column 'level': expected a number"),
        ("level,answer,who\n1,1,a\n2,0,\n", ("--participant", "who"), "row 3, column 'who': expected a participant"),
        ('level,answer\n1,1\n2,"a\n', (), "row 3: expected a table"),
        (b"level,answer\n1,\xff\n", (), "expected a table of UTF-8 text"),
        ("level,answer\n1,1\n", ("--method", "answer"), "expected no --method with --task 2afc"),
        ("level,answer\n1,1\n", ("--guess", "0.5"), "expected no --guess with --task 2afc"),
    ],
)
def test_what_can_not_be_told_is_refused(
    refused: Callable[..., str], text: str | bytes, more: tuple[str, ...], message: str
) -> None:
    assert message in refused(text, "--task", "2afc", "--level", "level", "--answer", "answer", *more)


def test_a_stated_decimal_or_delimiter_is_taken(fitted: Callable[..., dict[str, Any]]) -> None:
    rows = "\n".join(f"{level},{'250' if level else '500'};{int(level > 1)}" for level in range(1, 4) for _ in range(4))
    found = fitted(
        "level;answer\n" + rows, "--task", "2afc", "--level", "level", "--answer", "answer", "--decimal", "comma"
    )
    assert [row["level"] for row in found["levels"]] == [1.25, 2.25, 3.25]
    odd = fitted("level,x;answer\n1;1\n2;0\n3;1\n", "--task", "2afc", "--level", "level,x", "--answer", "answer",
                 "--delimiter", "semicolon")  # fmt: skip
    assert odd["used"] == 3


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (
            "a,b,c\nx,x,1\n",
            ("preference", "--first", "a", "--second", "b"),
            "row 2: expected two methods, found 'x' twice",
        ),
        ("a,b,c\nx,y,0\n", ("preference", "--first", "a", "--second", "b"), "expected first or second, or the method"),
        ("a,b,c\nx,y,1\n", ("preference", "--first", "a"), "expected --first and --second"),
        ("a,b,c\nx,y,\n", ("preference", "--first", "a", "--second", "b"), "expected rows with a, b and c, found none"),
        (
            "a,b,c\nx,y,p\nx,y,q\nx,y,r\n",
            ("preference", "--first", "a", "--second", "b", "--yes", "p"),
            "expected answers p and one other, found 'p', 'q', 'r'",
        ),
        ("a,b,c\nx,y,good\n", ("rating",), "row 2, column 'c': expected a number as the rating, found 'good'"),
        ("a,b,c\nx,y,\n", ("rating", "--method", "a"), "expected rows with c, found none in 1 row;"),
        ("level,c\n1,1\n", ("2afc",), "expected --level with --task 2afc"),
    ],
)
def test_preferences_and_ratings_that_can_not_be_understood(
    refused: Callable[..., str], text: str, arguments: tuple[str, ...], message: str
) -> None:
    assert message in refused(text, "--task", arguments[0], "--answer", "c", *arguments[1:])


@pytest.mark.parametrize("answer", ["first", "second", ""])
@pytest.mark.parametrize("people", [1, 4])
def test_one_sided_preferences_give_a_statement(
    fitted: Callable[..., dict[str, Any]], answer: str, people: int
) -> None:
    rows = ["a,b,c,who", *(f"x,y,{answer},p{person}" for person in range(people) for _ in range(3)), "x,y,first,p0"]
    found = fitted(
        "\n".join(rows),
        *("--task", "preference", "--first", "a", "--second", "b"),
        "--answer",
        "c",
        "--participant",
        "who",
    )
    assert found["answer"]


def test_ratings_all_alike_give_a_statement(fitted: Callable[..., dict[str, Any]]) -> None:
    rows = ["m,c,who", *(f"{m},3,p{person}" for person in range(4) for m in "ab")]
    found = fitted("\n".join(rows), "--task", "rating", "--answer", "c", "--method", "m", "--participant", "who")
    question = found["rating_anova"]["rating"][0]
    assert question["difference"]["p_value"] is None
