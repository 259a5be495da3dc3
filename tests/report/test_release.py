"""A release: whoever has the folder gets the same results, and learns nothing of who took part."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import psych_ds
import pytest

from study.apps.cli import run
from study.experiment import simulation
from study.experiment.store.answers import record_form
from study.experiment.store.participants import erase
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import all_sessions, begin_session
from study.report import release

MakeFolder = Callable[..., Path]
OPTIONS = ["--to", "release", "--author", "Doe, Jane", "--author", "A laboratory", "--licence", "CC-BY-4.0"]
FORM = '\nform = [{ name = "age" }, { name = "club", label = "Your club" }]\n\n[stimuli]\n'


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory, any_folder: MakeFolder) -> Path:
    """A folder with films, in which eight people answered, one of whom withdrew."""

    def begun(*given: Any, **named: Any) -> Any:
        return begin_session(*given, **{**named, "simulated": False})

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(simulation, "begin_session", begun)
        patched.setattr(simulation, "draw_plan", partial(_renamed, simulation.draw_plan))
        folder = any_folder(
            tmp_path_factory.mktemp("people") / "small",
            8,
            videos=99,
            edit=lambda text: text.replace("\n[stimuli]\n", FORM),
        )
    with open_responses(folder) as responses:
        sessions = all_sessions(responses)
        for number, record in enumerate(sessions):
            record_form(responses, record, {"age": str(20 + number), "club": f"Anna's {number}"})
        erase(responses, sessions[2].id)
    manifest = folder / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"library": "synthetic"', '"library": "/home/anna/motions"'))
    return folder


@pytest.fixture(scope="module")
def released(people: Path) -> Path:
    """What somebody else has of it."""
    assert run(["export", str(people), *OPTIONS]) == 0
    return Path(shutil.move(people / "release", people.parent / "downloaded"))


def _renamed(draw: Callable[..., Any], protocol: Any, pairs: Any, name: str, *rest: Any, **named: Any) -> Any:
    return draw(protocol, pairs, name.replace("sim", "anna"), *rest, **named)


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    assert run([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_whoever_has_the_release_gets_the_same_results(
    people: Path, released: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine, theirs = (told(capsys, "analyse", str(folder))["headline"] for folder in (people, released))
    assert [one["statement"] for one in theirs] == [one["statement"] for one in mine]
    assert [one["estimate"] for one in theirs] == pytest.approx([one["estimate"] for one in mine], rel=1e-5)
    assert [one["p"] or 0 for one in theirs] == pytest.approx([one["p"] or 0 for one in mine], rel=1e-4)
    (fitted,) = told(capsys, "fit", str(released / "data" / "task-geodesicvsfixed_data.csv"))["headline"]
    (known,) = (one for one in mine if one["study"] == "geodesic_vs_fixed")
    assert fitted["estimate"] == pytest.approx(known["estimate"])
    subprocess.run(["sha256sum", "--check", "--strict", "--quiet", "SHA256SUMS"], cwd=released, check=True)
    listed = {line.split("  ")[1] for line in (released / "SHA256SUMS").read_text().splitlines()}
    there = {path.relative_to(released).as_posix() for path in released.rglob("*") if path.is_file()}
    assert listed == there - {"SHA256SUMS"}
    assert {"README.md", "LICENSE", "CITATION.cff", "protocol.toml", "results/report.html"} <= listed
    assert psych_ds.problems(released) == []
    assert len([*released.glob("stimuli/*.mp4")]) == len(
        json.loads((released / "manifest.json").read_text())["stimuli"]
    )


def test_nothing_in_a_release_says_who_took_part(released: Path) -> None:
    for path in released.rglob("*"):
        assert not path.is_file() or b"anna" not in path.read_bytes().lower(), path
    with open_responses(released) as responses:
        sessions = all_sessions(responses)
        with responses.engine.connect() as connection:
            times = connection.exec_driver_sql(
                "SELECT answered_at FROM answers UNION SELECT at FROM events UNION SELECT at FROM form_values "
                "UNION SELECT started_at FROM sessions"
            ).scalars()
            assert {time[:10] for time in times} == {"1970-01-01"}
            left = {name: connection.exec_driver_sql(f"SELECT count(*) FROM {name}").scalar() for name in
                    ("participants", "withdrawals", "events")}  # fmt: skip
            details = connection.exec_driver_sql("SELECT count(*) FROM events WHERE detail_json IS NOT NULL").scalar()
    assert [one.participant for one in sessions] == [one.plan.participant for one in sessions]
    assert [one.participant for one in sessions] == [f"p{number:03d}" for number in range(1, 8)]
    assert (left["participants"], left["withdrawals"], details) == (0, 0, 0)
    assert left["events"]


def test_people_come_in_another_order(people: Path) -> None:
    from study.experiment.protocol.whole import load_protocol
    from study.experiment.store.anonymous import without_identities
    from study.experiment.store.frames import answers_frame

    protocol = load_protocol(people / "protocol.toml")
    with open_responses(people) as responses, without_identities(protocol, responses, shuffle=list.reverse) as copy:
        own, other = (answers_frame(one) for one in (responses, copy))
    names = {f"anna-{n:03d}": f"p{p:03d}" for p, n in enumerate((8, 7, 6, 5, 4, 2, 1), start=1)}
    assert set(own["participant"]) == set(names)
    for name, code in names.items():
        mine = own[own["participant"] == name].drop(columns=["participant", "answered_at"])
        theirs = other[other["participant"] == code].drop(columns=["participant", "answered_at"])
        assert mine.to_csv(index=False) == theirs.to_csv(index=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (OPTIONS[:2], "found no author; add --author NAME and --licence, such as CC-BY-4.0"),
        (OPTIONS[:4], "found no licence; add --author NAME and --licence, such as CC-BY-4.0"),
        ([*OPTIONS[:-1], "mine"], "--licence: expected an identifier of spdx.org/licenses"),
        (OPTIONS, "expected all stimuli rendered, found"),
    ],
)
def test_what_a_release_lacks_is_said(
    results_folder: MakeFolder, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    folder = results_folder(1, videos=1)
    assert run(["export", str(folder), *options]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not (folder / "release").exists()


def test_a_release_of_simulated_answers_says_so(results_folder: MakeFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(release, "write_report", lambda *_, **__: None)
    folder = results_folder(2, videos=99)
    assert run(["export", str(folder), *OPTIONS]) == 0
    for name in ("README.md", "CITATION.cff", "dataset_description.json"):
        assert "simulated answers, no people" in (folder / "release" / name).read_text(encoding="utf-8")
    with open_responses(folder / "release") as responses:
        assert [(one.participant, one.simulated) for one in all_sessions(responses)] == [
            ("sim-001", True), ("sim-002", True)]  # fmt: skip
