"""Protocols: what is read, and what is refused, with its place and what to do."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import pytest

from study.errors import ProtocolError
from study.experiment.protocol.whole import Protocol, find_protocol, load_protocol, parse_protocol, protocols_folder
from study.tasks.registry import task_of

GOOD = Path(__file__).parents[3].joinpath("protocols", "demo.toml").read_text()


def refused(old: str, new: str, base: str = GOOD) -> str:
    assert old in base, f"the text to change, {old!r}, is not in the protocol"
    with pytest.raises(ProtocolError) as caught:
        parse_protocol(base.replace(old, new, 1), Path("demo.toml"))
    return str(caught.value)


def test_the_exact_text_and_its_hash_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(GOOD.encode() + b"# a comment with \xc3\xa4\r\n")
    protocol = load_protocol(path)
    assert protocol.text.encode() == path.read_bytes()
    assert protocol.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert protocol.path == path


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('task = "preference"', 'task = "preferance"', r"studies\[1\].task: expected .* did you mean 'preference'\?"),
        ('category = "walking"', 'categroy = "walking"', r"transitions\[0\].categroy: unknown key; did you mean 'cat"),
        ("seed = 7", "sed = 7", r"sed: unknown key; did you mean 'seed'\?"),
        ("fps = 30", 'fps = 30\nlanguage = 3\nform = [{ name = "age" }]', r"language: expected text in quotes"),
        ("fps = 30", 'fps = 30\nlanguage = "english"', r"language: expected a language such as en, de or pt-BR, found"),
        ("[points]", '[keys]\nsame = "ss"\n[points]', r"keys.same: expected one small letter or digit, found 'ss'"),
        ("[points]", "[points]\nsource_within = [0.1]", r"points.source_within: expected more than 1 entry; add one"),
        (
            "[points]",
            "[points]\nsource_within = [0.1, 0.2, 1]",
            r"points.source_within: expected at most 2 entries, fou",
        ),
    ],
)
def test_one_bad_key_is_the_only_thing_that_is_said(old: str, new: str, said: str) -> None:
    found = refused(old, new)
    assert len(found.splitlines()) == 1, found
    assert re.search(said, found), found


def test_a_mistake_in_the_only_study_does_not_make_it_missing() -> None:
    head, _, _ = GOOD.partition("[[studies]]")
    one = head + '[[studies]]\nname = "x"\ntask = "preferance"\n'
    with pytest.raises(ProtocolError) as caught:
        parse_protocol(one)
    assert str(caught.value).count("\n") == 0
    assert "did you mean 'preference'?" in str(caught.value)
    with pytest.raises(ProtocolError, match="studies: expected at least 1 entry, found 0"):
        parse_protocol("studies = []\n" + head)


def test_a_camera_pans_by_default_and_a_smoothing_window_alone_says_that_it_tracks() -> None:
    """As protocols did that were written before there was a `camera`."""
    plain, old, new = (
        parse_protocol(GOOD.replace("[stimuli]", f"[stimuli]\n{keys}")).stimuli
        for keys in ("", "track_s = 0.5", 'camera = "track"')
    )
    assert (plain.camera, old.camera, new.camera) == ("pan", "track", "track")
    assert (old.smoothing_s, new.smoothing_s) == (0.5, 1.0)


def test_nothing_can_be_changed_afterwards() -> None:
    protocol = parse_protocol(GOOD)
    with pytest.raises(Exception, match="frozen"):
        protocol.seed = 3


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("answer_s = 5.0", "answer = 5.0", r"demo.toml:\d+: timing.answer: unknown key; did you mean 'answer_s'\?"),
        ('task = "preference"', 'taks = "preference"', r"studies\[1\].taks: unknown key; did you mean 'task'\?"),
        ("[points]\n", "[points]\nfixed_frames = 3\n", r"points.fixed_frames: unknown key; it belongs at studies"),
        ("fps = 30", "frobnication = 30", "frobnication: unknown key; valid keys here: name, title"),
        ("fps = 30", 'fps = "30"', r"fps: expected a number in frames per second, found '30' \(text\)"),
        ("seed = 7", "seed = 7.5", r"seed: expected a whole number, found 7.5"),
        ("seed = 7", "seed = true", r"seed: expected a whole number, found True \(true or false\)"),
        ("gap_s = 0.5", "gap_s = -1", r"timing.gap_s: expected at least 0 in seconds, found -1"),
        ("answer_s = 5.0", "answer_s = 0", r"timing.answer_s: expected above 0 in seconds, found 0"),
        ("width = 640", "width = 641", r"stimuli.width: expected a multiple of 2 in pixels, found 641"),
        ("width = 640", 'camera = "pan"\ntrack_s = 1.0', r"stimuli.*camera = .track. with track_s, found .pan."),
        ("width = 640", 'width = 640\ncamera = "follow"', r"stimuli.camera: expected .*'track', found 'follow'"),
        ('task = "preference"', 'task = "preferance"', r"studies\[1\].task: .*found 'preferance'; did you mean 'pref"),
        ('name = "demo"', 'name = "The demo"', r"name: expected a name of small letters, digits, - and _, found 'The"),
        ('title = "A small study of blend lengths"', 'title = ""', r"title: expected some text, found ''"),
        ('title = "A small study of blend lengths"', "", r"demo.toml: title: expected this key, found none; add it. H"),
        ('task = "same-different"', 'task = "abx"', r"'abx'; choose one. What .* 'preference', which of two "),
        ("seed = 7", 'seed = 7\nform = ["age"]', r'form\[0\]: .*, found .*; write { name = "age" }\.'),
        ('name = "boxing"', 'name = "walking"', r"demo.toml:\d+: transitions\[3\].name: .*'walking' twice"),
        ('name = "geodesic_vs_fixed"', 'name = "jnd"', r"studies\[1\].name: .*'jnd' twice"),
        ('["walk_run", ', '["walk_ran", ', r"studies\[1\].transitions: .*found 'walk_ran'; did you mean 'walk_run'\?"),
        ('["walk_run", ', '["stand_walk", ', r"studies\[1\].transitions: expected each transition once"),
        ("[-15, -10, -5, 0, 5, 10, 20]", "[0, 5, 5]", r"differences_frames: expected each difference once, found 5"),
        ("[-15, -10, -5, 0, 5, 10, 20]", "[0.5]", r"differences_frames\[0\]: expected a whole number in frames"),
        ("[-15, -10, -5, 0, 5, 10, 20]", "[]", r"studies\[0\]: expected differences_frames"),
        ("[-15, -10, -5, 0, 5, 10, 20]", "5", r"differences_frames: expected a list in brackets"),
        ('comparison = "fixed"', 'comparison = "geodesic"', r"studies\[1\].comparison: expected a comparison other"),
        ("shortest_frames = 5", "shortest_frames = 50", r"shortest_frames <= longest_frames, found 50 and 35"),
        ("longest_frames = 35", "longest_frames = 12", r"a level below one frame .*longest_frames of 16 or more"),
        ('choose = "random"', 'choose = "given"', r"expected one of source_s and source_frame .*found neither"),
        ("avoid_frames = 10,", "source_within = [0.9, 0.1],", r"source_within: expected \[from, to\] with from < to"),
        ('order = "random"\nq', 'items = []\norder = "both"\nsource = 1\nq', r"studies\[1\].source: unknown key; it"),
        ('order = "both"', 'order = "both"\npractice = 15', r"practice: expected no more than the 14 trials of 'jnd'"),
        ('order = "both"', 'order = "both"\nattention_checks = 20', r"attention_checks: expected no more than the 14"),
        ('order = "both"', 'order = "both"\npractice_transitions = ["boxing"]', r"expected practice of one trial"),
        ('order = "both"', 'practice = 1\npractice_transitions = ["walking"]', r"do not show, found 'walking'; name"),
        ('order = "both"', 'practice = 1\npractice_transitions = ["boksing"]', r"did you mean 'boxing'\?"),
        (
            'order = "both"',
            'practice = 1\npractice_transitions = ["boxing"]\nexample_transition = "boxing"',
            r"with another one to practise with, and example = true, found 'boxing'",
        ),
        ("[stimuli]", "[analysis]\nequivalence_points = 50\n[stimuli]", r"equivalence_points: expected below 50 in po"),
        ("[stimuli]", '[analysis]\nconfirmatory = ["jnd"]\n[stimuli]', r"confirmatory: expected names of preference"),
        ("[stimuli]", '[analysis]\nconfirmatory = ["velocity"]\n[stimuli]', r"mean 'velocity_vs_fixed'\?"),
        ("[stimuli]", "[analysis.exclusions]\nmost_failed_checks = 0.5\n[stimuli]", r"most_failed_checks: expected"),
        ("[stimuli]", "[analysis.exclusions]\nfastest_s = 5.0\n[stimuli]", r"fastest_s: expected less than timing.an"),
        ("fps = 30", "fps = 30\nparticipants = 0", r"participants: expected at least 1, found 0"),
        ("[stimuli]", '[stimuli.colours]\nleft = "red"\n[stimuli]', r"colours.left: expected a colour such as #20305a"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_place(old: str, new: str, message: str) -> None:
    text = refused(old, new)
    assert re.search(message, text), text


def test_a_slip_in_toml_names_its_line() -> None:
    assert "line 8" in refused("seed = 7", "seed = = 7")


def test_all_problems_are_named_at_once() -> None:
    text = refused("answer_s = 5.0", "answer = 5.0", GOOD.replace("seed = 7", 'seed = "x"'))
    assert len(text.splitlines()) == 2
    assert "timing.answer" in text
    assert "seed: expected a whole number" in text


def test_what_is_wrong_in_several_studies_is_told_at_once() -> None:
    text = re.sub(r"^task = ", 'practice_transitions = ["nowhere"]\ntask = ', GOOD, flags=re.MULTILINE)
    with pytest.raises(ProtocolError) as refusal:
        parse_protocol(text)
    studies = re.findall(r"studies\[(\d)\]\.practice_transitions: expected names of transitions", str(refusal.value))
    assert studies == [str(index) for index in range(GOOD.count("[[studies]]"))]


def test_the_line_is_the_line_of_the_key() -> None:
    text = refused('task = "preference"', 'task = "preferance"')
    line = int(text.split(":")[1])
    assert GOOD.splitlines()[line - 1] == 'task = "preference"'


def test_rating_studies_have_items_and_single_stimuli(rating_protocol: Protocol) -> None:
    study = rating_protocol.study("rating")
    assert [item.name for item in study.items] == ["natural", "noticeable"]
    base = rating_protocol.text
    assert "items: expected each item's name once" in refused('name = "noticeable"', 'name = "natural"', base)
    assert "shown singly" in refused('order = "by-group"', 'order = "both"', base)


def test_ratings_of_pairs_compare_two_methods_in_any_order(
    pair_rating_protocol: Protocol, rating_protocol: Protocol
) -> None:
    study, single = pair_rating_protocol.study("compared"), rating_protocol.study("rating")
    assert (task_of(study).slots, task_of(single).slots) == (2, 1)
    base = pair_rating_protocol.text
    for order, trials in (("both", 4), ("random", 2), ("balanced", 2), ("by-group", 2)):
        other = parse_protocol(base.replace('order = "by-group"', f'order = "{order}"'))
        assert other.trials_of(other.study("compared")) == trials
    assert "expected a comparison other than 'geodesic'" in refused('comparison = "cut"\n', "", base)
    assert "expected 'single' or 'pair'" in refused('show = "pair"', 'show = "pairs"', base)
    assert "an odd number of scale_points" in refused('show = "pair"', 'show = "pair"\nscale_points = 4', base)
    said = refused('question = "Which is more natural?"', 'question = "Which?"\nshow = "pair"', base)
    assert "expected show in rating studies only; remove it from the preference study 'liking'" in said


def test_a_session_may_hold_the_four_studies_of_2004() -> None:
    """Section 4.1: all in a single session; 42 + 8 + 8 + 8 pairs (here with the methods that there are)."""
    text = GOOD.split("[[transitions]]")[0]
    for number in range(11):
        text += f'[[transitions]]\nname = "t{number}"\ncategory = "c"\nsource = "walk"\ndestination = "run"\n'
    three, eight = (str([f"t{n}" for n in names]) for names in (range(3), range(3, 11)))
    text += (
        f'[[studies]]\nname = "one"\ntask = "same-different"\ntransitions = {three}\norder = "both"\n'
        "differences_frames = [-15, -10, -5, 0, 5, 10, 20]\n"
    )
    for name, a, b in (("two", "geodesic", "fixed"), ("three", "velocity", "fixed"), ("four", "geodesic", "velocity")):
        text += (
            f'[[studies]]\nname = "{name}"\ntask = "preference"\ntransitions = {eight}\nreference = "{a}"\n'
            f'comparison = "{b}"\npoints = {{ avoid_frames = 10, avoid_within_frames = 4 }}\n'
        )
    protocol = parse_protocol(text)
    assert [len(protocol.transitions_of(study)) for study in protocol.studies] == [3, 8, 8, 8]


def test_nearer_conditions_win() -> None:
    text = GOOD.replace(
        'order = "random"\n', 'order = "random"\npoints = { longest_frames = 20, avoid_within_frames = 2 }\n', 1
    )
    protocol = parse_protocol(text)
    study = protocol.study("geodesic_vs_fixed")
    points = protocol.points_for(study, protocol.transition("stand_walk"))
    assert (points.choose, points.shortest_frames, points.longest_frames) == ("random", 5, 20)
    assert points.avoid_within_frames == 4
    assert protocol.points_for(protocol.study("jnd"), protocol.transition("walking")).longest_frames == 35


def test_protocols_are_found_by_name_and_by_path(tmp_path: Path) -> None:
    assert find_protocol("demo") == protocols_folder() / "demo.toml"
    assert find_protocol("demo.toml") == protocols_folder() / "demo.toml"
    own = tmp_path / "own.toml"
    own.write_text(GOOD)
    assert find_protocol(own) == own
    with pytest.raises(ProtocolError, match="found 'blend_jnd'; did you mean 'blend_length_jnd'"):
        find_protocol("blend_jnd")
    with pytest.raises(ProtocolError, match="Expected a protocol file"):
        find_protocol(tmp_path / "demo.toml")


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match="expected a protocol file, found none"):
        load_protocol(tmp_path / "none.toml")
    bad = tmp_path / "bad.toml"
    bad.write_bytes(b"name = '\xff\xfe'")
    with pytest.raises(
        ProtocolError, match=r"bad\.toml:1: expected a protocol file in UTF-8, found a letter in another"
    ):
        load_protocol(bad)


def test_every_key_is_described_and_stands_in_the_documentation(repository: Path) -> None:
    from study.experiment.protocol.keys import key_tables

    document = (repository / "docs" / "protocol_keys.md").read_text()
    assert key_tables() in document, "run `python -m study.experiment.protocol.keys` and paste its tables"


def test_an_installed_package_carries_its_protocols(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wheel has them in `study/protocols`; the repository beside `study`."""
    import study

    package = tmp_path / "study"
    package.mkdir()
    monkeypatch.setattr(study, "__file__", str(package / "__init__.py"))
    with pytest.raises(ProtocolError, match="Expected the protocols that come with Segue in"):
        protocols_folder()
    (package / "protocols").mkdir()
    (package / "protocols" / "demo.toml").write_text(GOOD)
    assert find_protocol("demo") == package / "protocols" / "demo.toml"
