"""`segue fit` on what people hand over: other languages and encodings, JSON, scales in words, no table at all."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from study.analysis.foreign.columns import Columns, Foreign
from study.analysis.foreign.trials import read_trials
from study.analysis.foreign.words import BLANK, FIRST, NO, SECOND, YES
from study.apps.cli.fit import read_table

Fitted = Callable[..., dict[str, Any]]
Refused = Callable[..., str]
TWO_AFC = ("--task", "2afc", "--level", "level", "--answer", "c")


def rising(right: str = "1", wrong: str = "0", sep: str = ",") -> str:
    """Six levels of ten answers each, more and more of them right."""
    rows = [f"level{sep}c"]
    rows += [f"{level}{sep}{right if trial < 4 + level else wrong}" for level in range(1, 7) for trial in range(10)]
    return "\n".join(rows) + "\n"


def read(content: str | bytes, folder: Path, participant: str | None = None) -> Foreign:
    """The trials of a file, as `segue fit` reads them."""
    path = folder / "data.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_trials(read_table(path, ("level", "c")), Columns("c", participant, "level"), "2afc")


def right(found: Foreign) -> list[float]:
    """Right answers at each level; those of `rising` are 5 to 10."""
    sums: list[float] = found.table.groupby("level")["yes"].sum().tolist()
    return sums


RISING = [5, 6, 7, 8, 9, 10]


def test_no_word_stands_on_both_sides() -> None:
    for task in YES:
        yes, no = YES[task].split(), NO[task].split()
        assert not {*yes} & {*no}
        assert not {*yes, *no} & {*BLANK}
        assert [word.lower() for word in (*yes, *no)] == [*yes, *no]
    assert not {*FIRST.split()} & {*SECOND.split()}


@pytest.mark.parametrize(
    ("yes", "no"),
    [("WAHR", "FALSCH"), ("richtig", "falsch"), ("VRAI", "FAUX"), ("VERDADERO", "FALSO"), ("VERO", "FALSO"),
     ("VERDADEIRO", "FALSO"), ("WAAR", "ONWAAR"), ("PRAWDA", "FAŁSZ"), ("SANT", "FALSKT"), ("TOSI", "EPÄTOSI"),
     ("ИСТИНА", "ЛОЖЬ"), ("DOĞRU", "YANLIŞ"), ("oui", "non"), ("Sí", "No"), ("sim", "não"), ("はい", "いいえ"),
     ("T", "F"),      ("TRUE", "FALSE"), ("1.0", "0.0")],
)  # fmt: skip
@pytest.mark.parametrize("sep", [",", ";", "\t", "|"])
def test_truth_values_of_other_languages(tmp_path: Path, yes: str, no: str, sep: str) -> None:
    assert right(read(rising(yes, no, sep), tmp_path)) == RISING


def test_words_of_the_other_tasks_in_other_languages(fitted: Fitted) -> None:
    rows = ["difference;a", *(f"{d};{'verschieden' if d else 'gleich'}" for d in (-5, 0, 5) for _ in range(6))]
    rows.append("0;verschieden")
    assert fitted("\n".join(rows), "--task", "same-different", "--level", "difference", "--answer", "a")["used"] == 19
    rows = ["l,r,w", *(f"A,B,{word}" for word in ("links", "rechts", "gauche", "droite", "izquierda", "left"))]
    found = fitted("\n".join(rows), "--task", "preference", "--first", "l", "--second", "r", "--answer", "w")
    assert found["preference"]["preference"][0]["published"]["favouring"] == 4


@pytest.mark.parametrize(
    "encoded",
    [
        lambda text: text.encode("utf-8-sig"),
        lambda text: text.encode("utf-16"),
        lambda text: text.encode("utf-16-le"),
        lambda text: text.encode("utf-16-be"),
        lambda text: ("\ufeff\ufeff" + text).encode(),
        lambda text: text.replace("\n", "\r").encode(),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.replace("level,c", '"level","c"').encode("utf-8-sig"),
        lambda text: b"\n\n" + text.encode(),
        lambda text: ("sep=;\n" + text.replace(",", ";")).encode(),
        lambda text: text.replace(",", " ").encode(),
        lambda text: "".join(f"{'x' if line[0] == 'l' else 7},,{line}\n" for line in text.splitlines()).encode(),
    ],
    ids=["BOM", "UTF-16", "16 LE without BOM", "16 BE without BOM", "two BOMs", "CR", "CRLF", "quoted heading",
         "blank lines", "sep= line", "spaces", "columns without a heading"],
)  # fmt: skip
def test_encodings_line_ends_and_headings(tmp_path: Path, encoded: Callable[[str], bytes]) -> None:
    assert right(read(encoded(rising()), tmp_path)) == RISING


def test_only_a_heading_that_is_asked_for_may_not_stand_there_twice(tmp_path: Path, refused: Refused) -> None:
    text = rising().replace("level,c", "x,x,level,c").replace("\n1", "\n7,8,1")
    assert right(read("".join(f"7,8,{line}\n".replace("7,8,level", "x,x,level") for line in rising().splitlines()),
                      tmp_path)) == RISING  # fmt: skip
    assert "expected one column 'c', found 2" in refused(text.replace("x,x", "x,c"), *TWO_AFC)


@pytest.mark.parametrize(
    "nothing", ["", "NA", "N/A", "NaN", "null", "None", ".", "-", "#N/A", "undefined", "<NA>", "\\N"]
)
def test_cells_that_say_nothing(tmp_path: Path, nothing: str) -> None:
    found = read(rising() + f"3,{nothing}\n{nothing},1\n", tmp_path)
    assert (found.used, found.missed, found.blank) == (60, 1, 1)


# JSON


def trials() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = [{"trial_type": "preload", "view_history": [{"page": 1}], "rt": None}]
    for level in range(1, 7):
        found += [
            {"level": level, "c": trial < 4 + level, "subject": "p1", "response": {"Q0": trial % 5}}
            for trial in range(10)
        ]
    return found


@pytest.mark.parametrize(
    "stored",
    [
        json.dumps,
        lambda found: json.dumps(found, indent=2),
        lambda found: "\n".join(json.dumps(found[start : start + 20]) for start in range(0, len(found), 20)),
        lambda found: "\n".join(json.dumps(trial) for trial in found),
        lambda found: json.dumps({"trials": found, "id": 3}),
        lambda found: json.dumps([{"data": 1}, *found]),
        lambda found: json.dumps(json.dumps(found)).join("[]"),
        lambda found: "\ufeff" + json.dumps([found[:9], found[9:]]),
    ],
    ids=["jsPsych", "indented", "JATOS", "one a line", "in an object", "with another record",
         "JSON in JSON", "lists in a list"],
)  # fmt: skip
def test_trials_in_json(tmp_path: Path, stored: Callable[[Any], str]) -> None:
    found = read(stored(trials()), tmp_path, "subject")
    assert right(found) == RISING
    assert found.used == 60


def test_answers_inside_objects_of_json(fitted: Fitted) -> None:
    found = fitted(json.dumps(trials()), "--task", "rating", "--answer", "response.Q0", "--method", "level")
    assert found["used"] == 60


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[{"level": 1, "c": true}, {"level": 2', "line 1: expected JSON, found what can't be read as such"),
        ('[{"level": 1, "c": true},\n{"level": "far", "c": true}]', "row 2, column 'level': expected a number"),
        ('["a", "b"]', "expected trials, found JSON without a list of objects"),
        ('[{"level": 1}]', "expected a column 'c' for the answer, found level"),
        ('[{"level": ' + "9" * 5000 + ', "c": 1}]', "expected"),
        ('[{"a":' * 100_000, "expected"),
    ],
)
def test_json_that_is_no_table(refused: Refused, text: str, message: str) -> None:
    assert message in refused(text, *TWO_AFC)


def test_a_heading_in_brackets_is_no_json(fitted: Fitted) -> None:
    assert (
        fitted(rising().replace("level", "[level]"), "--task", "2afc", "--level", "[level]", "--answer", "c")["used"]
        == 60
    )


# What is no table


def archive(*names: str) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        for name in names:
            file.writestr(
                zipfile.ZipInfo(name),
                "application/vnd.oasis.opendocument.spreadsheet" if name == "mimetype" else "<x/>",
            )
    return content.getvalue()


@pytest.mark.parametrize(
    ("content", "name", "way_out"),
    [
        (archive("[Content_Types].xml", "xl/workbook.xml"), "an Excel spreadsheet (.xlsx)", "save it as CSV"),
        (archive("mimetype", "content.xml"), "a spreadsheet of LibreOffice (.ods)", "save it as CSV"),
        (archive("data.txt"), "a spreadsheet (.xlsx, .ods) or another ZIP archive", "unpack it"),
        (b"PK\x03\x04" + bytes(400), "a spreadsheet (.xlsx, .ods) or another ZIP archive", "save it as CSV"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(500), "older Excel (.xls)", "save it as CSV"),
        (b"PAR1" + bytes(50) + b"PAR1", "a Parquet file", "read_parquet"),
        (b"ARROW1\0\0", "a Feather (Arrow) file", "read_feather"),
        (b"$FL2@(#) IBM SPSS STATISTICS", "an SPSS file (.sav)", "save it as CSV"),
        (b"<stata_dta><header>", "a Stata file (.dta)", "save it as CSV"),
        (b"X\n\0\0\0\x03", "an R file (.rds)", "readRDS"),
        (gzip.compress(b"X\n\0\0\0\x03\0\x04", mtime=0), "an R file (.rds)", "readRDS"),
        (gzip.compress(b"RDX3\nX\n", mtime=0), "an R file (.RData)", "write.csv"),
        (gzip.compress(b"level,c\n1,1\n", mtime=0), "a compressed file (gzip)", "unpack it"),
        (bz2.compress(b"X\n"), "a compressed file (bzip2)", "unpack it"),
        (lzma.compress(b"X\n"), "a compressed file (xz)", "unpack it"),
        (b"\x80\x04\x95\x10", "a Python pickle (PsychoPy's .psydat)", "the .csv that PsychoPy writes"),
        (b"SQLite format 3\0", "an SQLite database", "export its table"),
        (b"%PDF-1.7", "a PDF document", "export the table"),
        (b"\n<!DOCTYPE html><html>", "a web page (HTML)", "save it as CSV"),
        (b"\xef\xbb\xbf<?xml version='1.0'?>", "XML", "save it as CSV"),
        (b"level,c\n1,1\0\0\0", "binary data", "export it as CSV"),
        (b"", "an empty file", "expected a table"),
    ],
)  # fmt: skip
def test_what_is_no_table_is_called_by_its_name(refused: Refused, content: bytes, name: str, way_out: str) -> None:
    message = refused(content, *TWO_AFC)
    assert "data.csv: " in message
    assert name in message
    assert way_out in message


@pytest.mark.parametrize("level", ["1e308", "-1e200", "1e13", "1e-320", "9" * 400])
def test_levels_past_all_use_are_refused_with_their_row(refused: Refused, level: str) -> None:
    message = refused(rising() + f"{level},1\n", *TWO_AFC)
    assert "row 62, column 'level': expected a" in message
    assert level in message


def test_counts_past_all_use_are_refused(refused: Refused) -> None:
    many = ("--task", "same-different", "--level", "level", "--answer", "c", "--shown", "n")
    assert "expected at most 1,000,000 answers" in refused("level,c,n\n0,1,2\n5,900000,5000000\n", *many)
    assert "row 3, column 'n': expected a number of answers between" in refused("level,c,n\n0,1,2\n5,1,1e308\n", *many)


# Ratings

RATED = ("--task", "rating", "--answer", "r", "--method", "m", "--participant", "who")
LIKERT = {
    "en": ("Strongly disagree", "Disagree", "Neutral", "Agree", "Strongly agree"),
    "de": ("stimme gar nicht zu", "stimme nicht zu", "weder noch", "stimme zu", "stimme völlig zu"),
    "fr": ("pas du tout d'accord", "pas d'accord", "neutre", "d'accord", "tout à fait d'accord"),
    "ja": ("全く同意しない", "同意しない", "どちらでもない", "同意する", "強く同意する"),
    "zh": ("差", "次", "中", "良", "优"),
}


def ratings(points: np.ndarray, words: tuple[str, ...] | None = None) -> str:
    rows = [
        f'p{person},{"ab"[method]},"{value if words is None else words[int(value) - 1]}"'
        for person, own in enumerate(points)
        for method, value in enumerate(own)
    ]
    return "\n".join(["who,m,r", *rows]) + "\n"


@pytest.mark.parametrize("language", LIKERT)
def test_words_of_a_scale_want_a_mapping(fitted: Fitted, refused: Refused, language: str) -> None:
    points, words = np.random.default_rng(1).integers(1, 6, (10, 2)), LIKERT[language]
    message = refused(ratings(points, words), *RATED)
    assert "row 2, column 'r': expected a number as the rating, found" in message
    assert all(f'--scale "{word}=..."' in message for word in {words[int(value) - 1] for value in points.ravel()})
    mapping = [part for point, word in enumerate(words, 1) for part in ("--scale", f"{word.upper()}={point}")]
    assert fitted(ratings(points, words), *RATED, *mapping)["ratings"] == fitted(ratings(points), *RATED)["ratings"]


def test_labelled_ends_and_numbers_between(fitted: Fitted) -> None:
    text = "who,m,r\np,a,1 = not at all\np,b,3\nq,a,2\nq,b,5 = very\n"
    found = fitted(text, *RATED, "--scale", "1 = not at all=1", "--scale", "5 = very=5")
    assert [row["mean"] for row in found["ratings"]["rating"]] == [1.5, 4.0]


def test_a_mapping_without_a_number_is_refused(refused: Refused) -> None:
    for given in ("Agree", "Agree=high", "=3"):
        assert 'expected --scale "WORD=POINT" as in "Agree=4"' in refused(
            "who,m,r\np,a,Agree\n", *RATED, "--scale", given
        )


@pytest.mark.parametrize("code", ["99", "999", "-9", "-99", "-999"])
def test_codes_for_no_answer_are_no_ratings(refused: Refused, fitted: Fitted, code: str) -> None:
    text = ratings(np.array([[1, 7], [3, 4], [5, 2], [4, 6], [7, 5], [3, 3]])) + f"p9,a,{code}\np9,b,4\n"
    message = refused(text, *RATED)
    assert f"row 14, column 'r': expected ratings like the others (1 to 7), found '{code}'" in message
    assert "found '" + code in refused(text, *RATED, "--ends", "1", "7")
    assert fitted(text, *RATED, "--ends", "-1000", "1000")["used"] == 14


def test_sliders_keep_their_ends(fitted: Fitted) -> None:
    """99 of 100 on a slider is a rating; 0 to 1 is a scale like any other."""
    values = np.random.default_rng(3).uniform(0, 100, (12, 2)).round(2)
    values[0] = 99, 100
    assert fitted(ratings(values), *RATED)["used"] == 24
    small = fitted(ratings((values / 100).round(4)), *RATED)
    assert small["ratings"]["rating"][0]["mean"] == pytest.approx(values[:, 0].mean() / 100, abs=1e-4)


def test_qualtrics_has_three_headings(fitted: Fitted) -> None:
    text = (
        'ResponseId,method,Q1\nResponse ID,Which one,"How natural, really?"\n'
        '"{""ImportId"":""_recordId""}","{""ImportId"":""method""}","{""ImportId"":""QID1""}"\n'
    )
    text += "".join(f"R{n},{m},{1 + (n + len(m)) % 5}\n" for n in range(8) for m in ("a", "bb"))
    found = fitted(text, "--task", "rating", "--answer", "Q1", "--method", "method", "--participant", "ResponseId")
    assert (found["rows"], found["used"]) == (16, 16)


def test_a_difference_alike_for_all_is_stated_without_a_ratio(fitted: Fitted) -> None:
    found = fitted(ratings(np.tile([5, 1], (12, 1))), *RATED)
    assert (
        "rating: b minus a over participants, for these motions -4.00, the same for all 12, exact sign test "
        "p = 0.000488" in found["answer"]
    )


# Preferences

PREFERRED = ("--task", "preference", "--first", "l", "--second", "r", "--answer", "c", "--participant", "who")


@pytest.mark.parametrize("place", ["first", "second"])
def test_an_order_that_decided_everything_is_said(fitted: Fitted, place: str) -> None:
    rows = [f"p{person},{pair},{place}" for person in range(8) for pair in ("A,B", "B,A")]
    found = fitted("who,l,r,c\n" + "\n".join(rows), *PREFERRED)
    assert found["answer"] == (
        f"Each of 16 answers favoured the one shown {place}: the order of presentation decided, which says "
        "nothing about A and B."
    )
    assert found["preference"]["preference"][0]["order"]["p_value"] == pytest.approx(2 * 0.5**8)


def test_an_order_that_matters_and_one_that_never_changed_are_said(fitted: Fitted) -> None:
    rng = np.random.default_rng(4)
    rows = [
        f"p{p},{pair},{'first' if rng.random() < 0.9 else 'second'}" for p in range(8) for pair in ("A,B", "B,A") * 3
    ]
    assert "The order of presentation mattered:" in fitted("who,l,r,c\n" + "\n".join(rows), *PREFERRED)["answer"]
    rows = [f"p{p},A,B,{'first' if rng.random() < 0.7 else 'second'}" for p in range(8) for _ in range(6)]
    assert (
        "The two were always shown in the same order" in fitted("who,l,r,c\n" + "\n".join(rows), *PREFERRED)["answer"]
    )


@pytest.mark.parametrize("orders", ["one each", "both"])
def test_a_method_that_never_loses_leaves_the_others_estimated(fitted: Fitted, orders: str) -> None:
    rng = np.random.default_rng(5)
    rows, wins, asked = [], 0, 0
    for person in range(8):
        for one, other in (("A", "B"), ("B", "C"), ("C", "A")) * 3:
            pair = (other, one) if orders == "both" and rng.random() < 0.5 else (one, other)
            chosen = "A" if "A" in pair else "B" if rng.random() < 0.6 else "C"
            wins, asked = wins + (chosen == "B"), asked + ("A" not in pair)
            rows.append(f"p{person},{pair[0]},{pair[1]},{chosen}")
    found = fitted("who,l,r,c\n" + "\n".join(rows), *PREFERRED)
    strengths = {row["method"]: row for row in found["bradley_terry"]["preference"]["strengths"]}
    assert strengths["A"]["value"] is None
    assert strengths["B"]["value"] == 0
    if orders == "one each":  # no effect of the order can be told then, and C against B is the logit of its share
        assert strengths["C"]["value"] == pytest.approx(np.log((asked - wins) / wins), abs=1e-4)
    assert strengths["C"]["standard_error"] > 0
    assert "A: the answers for or against it all go one way" in found["answer"]
    assert "Strengths in logits beside B: C " in found["answer"]


def test_the_only_answer_of_an_object_needs_no_name(fitted: Fitted) -> None:
    named = fitted(json.dumps(trials()), "--task", "rating", "--answer", "response.Q0", "--method", "level")
    unnamed = fitted(json.dumps(trials()), "--task", "rating", "--answer", "response", "--method", "level")
    assert unnamed["used"] == 60
    assert unnamed["ratings"] == named["ratings"]
