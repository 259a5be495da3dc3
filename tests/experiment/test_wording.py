"""What participants read: built-in texts in every language, slots, the form by name, what is still to be written."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from toys import FakeStimuli

from study.errors import ProtocolError
from study.experiment.plan import draw_plan
from study.experiment.protocol.languages import has_words, languages, words
from study.experiment.protocol.proofreading import to_do
from study.experiment.protocol.texts import Consent, Texts
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import current, open_session
from study.experiment.wording import FilmTimes, all_texts, duration_s, instructions_text, minutes, welcome_text

LANGUAGES = languages()
FORM = 'form = [{ name = "age", required = true }, { name = "gender" }, { name = "vision" }, { name = "animation" }]\n'
STANDARD = {
    'welcome = "Welcome."': 'welcome = "{standard}"',
    'debrief = "Thank you."': 'debrief = "{standard}"',
    'instructions = "Some pairs are the same."': 'instructions = "{standard}"',
    'instructions = ""': 'instructions = "{standard}"',
}


def changed(
    protocol: Protocol, *, top: str = "", consent: str = 'text = "{standard}"\ncontact = "Ann, ann@example.org"'
) -> Any:
    """A toy protocol with built-in texts."""
    text = protocol.text
    for old, new in STANDARD.items():
        assert old in text
        text = text.replace(old, new)
    return parse_protocol(top + FORM + text + f"\n[consent]\n{consent}\n")


def first_plan(protocol: Protocol, toy_stimuli: Any) -> Any:
    return draw_plan(protocol, toy_stimuli.pairs, "p01")


def slots(text: str) -> set[Any]:
    return set(re.findall(r"\{(\w*)\}", text))


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_language_has_every_word_with_the_same_slots(language: str) -> None:
    """English defaults are the measure: no word may be missing, none may stand there that nobody reads."""
    own, english = words(language), words("en")
    assert set(own["standard"]) == set(english["standard"])
    for name, text in own["standard"].items():
        assert slots(text) == slots(english["standard"][name]), name
    assert set(own["form"]) == set(english["form"])
    for name, question in own["form"].items():
        assert question.keys() == english["form"][name].keys()
        assert len(question.get("choices", ())) == len(english["form"][name].get("choices", ()))
    if language == "en":
        return
    for part, model in (("consent", Consent), ("texts", Texts)):
        wanted = {key: field.default for key, field in model.model_fields.items() if field.default}
        assert set(own[part]) == set(wanted)
        for key, text in wanted.items():
            assert slots(own[part][key]) == slots(text), key
            assert own[part][key] != text, key


def test_german_french_and_japanese_are_there() -> None:
    assert set(LANGUAGES) == {"en", "de", "fr", "ja"}
    assert has_words("de-AT")
    assert not has_words("pt-BR")


@pytest.mark.parametrize("language", [name for name in LANGUAGES if name != "en"])
def test_a_protocol_in_another_language_shows_no_built_in_english(
    language: str, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    top = f'language = "{language}"\n'
    protocol = changed(toy_protocol, top=top)
    plan = first_plan(protocol, toy_stimuli)
    english = changed(toy_protocol)
    known = {read.text for read in all_texts(english)} - {read.text for read in all_texts(toy_protocol)}
    read = {read.text for read in all_texts(protocol)}
    assert not known & read
    step = current(open_session(protocol, plan))
    assert step.kind == "consent"
    assert "Ann, ann@example.org" in step.text
    assert not slots(step.text)


def test_slots_are_the_numbers_of_the_study(toy_protocol: Protocol) -> None:
    protocol = changed(toy_protocol)
    read = {each.where: each.text for each in all_texts(protocol)}
    assert "You will see 8 pairs" in read["texts.welcome"]
    assert "There are 2 parts." in read["texts.welcome"]
    assert "you have 5\nseconds" in read["jnd: instructions"]
    assert f"about {minutes(duration_s(protocol))} minutes" in read["consent.text"].replace("\n", " ")
    assert "| female | male |" in read["form: gender"]


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_study_without_instructions_has_the_built_in_ones(
    language: str, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    text = f'language = "{language}"\n' + toy_protocol.text.replace('instructions = ""\n', "")
    protocol = parse_protocol(text)
    shown = instructions_text(protocol, protocol.study("liking"))
    begins = words(language)["standard"]["preference"].strip().partition("{")[0]
    assert shown.startswith(begins)
    assert len(shown) > 100 or language == "ja"
    steps = open_session(protocol, first_plan(protocol, toy_stimuli)).steps
    assert shown in [step.text for step in steps if step.kind == "instructions"]


@pytest.mark.parametrize(
    ("language", "one", "several"),
    [
        ("en", "you have 1 second to say", "you have 2 seconds to say"),
        ("de", "haben Sie 1 Sekunde, um", "haben Sie 2 Sekunden, um"),
        ("fr", "vous avez 1 seconde pour", "vous avez 2 secondes pour"),
        ("ja", "1秒以内", "2秒以内"),
    ],
)
def test_words_go_with_their_numbers(language: str, one: str, several: str, toy_protocol: Protocol) -> None:
    for seconds, said in ((1, one), (2, several)):
        text = toy_protocol.text.replace('instructions = ""', "").replace(
            "[texts]", f"[timing]\nanswer_s = {seconds}.0\n[texts]"
        )
        protocol = parse_protocol(f'language = "{language}"\n{text}')
        assert said in instructions_text(protocol, protocol.study("liking"))


def test_a_protocols_own_texts_can_have_both_words(toy_protocol: Protocol) -> None:
    text = toy_protocol.text.replace('"Welcome."', '"{trials} {trials:task|tasks}, {studies} {studies:part|parts}"')
    assert welcome_text(parse_protocol(text)) == "8 tasks, 2 parts"
    with pytest.raises(ProtocolError, match=r"found {trial}; did you mean {trials}\?"):
        parse_protocol(text.replace("{trials:task", "{trial:task"))


def test_an_empty_contact_leaves_no_hole(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> None:
    protocol = changed(toy_protocol, consent='text = "{standard}"')
    text = current(open_session(protocol, first_plan(protocol, toy_stimuli))).text
    assert "\n\n\n" not in text
    assert "{" not in text


def test_the_protocols_own_words_stand_beside_the_built_in_ones(
    toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    consent = 'text = "{standard}\\n\\nApproved as 12/34."\nagree = "Yes"'
    protocol = changed(toy_protocol, top='language = "de"\n', consent=consent)
    text = current(open_session(protocol, first_plan(protocol, toy_stimuli))).text
    assert text.startswith("Wir laden Sie ein")
    assert text.endswith("Approved as 12/34.")
    assert (protocol.consent.agree, protocol.consent.decline) == ("Yes", "Ich nehme nicht teil")


def test_questions_of_the_form_go_by_name_and_can_be_changed(toy_protocol: Protocol) -> None:
    protocol = changed(toy_protocol)
    age, gender, vision, animation = protocol.form
    assert (age.kind, age.least, age.required, gender.required) == ("number", 18, True, False)
    assert all(field.choices for field in (gender, vision, animation))
    younger = parse_protocol('form = [{ name = "age", least = 16 }]\n' + toy_protocol.text)
    assert younger.form[0].least == 16
    own = parse_protocol('form = [{ name = "age", label = "Alter" }]\n' + toy_protocol.text)
    assert (own.form[0].kind, own.form[0].least) == ("text", None)
    with pytest.raises(ProtocolError, match=r"form\[0\].label: expected this key, found none"):
        parse_protocol('form = [{ name = "height" }]\n' + toy_protocol.text)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('welcome = "Welcome."', 'welcome = "About {minute} minutes."', r"found {minute}; did you mean {minutes}\?"),
        ('welcome = "Welcome."', 'progress = "{done} done"', r"texts.progress: expected {total} in it"),
        ('welcome = "Welcome."', 'press = "{key} {taste}"', r"texts.press: expected {key} in braces, found {taste}"),
    ],
)
def test_strange_slots_are_refused(toy_protocol: Protocol, old: str, new: str, why: str) -> None:
    with pytest.raises(ProtocolError, match=why):
        parse_protocol(toy_protocol.text.replace(old, new))


@pytest.mark.parametrize("text", ["language = 3\n", 'language = "de"\ntexts = 3\n', 'form = [3]\nconsent = "x"\n'])
def test_malformed_parts_are_refused_and_not_filled(toy_protocol: Protocol, text: str) -> None:
    with pytest.raises(ProtocolError):
        parse_protocol(text + toy_protocol.text)


def test_what_is_still_to_be_written_is_said(toy_protocol: Protocol) -> None:
    assert to_do(changed(toy_protocol)) == []
    consent, instructions = to_do(toy_protocol)
    assert consent.startswith("consent.text is empty")
    assert instructions.startswith("studies.liking.instructions is empty: participants see films and are not told")
    bare = parse_protocol(toy_protocol.text.replace('welcome = "Welcome."\ndebrief = "Thank you."', ""))
    assert [note.split(":")[0] for note in to_do(bare)][1:3] == ["texts.welcome is empty", "texts.debrief is empty"]
    (contact,) = to_do(changed(toy_protocol, consent='text = "{standard}"\ncontact = "FILL IN: who runs it"'))
    assert contact == "consent.contact says 'FILL IN: who runs it': write it before participants read it."
    (nobody,) = to_do(changed(toy_protocol, consent='text = "{standard}"'))
    assert nobody.startswith("consent.contact is empty")


def test_a_language_without_words_names_what_is_still_english(toy_protocol: Protocol) -> None:
    (left,) = to_do(changed(toy_protocol, top='language = "pt-BR"\n'))
    assert "texts.go_on" in left
    assert "consent.agree" in left
    assert "studies.jnd.instructions" in left
    own = "\n".join(f'{key} = "x"' for key in ("agree", "decline", "declined"))
    (fewer,) = to_do(changed(toy_protocol, top='language = "pt-BR"\n', consent=f'text = "x"\n{own}'))
    assert "consent.agree" not in fewer


@pytest.mark.parametrize(
    ("instructions", "said"),
    [
        ("You have five seconds.", False),
        ("You have eight seconds.", True),
        ("You have 5 seconds.", False),
        ("You have 7.5 seconds.", True),
        ("Sie haben acht Sekunden.", True),
        ("{answer_s} 秒, 9秒", True),
        ("Some seconds later.", False),
    ],
)
def test_instructions_that_speak_of_another_answer_window_are_noticed(
    toy_protocol: Protocol, instructions: str, said: bool
) -> None:
    text = toy_protocol.text.replace("Some pairs are the same.", instructions)
    notes = [note for note in to_do(parse_protocol(text)) if "seconds, but" in note]
    assert bool(notes) == said


def test_a_session_lasts_as_long_as_its_parts(toy_protocol: Protocol) -> None:
    """Eight pairs of 0.3 + 0.3 + 1 s films, a gap of one second, two to answer, one of pause; then reading."""
    reading = sum(len(text) for text in ("Welcome.", "Thank you.", "Some pairs are the same.")) / 15
    assert duration_s(toy_protocol) == pytest.approx(8 * (2 * 1.6 + 1 + 2 + 1) + reading)
    assert duration_s(toy_protocol, at_most=True) == pytest.approx(16 * (2 * 1.6 + 1 + 5 + 1) + reading)
    assert [minutes(s) for s in (1, 60, 61, 599, 601, 960)] == [1, 1, 2, 10, 15, 20]


def test_known_films_count_as_long_as_they_are(toy_protocol: Protocol) -> None:
    """Six trials of the first study with 10 s of films and two of the second with 20, in place of 3.2 s each."""
    known = {"jnd": FilmTimes(10.0, 0.0), "liking": FilmTimes(20.0, 0.0)}
    apart = duration_s(toy_protocol, films=known) - duration_s(toy_protocol)
    assert apart == pytest.approx(6 * (10 - 3.2) + 2 * (20 - 3.2))


def test_rated_pairs_take_the_time_of_two_films_and_have_words_of_their_own(
    pair_rating_protocol: Protocol, rating_protocol: Protocol
) -> None:
    pairs, films = pair_rating_protocol.text, rating_protocol.text
    apart = duration_s(parse_protocol(pairs)) - duration_s(
        parse_protocol(pairs.replace('show = "pair"\n', ""))
    )  # two pairs of films with a gap, two items each, against four films with two items each
    assert apart == pytest.approx(2 * (2 * 1.6 + 1 + 12 + 1) - 4 * (1.6 + 12 + 1))
    asked = 'instructions = "{standard}"'
    before, after = pairs.split('show = "pair"')
    own = parse_protocol(before + 'show = "pair"' + after.replace('instructions = ""', asked))
    assert "how the second film was, compared with the first" in instructions_text(own, own.study("compared"))
    for text, said in ((pairs, "pairs of short films"), (films, "in some parts one at a time")):
        standard = parse_protocol(text.replace('welcome = "Welcome."', 'welcome = "{standard}"'))
        assert said in welcome_text(standard)


def test_the_number_of_trials_is_that_of_the_plan(
    toy_protocol: Protocol,
    rating_protocol: Protocol,
    pair_rating_protocol: Protocol,
    make_stimuli: Callable[[Protocol], FakeStimuli],
) -> None:
    more = toy_protocol.text.replace(
        'order = "both"', 'order = "both"\nrepeats = 2\npractice = 3\nattention_checks = 2'
    )
    for protocol in (toy_protocol, rating_protocol, pair_rating_protocol, parse_protocol(more)):
        plan = draw_plan(protocol, make_stimuli(protocol).pairs, "p01")
        for study in protocol.studies:
            shown = [trial for trial in plan.trials if trial.study == study.name and trial.role == "trial"]
            assert protocol.trials_of(study) == len(shown)


def test_the_language_files_are_toml_that_a_person_can_read(repository: Path) -> None:
    for path in (repository / "study" / "experiment" / "protocol" / "words").glob("*.toml"):
        text = path.read_text(encoding="utf-8")
        assert tomllib.loads(text) == words(path.stem)
        assert text.startswith("#")
