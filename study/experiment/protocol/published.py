"""The protocols that come with Segue: their folder, and the file of one by its name."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

from study.errors import ProtocolError


def protocols_folder() -> Path:
    """The folder of published protocols: the repository's, or the one that the installed package carries."""
    import study

    package = Path(str(study.__file__)).resolve().parent
    for folder in (package / "protocols", package.parent / "protocols"):
        if any(folder.glob("*.toml")):
            return folder
    raise ProtocolError(
        f"Expected the protocols that come with Segue in {package / 'protocols'} or {package.parent / 'protocols'}, "
        "found neither; install the package again, or name a protocol file."
    )


def find_protocol(name_or_path: str | Path) -> Path:
    """The file of a protocol, named by path or by the name of one that comes with Segue."""
    path = Path(name_or_path)
    if path.is_file():
        return path
    folder = protocols_folder()
    known = sorted(p.stem for p in folder.glob("*.toml"))
    if path.parent == Path() and path.stem in known and path.suffix in ("", ".toml"):
        return folder / f"{path.stem}.toml"
    near = get_close_matches(path.stem, known, n=1)
    hint = f"did you mean {near[0]!r}?" if near else "write a path, or one of these names."
    raise ProtocolError(
        f"Expected a protocol file or the name of one that comes with Segue ({', '.join(known)}), "
        f"found {str(name_or_path)!r}; {hint}"
    )
