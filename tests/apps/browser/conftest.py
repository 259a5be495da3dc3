"""A study of tiny films, a server, and real browsers; where all parts are required, a missing one fails."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from bidi import Firefox, FirefoxTab, firefox
from devtools import Browser, Tab, chromium
from parts import unavailable
from serving import Site, prepared
from walking import PATIENT
from webdriver import WebKitTab, webkit

from study.experiment.stimuli.rendering import render

EXECUTABLES = ("chromium", "chromium-browser", "google-chrome")
# The same engine without what surrounds a page: a tab of it takes a seventh of the processor time.
SHELLS = ("chromium-headless-shell", "chrome-headless-shell")
MINI_BROWSERS = "/usr/lib/*/webkit2gtk-4.1/MiniBrowser", "/usr/lib/*/webkitgtk-6.0/MiniBrowser"


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Chromium, without its windows where such a one is installed."""
    with found_chromium((*SHELLS, *EXECUTABLES), tmp_path_factory.mktemp("profile")) as started:
        yield started


@pytest.fixture(scope="session")
def whole_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Chromium as people have it."""
    with found_chromium(EXECUTABLES, tmp_path_factory.mktemp("profile")) as started:
        yield started


def found_chromium(names: tuple[str, ...], profile: Path) -> AbstractContextManager[Browser]:
    executable = next((found for name in names if (found := shutil.which(name))), None)
    if executable is None:
        unavailable("Chromium", "on Debian, apt-get install chromium")
    return chromium(str(executable), profile)


@pytest.fixture(scope="session")
def gecko(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Firefox]:
    executable = shutil.which("firefox-esr")
    if executable is None:
        unavailable("Firefox", "on Debian, apt-get install firefox-esr libavcodec-extra", package="firefox-esr")
    with firefox(str(executable), tmp_path_factory.mktemp("profile")) as started:
        yield started


@pytest.fixture
def firefox_tab(gecko: Firefox) -> Iterator[FirefoxTab]:
    """A tab of Firefox; at the end no page may have thrown anything."""
    tab = gecko.tab()
    yield tab
    complaints = list(gecko.complaints)
    gecko.complaints.clear()
    tab.close()
    assert complaints == []


@pytest.fixture
def webkit_tab(virtual_display: str) -> Iterator[WebKitTab]:
    """WebKitGTK, where it is: so large a part is required nowhere."""
    driver = shutil.which("WebKitWebDriver")
    browsers = [found for pattern in MINI_BROWSERS for found in sorted(Path("/").glob(pattern[1:]))]
    if driver is None or not browsers:
        pytest.skip("WebKitGTK is missing: on Debian, apt-get install webkit2gtk-driver gstreamer1.0-libav")
    with webkit(driver, browsers[0], virtual_display) as tab:
        yield tab


@pytest.fixture(scope="session")
def films(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """`films(protocol)`: a results folder with its films, drawn once; sites get copies."""
    from renderer.errors import RendererError
    from study.errors import StimulusError

    @cache
    def drawn(text: str) -> Path:
        folder = tmp_path_factory.mktemp("films")
        try:
            render(prepared(text), folder, workers=1)
        except (RendererError, StimulusError) as error:
            unavailable("a context to draw films with", str(error))
        return folder

    return drawn


@pytest.fixture
def make_site(films: Callable[[str], Path], tmp_path: Path) -> Iterator[Callable[..., Site]]:
    """`make_site(protocol, **settings)`: a running server on a copy of a study."""
    sites: list[Site] = []

    def make(text: str = PATIENT, **settings: Any) -> Site:
        folder = tmp_path / f"site-{len(sites)}"
        shutil.copytree(films(text), folder)
        sites.append(Site(folder, text, **settings))
        return sites[-1]

    yield make
    for site in sites:
        site.film_fault = None
        site.stop()


@pytest.fixture
def make_tab(browser: Browser) -> Iterator[Callable[..., Tab]]:
    """`make_tab(person=None)`: a tab; at the end no page may have thrown anything."""
    tabs: list[Tab] = []

    def make(person: str | None = None) -> Tab:
        tabs.append(browser.tab(person))
        return tabs[-1]

    yield make
    complaints = [complaint for tab in tabs for complaint in tab.complaints()]
    for tab in tabs:
        tab.close()
    assert complaints == []
