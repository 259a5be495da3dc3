"""A release: a results folder in; a folder out that can be published, from which anyone gets the same results.

It is a results folder without identities (`anonymous`), so that `segue analyse`, `report` and `fit` read it, and a
Psych-DS data set, so that other programs do. Beside them stand the report, the licence, how to cite it, and checksums.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import study
from study.errors import SessionError
from study.experiment.folder import ANSWERS, MANIFEST, PROTOCOL
from study.experiment.protocol.whole import Protocol
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.anonymous import without_identities
from study.experiment.store.export import Credit, Shared, gather, refuse_to_replace, write_data, write_json
from study.experiment.store.responses import Responses
from study.files import whole_folder, write_whole
from study.report.document import write_report

SUMS = "SHA256SUMS"


def release(protocol: Protocol, manifest: Manifest, responses: Responses, folder: Path, credit: Credit) -> None:
    """Write a study as others may have it; an earlier export of ours there is replaced.

    Raises
    ------
    SessionError
        Where nobody or no licence is named, stimuli are not rendered, there is no answer, or the folder holds anything
        that Segue did not export.
    """
    if not (credit.authors and credit.licence):
        raise SessionError(
            "Expected who made the study and what others may do with it, found "
            f"{'no licence' if credit.authors else 'no author'}; add --author NAME and --licence, such as CC-BY-4.0. "
            "Choose a licence that the motions allow, too."
        )
    films = [str(video["file"]) for video in manifest.videos.values()]
    if missing := len(manifest.records) - sum((manifest.folder / film).is_file() for film in films):
        raise SessionError(f"{manifest.folder}: expected all stimuli rendered, found {missing} without; render first.")
    refuse_to_replace(folder)
    with whole_folder(folder) as unfinished:
        for film in films:
            (unfinished / film).parent.mkdir(exist_ok=True)
            shutil.copyfile(manifest.folder / film, unfinished / film)
        write_whole(unfinished / PROTOCOL, protocol.text)
        known = json.loads((manifest.folder / MANIFEST).read_text(encoding="utf-8"))
        write_json(unfinished / MANIFEST, {**known, "library": Path(manifest.library).name})
        with without_identities(protocol, responses, unfinished / ANSWERS) as shown:
            shared = gather(protocol, shown, manifest.blends, credit)
        write_data(shared, unfinished)
        write_report(unfinished, out=unfinished / "results")
        _write_words(shared, manifest, unfinished)
        names = sorted(path.relative_to(unfinished).as_posix() for path in unfinished.rglob("*") if path.is_file())
        sums = (f"{hashlib.sha256((unfinished / name).read_bytes()).hexdigest()}  {name}\n" for name in names)
        write_whole(unfinished / SUMS, "".join(sums))


def _write_words(shared: Shared, manifest: Manifest, folder: Path) -> None:
    """What a person reads first: readme, licence, how to cite."""
    credit = shared.credit
    licence = f"{credit.licence}\n{credit.address}\n\n{'; '.join(credit.authors)}\n"
    acknowledged = f"\nMotions: {manifest.acknowledgement}\n" if manifest.acknowledgement else ""
    write_whole(folder / "LICENSE", licence + acknowledged)
    about = {
        "cff-version": "1.2.0",
        "message": "If you use these data, please cite them as below.",
        "type": "dataset",
        "title": shared.title,
        "abstract": shared.words,
        "license": credit.licence,
    }
    lines = [f"{key}: {json.dumps(text, ensure_ascii=False)}" for key, text in about.items()]
    lines += ["authors:", *(f"  - {_cited(name)}" for name in credit.authors)]
    write_whole(folder / "CITATION.cff", "\n".join(lines) + "\n")
    guide = GUIDE.format(version=study.__version__, licence=credit.licence, sums=SUMS)
    write_whole(folder / "README.md", shared.readme + guide)


def _cited(name: str) -> str:
    """An author in the words of the Citation File Format: a person where there is a comma, else a group."""
    family, _, given = (part.strip() for part in name.partition(","))
    parts = {"family-names": family, "given-names": given} if given else {"name": name}
    return json.dumps(parts, ensure_ascii=False)


GUIDE = """
- `data/`: the answers; `dataset_description.json` says what each column means ([Psych-DS](https://psych-ds.github.io))
- `stimuli/`, `manifest.json`: the films, and what each of them is; `protocol.toml`: the study as it was planned
- `results/`: the report (`report.html`), its tables, figures and Methods section
- `LICENSE`, `CITATION.cff`: {licence}; how to cite these data. Checksums: `sha256sum -c {sums}`

To get the results again, install Segue {version} and run `segue analyse .`,
`segue report . --out again`, or `segue fit data/TASK_data.csv` in this folder.

Participants have other names, in another order. Dates and texts that they wrote are not included, times count from the
beginning of each session, and what they said of themselves is shared by five participants or more, or withheld.
"""
