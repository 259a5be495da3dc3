"""Motion in formats that are not read: what a file is, by its suffix or its first bytes, and the way to BVH from there.

Exporting from Blender (3.6 to 4.x): File > Import, select the armature, File > Export > Motion Capture (.bvh).
"""

from __future__ import annotations

from pathlib import Path

_BLENDER = "Make a BVH file of it in Blender: File > Import, select the armature, File > Export > Motion Capture (.bvh)"
_ENGINE = (
    "Export the animation as FBX from the engine (Unreal: Asset Actions > Export; Unity: the FBX Exporter package). "
    f"{_BLENDER}"
)
_MARKERS = (
    "It holds markers and no skeleton: let the capture software (Vicon, Qualisys, OptiTrack Motive and others) solve a "
    "skeleton, and export that as BVH"
)
_SMPL = "Import it into Blender with an add-on for SMPL or AMASS, then use File > Export > Motion Capture (.bvh)"
_NO_MOTION = "Give the motion capture itself: a .bvh file, or an .amc file with its .asf"

# What a suffix stands for, and what to do.
_SUFFIXES = {
    ".fbx": ("an FBX file", _BLENDER),
    ".vrm": ("a VRM file", _BLENDER),
    ".vrma": ("a VRM animation", _BLENDER),
    ".dae": ("a Collada file", _BLENDER),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), ("a USD file", _BLENDER)),
    ".abc": ("an Alembic file", _BLENDER),
    ".blend": ("a Blender file", "Open it in Blender, select the armature, File > Export > Motion Capture (.bvh)"),
    ".anim": ("an animation of Unity or Maya", _ENGINE),
    ".uasset": ("an asset of Unreal", _ENGINE),
    ".bip": ("a Biped file of 3ds Max", f"Export it as FBX from 3ds Max. {_BLENDER}"),
    ".vmd": ("an MMD motion", "Import it into Blender with the add-on mmd_tools, then export it as BVH"),
    **dict.fromkeys((".mvnx", ".mvn"), ("a file of Xsens MVN", "Export BVH from MVN Analyze or Animate")),
    ".tak": ("a take of OptiTrack Motive", "Export BVH from Motive"),
    ".c3d": ("a C3D file", _MARKERS),
    ".trc": ("a TRC file", _MARKERS),
    **dict.fromkeys((".tsv", ".csv"), ("a table", _MARKERS)),
    ".npz": ("a NumPy file, as AMASS has them", _SMPL),
    ".npy": ("a NumPy file", _SMPL),
    ".pkl": ("a Python pickle, as SMPL tools write them", _SMPL),
    ".json": ("a JSON file", _NO_MOTION),
    **dict.fromkeys((".mp4", ".mov", ".avi"), ("a video", _NO_MOTION)),
    ".zip": ("a ZIP archive", "Unpack it"),
    ".gz": ("a compressed file", "Unpack it"),
    ".xlsx": ("a spreadsheet", _NO_MOTION),
}
KNOWN = tuple(_SUFFIXES)

# How files begin, whatever they are called.
_BEGINNINGS = (
    (b"Kaydara FBX Binary", _SUFFIXES[".fbx"]),
    (b"; FBX", _SUFFIXES[".fbx"]),
    (b"glTF", ("a glTF file", "Let its name end in .glb")),
    (b"BLENDER", _SUFFIXES[".blend"]),
    (b"#usda", _SUFFIXES[".usda"]),
    (b"PXR-USDC", _SUFFIXES[".usdc"]),
    (b"Vocaloid Motion Data", _SUFFIXES[".vmd"]),
    (b"\x93NUMPY", _SUFFIXES[".npy"]),
    (b"PK\x03\x04", ("a ZIP archive (spreadsheets and .npz files are such)", "Unpack it, or export BVH")),
    (b"\x1f\x8b", _SUFFIXES[".gz"]),
    (b"<", ("a web page or XML", "If it was downloaded, download it again; if another program wrote it, export BVH")),
    (b"{", _SUFFIXES[".json"]),
    (b"[", _SUFFIXES[".json"]),
)
_C3D_MARK = 0x50


def by_suffix(path: Path) -> str | None:
    """What a file is called to be, and what to do: `found an FBX file. ...`; None for suffixes that say nothing."""
    found = _SUFFIXES.get(path.suffix.lower())
    return None if found is None else _sentence(found)


def by_beginning(content: bytes) -> str | None:
    """What a file is by its first bytes, and what to do; None where they say nothing."""
    start = content[:64].lstrip()
    for beginning, found in _BEGINNINGS:
        if start.startswith(beginning):
            return _sentence(found)
    # The first byte of a C3D file counts blocks before its parameters: a few.
    if content[1:2] == bytes([_C3D_MARK]) and 2 <= content[0] < 32 and b"\0" in content[:512]:
        return _sentence(_SUFFIXES[".c3d"])
    return None


def _sentence(found: tuple[str, str]) -> str:
    return f"found {found[0]}. {found[1]}."
