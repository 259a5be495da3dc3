"""Protocols past what anybody means: refused with their place, and in a time that grows with their length alone."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from growth import assert_linear

from study.errors import ProtocolError
from study.experiment.protocol.proofreading import to_do
from study.experiment.protocol.whole import Protocol, load_protocol, parse_protocol
from study.experiment.wording import all_texts

GOOD = Path(__file__).parents[3].joinpath("protocols", "demo.toml").read_text()


def refused(text: str) -> str:
    with pytest.raises(ProtocolError) as caught:
        parse_protocol(text, Path("demo.toml"))
    assert len(str(caught.value)) < 20_000
    return str(caught.value)


def with_line(line: str) -> str:
    """The demo with a line at its top."""
    return f"{line}\n{GOOD}"


def instructed(words: str) -> Protocol:
    own = re.search(r'(?<=^instructions = ").*(?="$)', GOOD, re.MULTILINE)
    assert own is not None
    return parse_protocol(GOOD[: own.start()] + words + GOOD[own.end() :])


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("more = " + "9" * 5000, "expected TOML, found a number or a date out of range"),
        ("more = 0x" + "f" * 5000, "more: expected a whole number of at most 64 bits"),
        ("more = 9223372036854775808", "more: expected a whole number of at most 64 bits"),
        ("more = [1, 2, -9223372036854775809]", r"more[2]: expected a whole number of at most 64 bits"),
        ("more = " + "[" * 30_000 + "]" * 30_000, "expected keys and lists at most 20 deep"),
        ("more = " + "[" * 25 + "]" * 25, "expected keys and lists at most 20 deep"),
        ("more = " + "{a=" * 400 + "1" + "}" * 400, "expected keys and lists at most 20 deep"),
        (".".join(["a"] * 30_000) + " = 1", "expected keys and lists at most 20 deep"),
        (".".join(['"a b"'] * 30_000) + " = 1", "expected keys and lists at most 20 deep"),
        ("# " + "x" * 1_000_000, "expected at most 1,000,000 letters"),
        ("x" * 50_000 + " = 1", "unknown key; valid keys here"),
        ("participants = inf", "participants: expected a whole number"),
    ],
)
def test_toml_past_what_is_meant_is_refused(line: str, message: str) -> None:
    assert message in refused(with_line(line))


@pytest.mark.parametrize(
    "line",
    [
        lambda count: "more = " + "9" * count,
        lambda count: "more = 0x" + "f" * count,
        lambda count: "more = " + "[" * count + "]" * count,
        lambda count: "more = " + "{a=" * count + "1" + "}" * count,
        lambda count: ".".join(["a"] * count) + " = 1",
        lambda count: ".".join(['"a b"'] * count) + " = 1",
        lambda count: "# " + "x" * 300 * count,
        lambda count: "x" * count + " = 1",
        lambda count: "more = " + str([0] * count),
        lambda count: "\n".join(f"unknown{k} = 1" for k in range(count // 4)),
    ],
)
def test_toml_is_refused_in_a_time_by_its_length(line: Callable[[int], str]) -> None:
    assert_linear(lambda count: lambda: refused(with_line(line(count))), 30_000)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("fps = 30", "fps = 1e308", "fps: expected at most 240 in frames per second, found 1e+308"),
        ("fps = 30", "fps = nan", "fps: expected a finite number in frames per second, found nan"),
        ("answer_s = 5.0", "answer_s = inf", "timing.answer_s: expected a finite number in seconds, found inf"),
        ("[points]\n", "[points]\nsource_s = 1e308\n", "points.source_s: expected at most 86400 in seconds"),
        ("[-15, -10, -5, 0, 5, 10, 20]", "[0, 1000000000]", "differences_frames[1]: expected at most 600"),
        (
            "[-15, -10, -5, 0, 5, 10, 20]",
            str([0] * 30_000),
            "differences_frames: expected at most 1,000 entries",
        ),
        ('name = "jnd"', f'name = "{"a" * 5000}"', "studies[0].name: expected at most 100 letters, found 'aaa"),
        ('title = "A', f'title = "{"a" * 30_000}', "title: expected at most 20,000 letters"),
    ],
)
def test_values_past_what_is_meant_are_refused(old: str, new: str, message: str) -> None:
    assert old in GOOD
    assert message in refused(GOOD.replace(old, new, 1))


def test_a_form_has_no_infinite_number() -> None:
    field = '[[form]]\nname = "age"\nlabel = "Your age"\nkind = "number"\nleast = -inf\n'
    assert "form[0].least: expected a finite number, found -inf" in refused(f"{GOOD}\n{field}")


def test_a_question_named_by_a_list_is_refused() -> None:
    assert "form[0].name: expected text in quotes" in refused(f"{GOOD}\n[[form]]\nname = []\n")


def test_of_thousands_of_mistakes_the_first_are_told() -> None:
    lines = refused(with_line("\n".join(f"unknown{k} = 1" for k in range(8000)))).splitlines()
    assert len(lines) == 51
    assert lines[0].startswith("demo.toml:1: unknown0: unknown key")
    assert lines[-1] == "demo.toml: 7,950 more problems; mend these first."


def test_transitions_are_checked_in_a_time_by_their_number() -> None:
    def more(count: int) -> str:
        one = '[[transitions]]\nname = "t{0}"\ncategory = "c"\nsource = "walk"\ndestination = "run"\n'
        return GOOD + "\n" + "".join(one.format(k) for k in range(count))

    assert_linear(lambda count: lambda: parse_protocol(more(count)), 900)
    assert "transitions: expected at most 1,000 entries, found 7004" in refused(more(7000))


def test_more_trials_than_anybody_could_answer_are_refused() -> None:
    assert "expected at most 100,000 trials in 'jnd', found" in refused(
        GOOD.replace('name = "jnd"', 'name = "jnd"\nrepeats = 1000', 1).replace(
            "[-15, -10, -5, 0, 5, 10, 20]", str(list(range(-14, 600))), 1
        )
    )


@pytest.mark.parametrize("words", ["x", "1", "1.", "x ", "five ", "1 ", "{minutes}", "秒", "x\\n", " "])
def test_texts_are_read_in_a_time_by_their_length(words: str) -> None:
    def read(count: int) -> Callable[[], object]:
        protocol = instructed(words * (count // len(words)))
        assert to_do(protocol) is not None
        assert all_texts(protocol)
        return lambda: (to_do(protocol), all_texts(protocol))

    assert_linear(read, 19_000)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("Answer within ten seconds.", "speaks of ten seconds"),
        ("Answer within 7.5 seconds.", "speaks of 7.5 seconds"),
        ("Antwort in zehn Sekunden.", "speaks of zehn seconds"),
        ("回答は10秒以内です。", "speaks of 10 seconds"),
        ("In 20seconds", "speaks of 20 seconds"),
    ],
)
def test_seconds_are_still_found_wherever_they_stand(words: str, said: str) -> None:
    # No blank stands before or behind the number in Japanese.
    assert any(said in note for note in to_do(instructed(words)))


def test_a_mistake_behind_a_line_of_blanks_has_its_line() -> None:
    text = f'source = """\n[{" " * 9000}\n"""\nwrong = 1\n' + re.sub(r"^source = .*$", "", GOOD, flags=re.MULTILINE)
    assert "demo.toml:4: wrong: unknown key" in refused(text)


def test_a_file_without_end_is_not_read_to_its_end(tmp_path: Path) -> None:
    path = tmp_path / "long.toml"
    path.write_text(GOOD + "#" * 3_000_000)
    with pytest.raises(ProtocolError, match="at most 1,000,000 letters"):
        load_protocol(path)
