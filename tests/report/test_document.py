"""The report as a whole: self-contained, marked, escaped, repeatable, and honest on poor data."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image
from scipy import stats

from study.errors import AnalysisError, SegueError
from study.report.document import write_report
from study.report.material import gather

MakeFolder = Callable[..., Path]
VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Elements, ids and links of a page; an element that is closed out of order is an error."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)
        assert not self.open, f"never closed: {self.open}"

    @classmethod
    def of(cls, path: Path) -> Page:
        """The page of a file."""
        return cls(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.tags.append((tag, values))
        self.ids += [values["id"] or ""] if "id" in values else []
        self.links += [value for key, value in attrs if key in ("href", "src", "xlink:href") and value]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_page_needs_nothing_but_itself(written: Path) -> None:
    assert written.name == "report.html"
    page = Page.of(written)
    for link in page.links:
        assert link.startswith(("#", "data:")) or (written.parent / link).is_file(), link
    text = written.read_text(encoding="utf-8")
    assert not re.search(r"https?://(?!www\.w3\.org/)", text), "an address outside of SVG's namespaces"
    assert "@import" not in text
    assert not any(tag == "script" for tag, _ in page.tags)
    assert "default-src 'none'" in text


def test_ids_are_unique_and_inner_links_lead_somewhere(written: Path) -> None:
    page = Page.of(written)
    assert len(page.ids) == len(set(page.ids))
    for link in page.links:
        if link.startswith("#"):
            assert link[1:] in page.ids


def test_every_study_has_a_headline_figures_and_tables(written: Path) -> None:
    page, text = Page.of(written), written.read_text(encoding="utf-8")
    for words in ("Just noticeable difference", "Geodesic against fixed", "Naturalness", "Versions and hashes"):
        assert words in page.text
    assert "The just noticeable difference of the median of 4 simulated observers is estimated at" in page.text
    assert "answers favoured geodesic over fixed" in page.text
    drawings = re.findall(r'<svg[^>]* role="img" aria-labelledby="([^" ]+) ([^"]+)"', text)
    assert len(drawings) >= 6
    for title, description in drawings:
        assert title in page.ids
        assert description in page.ids


def test_intervals_are_those_of_the_protocols_alpha(written: Path) -> None:
    """The protocol's alpha is .01: 99% in words, in the analysis, and by Student's t (over people: two motions)."""
    text = Page.of(written).text
    assert "significance level 0.01, intervals of 99%" in text
    assert "95%" not in text
    analysis = json.loads((written.parent / "tables" / "analysis.json").read_text(encoding="utf-8"))
    assert {one["interval"]["confidence"] for one in analysis["headline"]} == {analysis["confidence"]} == {0.99}
    for row in analysis["ratings"]["naturalness"]:
        reach = stats.t.ppf(0.995, row["participants"] - 1) * row["standard_error"]
        assert row["high"] - row["mean"] == pytest.approx(reach)
    (compared,) = analysis["preference"]["geodesic_vs_fixed"]
    for end in ("low", "high"):  # Wilson: where the share found is as many standard errors off as 99% leave
        p, n = compared["published"]["interval"][end], compared["published"]["answers"]
        off = compared["published"]["favouring"] / n - p
        assert off**2 * n == pytest.approx(stats.norm.ppf(0.995) ** 2 * p * (1 - p), abs=1e-9)


def test_simulated_answers_and_synthetic_motions_are_marked_at_the_top_and_on_every_figure(
    written: Path,
) -> None:
    page, text = Page.of(written), written.read_text(encoding="utf-8")
    top = page.text[: page.text.index("In short")]
    assert "These answers are simulated" in top
    assert "The motions are synthetic" in top
    drawings = re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL)
    assert drawings
    for svg in drawings:
        assert "simulated answers, no people · synthetic motions, none captured" in svg


def test_captured_motions_are_not_called_synthetic(results_folder: MakeFolder) -> None:
    text = write_report(results_folder(synthetic=False), resamples=20).read_text(encoding="utf-8")
    assert "synthetic motions" not in text
    assert "obtained from mocap.cs.cmu.edu" in text
    assert "16_47" not in text
    assert "35_01" in text


def test_tables_are_written_as_csv_and_json(written: Path) -> None:
    folder = written.parent / "tables"
    names = {file.stem for file in folder.glob("*.csv")}
    assert names == {file.stem for file in folder.glob("*.json")} - {"analysis"}
    assert {"results", "confirmatory", "jnd_percent_different", "jnd_thresholds", "stimuli", "participants"} <= names
    with (folder / "jnd_percent_different.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["difference_frames"]) for row in rows] == [-15, -10, -5, 0, 5, 10, 20]
    content = json.loads((folder / "jnd_percent_different.json").read_text(encoding="utf-8"))
    assert float(rows[0]["percent"]) == content["rows"][0]["percent"]
    assert set(json.loads((folder / "analysis.json").read_text(encoding="utf-8"))) >= {"jnd", "preference", "ratings"}


def test_results_in_numbers_are_the_headlines(written: Path) -> None:
    with (written.parent / "tables" / "results.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    headlines = json.loads((written.parent / "tables" / "analysis.json").read_text(encoding="utf-8"))["headline"]
    assert [row["generalises_to"] for row in rows] == [one["generalises_to"] for one in headlines]
    for row, one in zip(rows, headlines, strict=True):
        assert row["value"] == ("" if one["estimate"] is None else str(one["estimate"]))
        assert row["low"] == ("" if one["interval"]["low"] is None else str(one["interval"]["low"]))


def test_figures_are_numbered_and_stand_beside_the_page_for_print(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    for word in ("Figure", "Table"):
        pattern = rf"<b>{word} (\d+)\.</b>" if word == "Figure" else r'id="caption-[^"]+">Table (\d+)\. '
        found = [int(number) for number in re.findall(pattern, text)]
        assert sorted(found) == list(range(1, len(found) + 1))
        assert len(found) >= 6
    pictures = sorted((written.parent / "figures").glob("*.png"))
    assert {path.stem for path in pictures} == {path.stem for path in (written.parent / "figures").glob("*.svg")}
    for path in pictures:
        with Image.open(path) as picture:
            assert picture.info["dpi"] == pytest.approx((300, 300), abs=0.1)
            assert picture.convert("RGB").getpixel((1, 1)) == (255, 255, 255)
        assert path.with_suffix(".pdf").read_bytes().startswith(b"%PDF")


def test_the_manuscript_has_the_pages_text_tables_and_figures(written: Path) -> None:
    text = (written.parent / "manuscript.md").read_text(encoding="utf-8")
    assert text.startswith("# A small study\n\n> These answers are simulated.")
    for heading in ("## Methods", "### Participants and design", "## Results", "### Naturalness", "## References"):
        assert f"\n{heading}\n" in text
    for path in re.findall(r"!\[Figure \d+\. [^\]]*\]\(([^)]+)\)", text):
        assert (written.parent / path).is_file()
    tables = [block for block in text.split("\n\n") if block.startswith("| ")]
    assert len(tables) == text.count("**Table ") >= 5
    for table in tables:
        widths = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(widths) == 1, table


def test_the_same_folder_gives_the_same_bytes(results_folder: MakeFolder) -> None:
    folder = results_folder(3)
    first = write_report(folder, resamples=20).read_bytes()
    assert write_report(folder, resamples=20).read_bytes() == first
    assert not list(folder.rglob("*.part"))


def test_what_people_wrote_is_escaped(results_folder: MakeFolder) -> None:
    attack = "<script>alert(1)</script> & $x^2$"
    page = write_report(results_folder(2, title=attack), resamples=20).read_text(encoding="utf-8")
    assert "<script>" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; $x^2$" in page


def test_a_folder_without_answers_is_refused(results_folder: MakeFolder) -> None:
    folder = results_folder(0)
    with pytest.raises(AnalysisError, match="expected answers, found none"):
        write_report(folder)
    (folder / "responses.sqlite").unlink()
    with pytest.raises(SegueError, match="found no database"):
        write_report(folder)
    assert not (folder / "report.html").exists()


def test_a_folder_without_manifest_is_refused(results_folder: MakeFolder) -> None:
    folder = results_folder(1)
    (folder / "manifest.json").unlink()
    with pytest.raises(SegueError, match="manifest"):
        write_report(folder)


def test_one_participant_and_no_videos(results_folder: MakeFolder) -> None:
    path = write_report(results_folder(1, videos=0), resamples=20)
    page = Page.of(path)
    assert "1 simulated observer" in page.text
    assert not any(tag in ("video", "img") for tag, _ in page.tags)
    assert "None" not in page.text.replace("None of them was captured", "")
    assert "nan" not in page.text.lower()


def test_importing_the_report_loads_nothing_heavy() -> None:
    code = (
        "import sys; import study.report.document, study.report.drawing, study.report.sections.registry; "
        "heavy = {'matplotlib', 'pandas', 'scipy', 'av', 'PIL', 'jinja2', 'sqlalchemy'} & set(sys.modules); "
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[2])


def test_gathering_reads_all_parts(results_folder: MakeFolder) -> None:
    material = gather(results_folder(2))
    assert material.protocol.name == "small"
    assert set(material.answers["participant"]) == {"sim-001", "sim-002"}
    assert len(material.sessions) == 2
