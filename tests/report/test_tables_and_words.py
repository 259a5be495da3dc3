"""Cells, CSV and sentences: how numbers are written, and what is said where there are none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from study.analysis.estimates import Interval
from study.analysis.same_different.analyse import SameDifferent, analyse_jnd
from study.analysis.same_different.counts import PercentDifferent, Side, Status, Threshold
from study.report import words
from study.report.media import _moments, strip_of_video
from study.report.sections.same_different.section import headline
from study.report.sections.section import About
from study.report.tables import as_csv, as_json, make, p_value, written


@pytest.mark.parametrize(
    ("value", "kind", "expected"),
    [
        (None, "two", "–"),
        (float("nan"), "two", "–"),
        (-1.234, "two", "−1.23"),
        (1470, "count", "1,470"),
        (-15.0, "count", "−15"),
        (96.43, "percent", "96.4%"),
        (0.00001, "p", "< .001"),
        (0.0121, "p", ".012"),
        (0.239, "p", ".24"),
        (1.0, "p", "1.00"),
    ],
)
def test_how_values_are_written(value: Any, kind: Any, expected: str) -> None:
    assert written(value, kind) == expected


def test_p_value_never_rounds_to_nothing() -> None:
    assert p_value(0.0009999) == "< .001"
    assert p_value(0.001) == ".001"


def test_files_have_all_columns_and_full_numbers() -> None:
    table = make(
        "x", "A table.", "remark percent", [{"remark": 'say "x", y', "percent": 0.123456789}, {"remark": "z"}],
        files_only="percent",
    )  # fmt: skip
    assert as_csv(table) == 'remark,percent\n"say ""x"", y",0.123456789\nz,\n'
    assert json.loads(as_json(table))["rows"] == [
        {"remark": 'say "x", y', "percent": 0.123456789},
        {"remark": "z", "percent": None},
    ]
    assert [[text for text, _ in row] for row in table.cells] == [['say "x", y'], ["z"]]


def threshold(side: Side, frames: float | None, note: str = "") -> Threshold:
    status: Status = "not reached" if frames is None else "reached"
    return Threshold(side, frames, None, Interval(None, None), status, "straight lines (Fieller)", note)


def without_model(**known: Any) -> SameDifferent:
    """The result of a study to which no model could be fitted."""
    nobody = pd.DataFrame({"participant": [], "difference_frames": [], "answer": []})
    return replace(analyse_jnd(nobody), model_note="no", **known)


NOWHERE: dict[Side, Threshold] = {
    "longer": threshold("longer", None, "not reached"),
    "shorter": threshold("shorter", None, "not reached"),
}


def test_a_threshold_that_is_not_reached_is_said_to_be_so() -> None:
    note = "not reached within the levels shown (largest 20 frames: 60%)"
    published = {"longer": threshold("longer", None, note), "shorter": threshold("shorter", 8.0)}
    result = without_model(published=published, answers=84, participants=2)
    said = headline(replace(result, model_note="every answer was “same”"), About("jnd", "JND"))
    assert said.statement == (
        "The just noticeable difference of 2 people is estimated at 8.0 frames (0.27 s) shorter (75% “different”)."
    )
    assert "Where the blend was longer: not reached within the levels shown" in said.detail
    assert "84 answers of 2 participants. No model was fitted: every answer was “same”." in said.detail


def level(frames: float, percent: float, low: float, high: float) -> PercentDifferent:
    return PercentDifferent(frames, 1, 42, int(percent * 0.42), percent, None, low, high, "")


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        # Enough answers to tell that the threshold lies below the smallest difference, or beyond the largest.
        ((level(5, 100, 83, 100), level(-5, 0, 0, 17)), "less than 5 frames longer and more than 5 frames shorter"),
        ((level(5, 100, 83, 100), level(10, 100, 83, 100)), "less than 5 frames longer (75%"),
    ],
)
def test_a_threshold_outside_the_levels_is_bounded_by_them(levels: tuple[PercentDifferent, ...], expected: str) -> None:
    result = without_model(published=NOWHERE, percent_different=levels, answers=42, participants=1)
    assert expected in headline(result, About("jnd", "JND")).statement


def test_one_answer_is_no_evidence_for_a_bound() -> None:
    levels = (level(5, 100, 20, 100),)
    result = without_model(published=NOWHERE, percent_different=levels, answers=1, participants=1)
    said = headline(result, About("jnd", "JND")).statement
    assert said == "No just noticeable difference can be given from the answers of 1 person."
    missed = replace(result, answers=0, participants=0, missed=42)
    assert "all 42 questions had no response" in headline(missed, About("jnd", "JND")).statement


def test_intervals_with_open_ends_are_said_to_be_open() -> None:
    assert words.interval(1.0, 2.0) == "1.0 to 2.0"
    assert words.interval(1.0, None) == "1.0 or more"
    assert words.interval(None, 2.0) == "2.0 or less"
    assert words.interval(None, None) == "no interval"


def test_mixed_data_are_marked() -> None:
    assert "mixed" in words.mark_of("mixed", synthetic=False)
    (warning,) = words.warnings_of("mixed", synthetic=False, simulated=3, participants=10)
    assert "3 of 10 participants are simulated" in warning
    assert words.warnings_of("collected", synthetic=False, simulated=0, participants=10) == []
    assert words.mark_of("collected", synthetic=False) == ""


def test_a_librarys_folder_is_named_without_its_path() -> None:
    assert words.library("/home/somebody/motions/cmu/") == "cmu"
    assert words.library("synthetic") == "synthetic"


def test_a_strip_shows_the_figure_and_underlines_the_blend(tmp_path: Path) -> None:
    import io

    import av
    import numpy as np
    from PIL import Image

    path = tmp_path / "x.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
        for frame in range(30):
            picture = np.full((120, 160, 3), 250, dtype=np.uint8)
            picture[30:100, 10 + 4 * frame : 22 + 4 * frame] = 40
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))
    strip = np.asarray(Image.open(io.BytesIO(strip_of_video(path, 0, 15))).convert("RGB")).astype(int)
    dark = (strip.max(axis=2) < 90).any(axis=0)
    starts = int((dark[1:] & ~dark[:-1]).sum())
    assert starts == 10, "ten moments, the figure in each"
    foot = strip[-2]
    blue = (foot[:, 2] - foot[:, 0]) > 80
    assert blue[: len(blue) // 2 - 4].all()
    assert not blue[len(blue) // 2 + 4 :].any()


def test_a_short_blend_is_in_the_strip_all_the_same() -> None:
    places = _moments(65, 30, 33)
    assert len(places) == 10
    assert ((places >= 30) & (places < 33)).sum() == 1
    assert list(places) == sorted(places)
