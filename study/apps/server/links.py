"""Links: who a link says that a participant is. The link's parameters come in; those that were filled in go out.

A recruiting service puts a participant's number in place of a slot such as `{{%PROLIFIC_PID%}}`. Where a slot was
mistyped, or a link is opened by hand, the slot itself arrives, the same for everybody: it must never pass for a person.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from urllib.parse import unquote

VISIT = "SESSION_ID"
"""The recruiting service's number of one visit, which nobody can guess: with it a person can change the browser."""

_SLOT = re.compile(
    r"""\{[^{}]*\} | \[\[.*\]\] | <<.*>> | <%.*%> | «.*» | \*\|.*\|\* | %[a-z_][\w .:-]*% | \ufffd""",
    re.VERBOSE | re.IGNORECASE,
)
"""A slot anywhere in a value, in the notation of survey tools, mails and shells; or what could not be decoded."""

_ALL_SLOT = re.compile(
    r"""\[[^\]]*\] | <[\w .:-]*> | \$\W?[a-z_].* | __[a-z][a-z_]*__ | ([@\#|*~^$%])[\w .:-]*\1 | :[a-z]\w* | n/a
    | x{3,}""",
    re.VERBOSE | re.IGNORECASE,
)
"""A value that is a slot as a whole."""

_NOTHING = {"", "undefined", "null", "none", "nan", "nil", "void", "false", "unknown", "anonymous", "empty", "blank"}
_NOTHING |= {"objectobject", "assignmentidnotavailable"}
"""What programs write for a missing value, letters and digits only."""

_NAMES = {
    "id",
    "pid",
    "userid",
    "workerid",
    "subjectid",
    "prolificid",
    "participantid",
    "sessionid",
    "yourid",
    "yourname",
}


def filled_in(parameters: Mapping[str, str], identifying: Collection[str]) -> tuple[dict[str, str], dict[str, str]]:
    """The parameters of a link without those that should say who it is and do not; and these, as they came.

    Parameters
    ----------
    identifying
        Names of the parameters that say who it is; the others are data and stay as they are.
    """
    unfilled = {name: value for name, value in parameters.items() if name in identifying and _names_nobody(name, value)}
    return {name: value.strip() for name, value in parameters.items() if value and name not in unfilled}, unfilled


def _names_nobody(name: str, value: str) -> bool:
    # Links that went through several programs are encoded more than once.
    plain = unquote(unquote(value)).strip()
    letters, own = _letters(plain), _letters(name)
    nobody = letters in _NOTHING or letters in _NAMES or letters in (own, f"your{own}")
    return nobody or bool(_SLOT.search(plain)) or bool(_ALL_SLOT.fullmatch(plain))


def _letters(text: str) -> str:
    return re.sub(r"[\W_]+", "", text.casefold())
