"""What a file is that bears the name of a table and is none: its first bytes in, its name and the way out.

Spreadsheets, statistics programs and archives mark their files by the first bytes, whatever the name ends in.
"""

from __future__ import annotations

import zlib

SAVE = "open it in the program that made it, and save it as CSV (UTF-8)"
IN_R = 'save it as CSV in R, as in write.csv(readRDS("data.rds"), "data.csv", row.names = FALSE)'
IN_PYTHON = 'save it as CSV in Python, as in pandas.read_parquet("data.parquet").to_csv("data.csv", index=False)'
UNPACK = "unpack it, and name the table inside"

PICKLES = tuple(bytes([0x80, protocol]) for protocol in range(2, 6))

_SIGNATURES: tuple[tuple[bytes | tuple[bytes, ...], str, str], ...] = (
    (b"PAR1", "a Parquet file", IN_PYTHON),
    (b"ARROW1", "a Feather (Arrow) file", IN_PYTHON.replace("parquet", "feather")),
    (b"FEA1", "a Feather file", IN_PYTHON.replace("parquet", "feather")),
    (b"$FL2", "an SPSS file (.sav)", SAVE),
    (b"$FL3", "an SPSS file (.zsav)", SAVE),
    (b"<stata_dta>", "a Stata file (.dta)", SAVE),
    (b"\0" * 12 + b"\xc2\xea\x81\x60", "a SAS file (.sas7bdat)", SAVE),
    (b"HEADER RECORD*******LIB", "a SAS transport file (.xpt)", SAVE),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "a spreadsheet of an older Excel (.xls), or one with a password", SAVE),
    (b"SQLite format 3\0", "an SQLite database", "export its table as CSV"),
    (b"\x89HDF", "an HDF5 or MATLAB file", SAVE),
    (b"MATLAB 5.0", "a MATLAB file (.mat)", SAVE),
    (b"RDX", "an R file (.RData)", IN_R.replace('readRDS("data.rds")', "the_table")),
    (b"X\n\0\0", "an R file (.rds)", IN_R),
    (b"A\n", "an R file (.rds)", IN_R),
    (b"BZh", "a compressed file (bzip2), perhaps of R (.rds)", f"{UNPACK}; of R's, {IN_R}"),
    (b"\xfd7zXZ\0", "a compressed file (xz), perhaps of R (.rds)", f"{UNPACK}; of R's, {IN_R}"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", UNPACK),
    (b"Rar!", "a RAR archive", UNPACK),
    (b"%PDF", "a PDF document", "export the table from the program that made the data"),
    (b"{\\rtf", "a text document (RTF)", SAVE),
    (PICKLES, "a Python pickle (PsychoPy's .psydat)", "use the .csv that PsychoPy writes beside it"),
)
_IN_ARCHIVES = (
    (b"opendocument.spreadsheet", "a spreadsheet of LibreOffice (.ods)", SAVE),
    (b"xl/workbook", "an Excel spreadsheet (.xlsx)", SAVE),
    (b"word/document", "a Word document (.docx)", SAVE),
    (b"Index/Document", "a spreadsheet of Numbers", SAVE),
)
_MARKUP = (
    ("<?xml", "XML"),
    ("<!doctype", "a web page (HTML), perhaps one to sign in on"),
    ("<html", "a web page (HTML)"),
)


def other_kind(content: bytes) -> tuple[str, str] | None:
    """Return what a file is if not text, and what to do; None where it may be text.

    Parameters
    ----------
    content
        Of the file, from its first byte.
    """
    if content[:4] == b"PK\x03\x04":
        inside = ((name, way_out) for mark, name, way_out in _IN_ARCHIVES if mark in content)
        return next(
            inside, ("a spreadsheet (.xlsx, .ods) or another ZIP archive", f"{SAVE}; {UNPACK} where it is none")
        )
    if content[:2] == b"\x1f\x8b":
        return other_kind(_unpacked(content)) or ("a compressed file (gzip)", UNPACK)
    for mark, name, way_out in _SIGNATURES:
        if content.startswith(mark):
            return name, way_out
    start = content[:200].lstrip(b"\xef\xbb\xbf \t\r\n").lower().decode("latin-1")
    return next(((name, SAVE) for mark, name in _MARKUP if start.startswith(mark)), None)


def _unpacked(content: bytes) -> bytes:
    try:
        return zlib.decompressobj(wbits=31).decompress(content, 64)
    except zlib.error:
        return b""
