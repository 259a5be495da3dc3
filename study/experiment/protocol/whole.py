"""Protocol: a study as one TOML file, checked key by key.

A TOML file comes in; a frozen `Protocol` goes out, with the exact text and its SHA-256, so that every record can
say under which protocol it was made. A protocol names motions, never files: a library supplies them. The keys
cover the four studies of 2004 (section 4, one session) and the rating study of 2003 (section 4.2).

The meaning of a key is its `description`; `docs/protocol_keys.md` is written from these (`keys`).
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, Self

from pydantic import PrivateAttr, ValidationError, model_validator

from study.counting import counted
from study.errors import FileError, ProtocolError
from study.experiment.protocol.checks import check_whole
from study.experiment.protocol.content import Content
from study.experiment.protocol.errors import explain, full_location, key_lines, line_of, respelled, telling
from study.experiment.protocol.languages import with_words
from study.experiment.protocol.published import find_protocol, protocols_folder
from study.experiment.protocol.studies import StudySpec
from study.files import read_text
from study.toml_text import LARGEST_TEXT, parse_toml

__all__ = ["Protocol", "StudySpec", "find_protocol", "load_protocol", "parse_protocol", "protocols_folder"]

MOST_PROBLEMS = 50
"""So many are told at once."""


class Protocol(Content):
    """A whole session, as its file states it."""

    _text: str = PrivateAttr(default="")
    _path: Path | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_whole(self)
        return self

    @property
    def text(self) -> str:
        """The file's exact text."""
        return self._text

    @property
    def sha256(self) -> str:
        """SHA-256 of the text in UTF-8, hexadecimal."""
        return hashlib.sha256(self._text.encode()).hexdigest()

    @property
    def path(self) -> Path | None:
        """The file, where there is one."""
        return self._path

    def files_read(self) -> tuple[Path, ...]:
        """The files that the protocol's own methods read, from the folder of the protocol's own file."""
        from study.motion.readers.gltf_file import file_of

        return tuple(file_of(self.path_of(file)) for own in self.methods for file in own.method({}).make.files_read())

    def path_of(self, file: str) -> Path:
        """A file that the protocol names, from the folder of the protocol's own file."""
        return (self._path.parent if self._path else Path()) / file


def load_protocol(path: str | Path) -> Protocol:
    """Read and check a protocol.

    Raises
    ------
    ProtocolError
        For a file that can't be read, TOML that doesn't parse (with its line), and every key that is unknown (with
        the nearest valid one), missing, of the wrong type or out of range (with its line and key path). All such
        problems are named at once, up to 50.
    """
    try:
        text = read_text(path, "a protocol file", LARGEST_TEXT + 1)
    except FileError as error:
        raise ProtocolError(str(error)) from error
    return parse_protocol(text, Path(path))


def parse_protocol(text: str, path: Path | None = None) -> Protocol:
    """Check a protocol's text; `path` is for messages."""
    where = str(path) if path else "protocol"
    try:
        data = parse_toml(text, where)
    except FileError as error:
        raise ProtocolError(str(error)) from error
    try:
        protocol = Protocol.model_validate(with_words(data))
    except ValidationError as error:
        raise _refusal(data, text, where, error) from None
    protocol._text, protocol._path = text, path
    return protocol


def _refusal(data: dict[str, Any], text: str, where: str, error: ValidationError) -> ProtocolError:
    """All that is wrong with a protocol, each in a sentence, and what can be said of the rest."""
    found, rest = list(telling(Protocol, error.errors())), None
    if (spelled := respelled(Protocol, data, found)) is not None:
        try:
            rest = Protocol.model_validate(with_words(spelled))
        except ValidationError as other:  # what a misspelled key hid
            found += telling(Protocol, other.errors())
    lines = dict(key_lines(text))
    sentences = []
    for detail in found[:MOST_PROBLEMS]:
        line = line_of(lines, full_location(detail))
        sentences.append(f"{where}{f':{line}' if line else ''}: {explain(Protocol, detail)}")
    if more := len(found[MOST_PROBLEMS:]):
        sentences.append(f"{where}: {counted(more, 'more problem')}; mend these first.")
    refusal = ProtocolError("\n".join(sentences))
    named = data.get("transitions", ())
    tables = [table for table in named if isinstance(table, dict)] if isinstance(named, list) else []
    motions = (table.get(end) for table in tables for end in ("source", "destination"))
    refusal.rest, refusal.motions = rest, tuple(dict.fromkeys(name for name in motions if isinstance(name, str)))
    return refusal
