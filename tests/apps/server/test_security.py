"""The server among people who mean no good, and behind proxies: what it refuses, never says, survives."""

from __future__ import annotations

import asyncio
import csv
import io
import logging
from collections.abc import Callable
from typing import Any

import pytest
import sqlalchemy as sa
from serving import PROTOCOL, TOKEN, Serving, answer_to, make_host
from starlette.testclient import TestClient
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from study.apps.server import hosting
from study.apps.server.running import configuration
from study.apps.server.settings import Settings
from study.apps.server.web import make_app
from study.errors import SessionError
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.answers import stored_form
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import Responses
from study.experiment.store.tables import events


@pytest.fixture
def film(serve: Callable[..., Serving]) -> Any:
    """`film(**headers)`: the reply to a request for a film of the trial that is due."""
    person = serve().person()
    view = person.until(person.begin(), "trial")

    def get(method: str = "GET", **headers) -> Any:
        return person.client.request(method, view["films"][0]["url"], headers=headers)

    return get


# Films in parts, as Safari asks for them


@pytest.mark.parametrize(
    ("asked", "start", "stop"),
    [
        ("bytes=0-1", 0, 2),
        ("bytes=10-19", 10, 20),
        ("bytes=100-", 100, None),
        ("bytes=-100", -100, None),
        ("bytes=-9999999", 0, None),
        ("bytes=500-9999999", 500, None),
        ("Bytes = 0 - 1", 0, 2),
    ],
)
def test_one_range_of_a_film_is_sent_as_that_part(film: Any, asked: str, start: int, stop: int | None) -> None:
    whole = film().content
    part = film(range=asked)
    assert part.status_code == 206
    assert part.content == whole[start:stop]
    first = len(whole) - len(part.content) if stop is None else start
    assert part.headers["content-range"] == f"bytes {first}-{first + len(part.content) - 1}/{len(whole)}"
    assert part.headers["content-length"] == str(len(part.content))
    assert part.headers["accept-ranges"] == "bytes"


@pytest.mark.parametrize("asked", ["bytes=99999-", "bytes=99999-100000", "bytes=99999-99999"])
def test_a_range_beyond_the_end_of_a_film_is_refused(film: Any, asked: str) -> None:
    size = len(film().content)
    refused = film(range=asked)
    assert (refused.status_code, refused.headers["content-range"]) == (416, f"bytes */{size}")


@pytest.mark.parametrize(
    "asked",
    ["bytes=0-1,5-6", "bytes=5-2", "bytes=-", "bytes=", "bytes", "frames=0-1", "bytes=a-b", "bytes=1-" + "9" * 5000,
     "bytes=" + ",".join(f"{i}-{i}" for i in range(900)), "bytes=0x1-2", "bytes=--5"],
)  # fmt: skip
def test_other_ranges_are_passed_over(film: Any, asked: str) -> None:
    reply = film(range=asked)
    assert (reply.status_code, reply.content) == (200, film().content)
    assert "content-range" not in reply.headers


def test_a_range_of_an_older_film_is_not_sent(film: Any) -> None:
    tag = film().headers["etag"]
    assert film(**{"range": "bytes=0-1", "if-range": tag}).status_code == 206
    for other in ('"another"', f"W/{tag}", "Fri, 02 Jan 1970 00:00:00 GMT"):
        assert film(**{"range": "bytes=0-1", "if-range": other}).status_code == 200


def test_the_head_of_a_film(film: Any) -> None:
    head = film("HEAD")
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["content-length"] == str(len(film().content))
    assert head.headers["cache-control"] == "no-store"


def test_a_damaged_film_is_not_named(film: Any, stimuli: Manifest) -> None:
    files = list((stimuli.folder / "stimuli").glob("*.mp4"))
    contents = [file.read_bytes() for file in files]
    try:
        for file in files:
            file.write_bytes(b"x")
        refused = film()
    finally:
        for file, content in zip(files, contents, strict=True):
            file.write_bytes(content)
    assert refused.status_code == 422
    assert not [record.id for record in stimuli.records if record.id in refused.text]


@pytest.mark.parametrize("name", ["%C3%A9", "%00", "..%2f..%2fresponses.sqlite", "a" * 5000, "%0d%0aset-cookie:%20a=b"])
def test_odd_names_of_films_are_unknown(
    serve: Callable[..., Serving], name: str, caplog: pytest.LogCaptureFixture
) -> None:
    person = serve().person()
    person.until(person.begin(), "trial")
    reply = person.client.get(f"/films/{name}.mp4")
    assert reply.status_code == 404
    assert "\r\n" not in caplog.text


# Messages


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe{}",
        b'{"kind": "fault", "detail": {"what": "\xff"}}',
        b'{"kind": "fault", "detail": {"what": "\\ud800"}}',
        b'{"kind": "fault", "detail": {"what": "a\\u0000b"}}',
        b'{"kind": "fault", "detail": {"what": "\0"}}',
        b'{"kind": "fault", "detail": {"what": NaN}}',
        b'{"kind": "fault", "detail": {"what": 1e999}}' + b" " * 10,
        b'{"kind": "fault", "detail": {"what": ["a"]}}',
        b"[" * 100_000,
        b'{"detail":' * 50_000,
        b'{"kind": ' + b"9" * 100_000 + b"}",
        b'{"kind": "fault"} {"kind": "fault"}',
        b"null",
    ],
    ids=lambda content: repr(content[:45]),
)
def test_messages_that_are_none_are_refused_and_stored_nowhere(
    serve: Callable[..., Serving], responses: Responses, content: bytes
) -> None:
    person = serve().person()
    person.begin()
    headers = {"x-segue-page": person.page, "content-type": "application/json"}
    # Too long for what a page has to tell, or none at all.
    status = 413 if len(content) > 32_000 else 422
    assert person.client.post("/api/happened", content=content, headers=headers).status_code == status
    with responses.engine.connect() as connection:
        query = sa.select(sa.func.count()).where(events.c.kind == "fault")
        assert connection.execute(query).scalar_one() == 0


def test_what_looks_like_nul_in_a_text_is_text(serve: Callable[..., Serving], responses: Responses) -> None:
    person = serve().person()
    form = person.done(person.begin())
    remark = r"\u0000 and é, 日本語, 😀"
    assert person.done(form, values={"age": "20", "remark": remark})["kind"] == "instructions"
    assert stored_form(responses, 1)["remark"] == remark
    other = serve().person()
    form = other.done(other.begin())
    refused = other.post("/api/done", {"step": form["step"], "values": {"age": "20", "remark": "a\0b"}})
    assert (refused.status_code, "NUL" in refused.json()["error"]) == (422, True)


def test_what_cookies_and_headers_hold_is_never_trusted(serve: Callable[..., Serving]) -> None:
    serving = serve()
    person = serving.person()
    person.begin()
    token = person.client.cookies[serving.host.cookie]
    name = serving.host.cookie
    for header, status in (
        (f"{name}={token}", 200),
        (f"other=1; {name}={token}; last=2", 200),
        (f"{name}x={token}", 401),
        (f"{name}={token}x", 401),
        (f"x{name}={token}", 401),
        (f"{name}", 401),
        (";;=;=x; " * 300, 401),
        ("\xff\xfe=\xe9", 401),
        (f'{name}="{token}', 401),
    ):
        stranger = serving.person(person.page)
        reply = stranger.post("/api/alive", {}, cookie=header.encode("latin-1"))
        assert reply.status_code == status, header
    for page, status in (("page-one", 200), ("page-two", 409), ("short", 403), ("x" * 65, 403), ("x" * 20_000, 403)):
        assert person.post("/api/alive", {}, page=page).status_code == status
    for origin, status in (
        ("http://testserver", 200),
        ("http://testserver.example", 403),
        ("http://testserver@elsewhere.example", 403),
        ("null", 403),
        ("http://[", 403),
        ("", 403),
    ):
        assert person.post("/api/alive", {}, origin=origin).status_code == status, origin


def test_only_the_methods_that_there_are(serve: Callable[..., Serving]) -> None:
    client = serve().client
    for method in ("GET", "PUT", "DELETE", "OPTIONS", "PATCH", "HEAD"):
        assert client.request(method, "/api/answer").status_code == 405
    for path in ("/api/study", "/", "/researcher", "/pages/main.js"):
        assert client.post(path).status_code == 405
        assert client.head(path).status_code == 200


def test_the_host_header_leads_nowhere(serve: Callable[..., Serving]) -> None:
    client = serve().client
    for path in ("/researcher/", "/withdraw/", "/pages/", "/pages", "/films/", "/api/"):
        reply = client.get(path, headers={"host": "elsewhere.example"}, follow_redirects=False)
        assert reply.status_code == 404, path
        assert "elsewhere" not in reply.text + str(reply.headers)


@pytest.mark.parametrize(
    "path",
    ["/pages/%2e%2e", "/pages/%2e%2e/%2e%2e/cli.py", "/pages/..%5c..%5ccli.py", "/pages/main.js%00", "/pages//passwd",
     "/manifest.json", "/stimuli/", "/responses.sqlite", "/protocol.toml", "/.git/config"],
)  # fmt: skip
def test_no_folder_is_listed_and_no_file_outside_is_read(serve: Callable[..., Serving], path: str) -> None:
    assert serve().client.get(path).status_code == 404


def test_pages_are_kept_by_browsers_as_long_as_they_are_the_same(serve: Callable[..., Serving]) -> None:
    client = serve().client
    for path in ("/", "/pages/main.js"):
        page = client.get(path)
        again = client.get(path, headers={"if-none-match": page.headers["etag"]})
        assert (page.headers["cache-control"], again.status_code, again.content) == ("no-cache", 304, b"")
        assert client.get(path, headers={"if-none-match": '"older"'}).content == page.content


def test_replies_forbid_frames_sensors_and_caches(serve: Callable[..., Serving]) -> None:
    serving = serve()
    person = serving.person()
    replies = [person.post("/api/begin", {"page": "page-one"}), serving.client.get("/"), serving.client.get("/nothing")]
    replies += [serving.ask("overview"), serving.ask("answers.csv"), serving.ask("overview", "wrong")]
    for reply in replies:
        assert "frame-ancestors 'none'" in reply.headers["content-security-policy"]
        assert "default-src 'none'" in reply.headers["content-security-policy"]
        assert "camera=()" in reply.headers["permissions-policy"]
        assert reply.headers["cross-origin-resource-policy"] == "same-origin"
        assert reply.headers["cache-control"] in ("no-store", "no-cache")
        assert "access-control-allow-origin" not in reply.headers
        assert "server" not in reply.headers


# What goes wrong on our side


def test_an_answer_that_could_not_be_stored_is_not_acknowledged_and_can_be_sent_again(
    serve: Callable[..., Serving], responses: Responses, monkeypatch: pytest.MonkeyPatch
) -> None:
    serving = serve()
    person = serving.person()
    view = person.until(person.begin(), "trial")
    message = answer_to(view)

    def full(*_) -> None:
        raise OSError("No space left on device")

    with monkeypatch.context() as broken:
        broken.setattr("study.apps.server.writer.insert_rows", full)
        with pytest.raises(OSError, match="No space"):
            person.post("/api/answer", message)
    assert person.post("/api/answer", message).json()["counted"] is True
    assert len(answers_frame(responses, roles=("practice",))) == 1


def test_one_bad_write_takes_no_others_with_it(serve: Callable[..., Serving]) -> None:
    serving = serve()
    people = [serving.person() for _ in range(3)]
    views = [person.until(person.begin(), "trial") for person in people]
    host = serving.host

    async def together() -> Any:
        live = next(iter(host.live_sessions.values()))
        rows = [hosting.event_row(live.record, kind, None, hosting.datetime.now(hosting.UTC)) for kind in "abc"]
        bad = (rows[1][0], {**rows[1][1], "session_id": 999})
        return await asyncio.gather(
            *(host.writer.put([row]) for row in (rows[0], bad, rows[2])), return_exceptions=True
        )

    first, second, third = serving.client.portal.call(together)
    assert (first, third) == (None, None)
    assert isinstance(second, sa.exc.IntegrityError)
    for person, view in zip(people, views, strict=True):
        assert person.answer(view)["counted"] is True


def test_who_is_long_gone_is_taken_up_from_the_database(
    serve: Callable[..., Serving], monkeypatch: pytest.MonkeyPatch
) -> None:
    serving = serve()
    person = serving.person()
    view = person.until(person.begin(), "trial")
    view = person.until(person.answer(view), "trial")
    serving.client.portal.call(serving.host.note_who_is_here)
    assert len(serving.host.live_sessions) == 1
    monkeypatch.setattr("study.apps.server.live.GONE_SECONDS", -1.0)
    serving.client.portal.call(serving.host.note_who_is_here)
    assert serving.host.live_sessions == {}
    assert person.answer(view)["counted"] is True


# The researcher


def test_the_researchers_token_is_long_and_stands_in_no_log(
    serve: Callable[..., Serving], caplog: pytest.LogCaptureFixture
) -> None:
    for short in ("", "x" * 15):
        with pytest.raises(SessionError, match="Expected a researcher's token of 16 characters or more"):
            Settings(researcher_token=short)
    caplog.set_level(logging.DEBUG)
    serving = serve()
    assert serving.ask("overview").status_code == 200
    for wrong in (f"{TOKEN}x", "\xe9", ""):
        headers = {"authorization": f"Bearer {wrong}".encode("latin-1")}
        reply = serving.client.get("/api/researcher/overview", headers=headers)
        assert reply.status_code == 401
        assert TOKEN not in reply.text
    assert TOKEN not in caplog.text
    assert TOKEN not in "".join(serving.client.get(path).text for path in ("/", "/researcher", "/api/study"))


def test_a_name_that_begins_like_a_formula_is_text_in_every_table(serve: Callable[..., Serving]) -> None:
    serving = serve()
    person = serving.person()
    person.until(person.begin(parameters={"participant": "-2-3"}), "done")
    for table in serving.ask("overview").json()["tables"]:
        rows = list(csv.DictReader(io.StringIO(serving.ask(f"{table}.csv").text)))
        assert {row["participant"] for row in rows} == {"'-2-3"}, table
    numbers = csv.DictReader(io.StringIO(serving.ask("answers.csv").text))
    assert {row["difference_frames"] for row in numbers} >= {"-2", "0"}


# Behind a proxy


def test_under_a_path_pages_and_cookies_stay_there(serve: Callable[..., Serving]) -> None:
    serving = serve(root_path="/study")
    person = serving.person()
    reply = person.client.post("/study/api/begin", json={"page": "page-one"}, headers={"x-segue-page": "page-one"})
    assert "; Path=/study/;" in reply.headers["set-cookie"]
    page = serving.client.get("/study/").text
    assert 'src="pages/main.js"' in page
    assert 'href="/' not in page
    assert 'src="/' not in page
    assert serving.client.get("/study/pages/main.js").status_code == 200
    assert serving.client.get("/study/researcher").status_code == 200
    # The session itself: what a proxy takes off, uvicorn puts back.
    view = reply.json()
    headers = {"x-segue-page": "page-one"}
    while view["kind"] != "trial":
        values = {"age": "20"} if view["kind"] == "form" else {}
        message = {"step": view["step"], "values": values}
        view = person.client.post("/study/api/done", json=message, headers=headers).json()
    assert not view["films"][0]["url"].startswith("/")
    assert person.client.get(f"/study/{view['films'][0]['url']}").status_code == 200
    assert configuration(make_app, root_path="/study").root_path == "/study"


@pytest.mark.parametrize(("trusted", "secure"), [("testclient", True), ("10.0.0.1", False)])
def test_cookies_are_for_https_where_a_trusted_proxy_says_so(
    stimuli: Manifest, responses: Responses, trusted: str, secure: bool
) -> None:
    app = ProxyHeadersMiddleware(make_app(make_host(stimuli, responses)), trusted_hosts=trusted)
    with TestClient(app) as client:
        headers = {"x-segue-page": "page-one", "x-forwarded-proto": "https", "origin": "https://testserver"}
        reply = client.post("/api/begin", json={"page": "page-one"}, headers=headers)
    assert reply.status_code == 200
    assert ("; Secure" in reply.headers["set-cookie"]) is secure
    assert [configuration(app, behind_proxy=behind).proxy_headers for behind in (True, False)] == [True, False]


def test_two_studies_on_one_machine_have_cookies_of_their_own(stimuli: Manifest, responses: Responses) -> None:
    names = {make_host(stimuli, responses, PROTOCOL.replace("seed = 5", f"seed = {seed}")).cookie for seed in (5, 6)}
    assert len(names) == 2
