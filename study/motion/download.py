"""Fetch trials of the CMU Graphics Lab database from its official site, into the site's own layout.

In: a trial such as `16_35`, or a motion of the index such as `run`. Out: `subjects/16/16_35.amc` and
`subjects/16/16.asf` below a folder. A file is written under another name until it is whole; what a broken connection
left is continued by the next download, and files that are there are not fetched again.
"""

from __future__ import annotations

import http.client
import urllib.error
import urllib.request
from contextlib import suppress
from pathlib import Path

from study.errors import MotionError
from study.files import whole_file
from study.motion.cmu import CMU_SITE, cmu_index, is_trial, trial_files

_CHUNK_BYTES = 1 << 16
_PARTIAL = 206
_RANGE_REFUSED = 416


def download_trial(trial: str, folder: Path | str, *, site: str = CMU_SITE, timeout_s: float = 30.0) -> Path:
    """Download one trial and its subject's skeleton.

    Parameters
    ----------
    trial
        Subject and number, as in `16_35`, or a name of the CMU index, whose first take is fetched.
    folder
        Where `subjects/` is or will be; the AMC file in it is returned.
    site, timeout_s
        Address of the site, and seconds without an answer after which the download is given up.

    Raises
    ------
    MotionError
        For an unknown trial, no connection, or an answer that is not motion capture; says what to do.
    """
    if trial in cmu_index():
        trial = cmu_index()[trial].takes[0].trial
    if not is_trial(trial):
        raise MotionError(
            f"Expected a trial such as 16_35 or a motion of the CMU index, found {trial!r}. "
            f"The index has {', '.join(cmu_index())}."
        )
    amc, asf = trial_files(trial)
    for file in (asf, amc):
        target = Path(folder) / file
        if not target.exists():
            _fetch(f"{site.rstrip('/')}/{file}", target, timeout_s)
    return Path(folder) / amc


def _fetch(address: str, target: Path, timeout_s: float) -> None:
    """Download one file whole or not at all, continuing what an earlier attempt left as `NAME.part`."""
    left = target.with_name(target.name + ".part")
    with whole_file(target) as unfinished:
        with suppress(FileNotFoundError):
            left.replace(unfinished)  # of two downloads at once, one has it
        try:
            _receive_or_say_why(address, target, unfinished, timeout_s)
        except (MotionError, KeyboardInterrupt):
            if unfinished.stat().st_size:
                unfinished.replace(left)
            raise
        _check_content(unfinished, address)


def _receive_or_say_why(address: str, target: Path, partial: Path, timeout_s: float) -> None:
    try:
        _receive(address, partial, timeout_s)
    except urllib.error.HTTPError as error:
        why = "the site has no such trial" if error.code == http.client.NOT_FOUND else "the site refused"
        raise MotionError(f"Expected {target.name} at {address}, but {why} ({error.code} {error.reason}).") from error
    except (urllib.error.URLError, TimeoutError, ConnectionError, http.client.HTTPException) as error:
        reason = getattr(error, "reason", error)
        raise MotionError(
            f"Could not download {address}: {reason}. Check the network and run it again (it "
            f"resumes where it stopped), or put the file at {target} yourself."
        ) from error


def _receive(address: str, partial: Path, timeout_s: float) -> None:
    """Append what is missing to a partial file; start over where the site can't continue."""
    have = partial.stat().st_size if partial.exists() else 0
    request = urllib.request.Request(address, headers={"Range": f"bytes={have}-"} if have else {})
    try:
        answer = urllib.request.urlopen(request, timeout=timeout_s)
    except urllib.error.HTTPError as error:
        if error.code != _RANGE_REFUSED:
            raise
        partial.write_bytes(b"")  # longer than the site's file: not the same file
        answer = urllib.request.urlopen(address, timeout=timeout_s)
    with answer, partial.open("ab" if answer.status == _PARTIAL else "wb") as out:
        while chunk := answer.read(_CHUNK_BYTES):
            out.write(chunk)
        out.flush()
        # Where the connection breaks, urllib ends the body early without a word; `length` is what never came.
        if answer.length:
            raise ConnectionError(f"the connection broke with {answer.length} bytes to go")


def _check_content(partial: Path, address: str) -> None:
    """Refuse an error page that came with status 200."""
    start = partial.read_bytes()[:512].lstrip()
    if not start or start[:1] not in (b"#", b":") or b"\0" in start:
        raise MotionError(
            f"Expected Acclaim motion capture at {address}, found {start[:40]!r}. "
            "Something between here and the site answers in its place; try from another network."
        )
