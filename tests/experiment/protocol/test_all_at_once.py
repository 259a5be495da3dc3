"""A misspelled key hides nothing: `segue check` says in the same run what else of the protocol can't be shown."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.apps.cli import run
from study.errors import ProtocolError
from study.experiment.protocol.whole import Protocol, load_protocol, protocols_folder

DEMO = (protocols_folder() / "demo.toml").read_text(encoding="utf-8")


def changed(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    text = DEMO
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study.toml"


def test_one_run_names_a_misspelled_key_a_missing_motion_and_impossible_levels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = changed(
        tmp_path, ("seed =", "sead ="), ('source = "walk"', 'source = "wlak"'),
        ("differences_frames = [", "differences_frames = [-600, "),
    )  # fmt: skip
    assert run(["check", str(path)]) == 2
    said = capsys.readouterr().err
    assert "sead: unknown key; did you mean 'seed'?" in said
    assert "found 'wlak'" in said
    assert "-600" in said


def test_what_remains_is_known_only_where_the_key_can_be_told(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError) as refused:
        load_protocol(changed(tmp_path, ("seed =", "sead =")))
    assert isinstance(refused.value.rest, Protocol)
    for change in (("[points]", "nothing_like_it = 1\n[points]"), ("fps = 30", "fps = -30")):
        with pytest.raises(ProtocolError) as refused:
            load_protocol(changed(tmp_path, ("seed =", "sead ="), change))
        assert refused.value.rest is None
