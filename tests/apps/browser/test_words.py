"""No word of Segue's own reaches a participant in the browser where the protocol has its own."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import pytest
from devtools import Tab
from greek import GREEK, latin
from serving import Site

from study.experiment.protocol.whole import parse_protocol

pytestmark = pytest.mark.gl

# All that can be seen or heard: texts, names of buttons and pictures for screen readers, the title of the tab.
WORDS = """(() => {
  const kinds = ['aria-label', 'title', 'placeholder', 'alt'];
  const named = [...document.querySelectorAll(kinds.map((kind) => `[${kind}]`).join(','))];
  const names = named.flatMap((one) => kinds.map((kind) => one.getAttribute(kind) ?? ''));
  return [document.title, document.body.innerText, ...names].join('\\n');
})()"""


@pytest.fixture
def greek(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> Any:
    return make_site(GREEK), make_tab(), parse_protocol(GREEK).texts


def foreign(text: str) -> set[str]:
    """Latin words on a page; codes of sixteen letters and digits are nobody's words."""
    return set(latin(re.sub(r"\b[a-z0-9]{4}(?:-[a-z0-9]{4}){3}\b", "", text)))


def go_through(tab: Any, texts: Any, seen: Any, at_most: int = 300) -> None:
    """To the end, by whatever the first button is; the form is filled in wrongly first."""
    end = time.monotonic() + at_most
    wrong = True
    while texts.finished not in tab.text():
        assert time.monotonic() < end, tab.text()
        seen |= foreign(tab.run(WORDS))
        if tab.run("document.getElementById('field-age') !== null"):
            age = "7" if wrong else "77"
            tab.run(
                f"document.getElementById('field-age').value = '{age}'; document.querySelector('form button').click()"
            )
            if wrong:
                tab.wait_text(texts.not_taken)
                seen |= foreign(tab.run(WORDS))
            wrong = False
        tab.run("document.querySelector('main button:not(:disabled)')?.click()")
        time.sleep(0.02)
    seen |= foreign(tab.run(WORDS))


def test_every_page_of_a_session_is_in_the_protocol_s_words(greek: Any) -> None:
    site, tab, texts = greek
    seen: set[str] = set()
    tab.open(site.address)
    go_through(tab, texts, seen)
    assert seen == set()
    assert tab.run("document.documentElement.lang") == "el"
    tab.open(site.address + "/withdraw")
    tab.wait_text(texts.withdraw)
    tab.run("document.getElementById('code').value = 'x'; document.querySelector('form button').click()")
    tab.wait_text(texts.no_code)
    assert foreign(tab.run(WORDS)) == set()


def test_what_goes_wrong_is_said_in_the_protocol_s_words(greek: Any, make_tab: Callable[..., Tab]) -> None:
    """A film that fails, a server that is away, a second tab."""
    site, tab, texts = greek
    seen: set[str] = set()
    tab.open(site.address)
    tab.wait_text(parse_protocol(GREEK).consent.agree)
    other = make_tab(tab.context)
    other.open(site.address)
    other.wait_text(texts.elsewhere)
    seen |= foreign(other.run(WORDS))
    site.film_fault = "truncated"
    end = time.monotonic() + 60
    while texts.film_fault not in tab.text():
        assert time.monotonic() < end, tab.text()
        tab.run("{ const age = document.getElementById('field-age'); if (age) age.value = '77'; }")
        tab.run("document.querySelector('main button:not(:disabled)')?.click()")
        time.sleep(0.05)
    seen |= foreign(tab.run(WORDS))
    site.film_fault = None
    site.stop()
    tab.click(texts.pass_over)
    tab.wait_text(texts.waiting)
    seen |= foreign(tab.run(WORDS))
    site.start()
    assert seen == set()
