"""What the name of a joint says: its side, and which part of the body it may be.

In: names as rigs have them (`mixamorig:LeftUpLeg`, `J_Bip_L_UpperLeg`, `thigh.L.001`, `lShldr`, `Fuß_links`, `左ひざ`).
Out: sides, and for each role of the body how strongly the name speaks for it. Names only help: `study.motion.rigs`
finds the roles, by the shape of the skeleton.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

SIDED_ROLES = ("hip", "knee", "ankle", "toe", "collar", "shoulder", "elbow", "wrist")
CENTRE_ROLES = ("pelvis", "spine", "chest", "neck", "head")
ROLES = CENTRE_ROLES + tuple(f"{role}.{side}" for role in SIDED_ROLES for side in "LR")

# How strongly a word speaks for a role: it means that joint; it usually does; it does where no better word is there.
_SURE, _USUAL, _MAYBE = 3.0, 2.0, 1.0

_WORDS: Mapping[str, Mapping[float, str]] = {
    "hip": {
        _SURE: "upleg upperleg thigh femur oberschenkel muslo cuisse coscia coxa 大腿",
        _USUAL: "足",
        _MAYBE: "hip hips hipjoint leg buttock huefte hufte cadera hanche anca quadril bein pierna jambe gamba perna",
    },
    "knee": {
        _SURE: "lowerleg lowleg loleg calf shin shank tibia crus knee unterschenkel knie rodilla genou mollet "
        "ginocchio joelho ひざ 膝 小腿",
        _MAYBE: "leg bein pierna jambe gamba perna",
    },
    "ankle": {
        _SURE: "ankle tobillo cheville caviglia tornozelo knochel fussgelenk sprunggelenk 足首",
        _USUAL: "foot fuss pie pied piede pe 脚",
    },
    "toe": {
        _SURE: "toe toes toebase toebone ball bigtoe footindex forefoot zehe zehen orteil dedo つま先 足先 脚趾",
        _MAYBE: "foot fuss pie pied piede metatarsal metatarsals",
    },
    "collar": {
        _SURE: "collar collarbone clavicle clav scapula shoulderblade schlusselbein clavicula clavicule clavicola",
        _MAYBE: "shoulder shldr schulter hombro epaule spalla ombro 肩",
    },
    "shoulder": {
        _SURE: "uparm upperarm humerus oberarm",
        _USUAL: "arm brazo bras braccio braco 腕 上腕",
        _MAYBE: "shoulder shldr schulter hombro epaule spalla ombro 肩",
    },
    "elbow": {
        _SURE: "forearm lowerarm lowarm loarm elbow radius ulna unterarm ellbogen ellenbogen antebrazo codo avantbras "
        "coude avambraccio gomito antebraco cotovelo ひじ 肘",
        _MAYBE: "arm",
    },
    "wrist": {
        _SURE: "wrist handgelenk muneca poignet polso pulso punho 手首",
        _USUAL: "hand mano main mao 手 手掌",
    },
    "neck": {_SURE: "neck lowerneck upperneck hals nacken cuello cou collo pescoco 首 脖子"},
    "head": {_SURE: "head skull kopf cabeza tete testa cabeca 頭 头"},
}
_SPEAKS: dict[str, dict[str, float]] = {}
for _role, _by_strength in _WORDS.items():
    for _strength, _list in _by_strength.items():
        for _word in _list.split():
            _SPEAKS.setdefault(_word, {}).setdefault(_role, _strength)


def _set(*lines: str) -> frozenset[str]:
    return frozenset(word for line in lines for word in line.split())


# Joints beside the body's own: they help to draw or to steer it, or are worn.
_BESIDE = _set(
    "twist twst roll ik pole nub end tip site helper target goal eff effector aim ctrl control finger fingers thumb",
    "index middle ring pinky little metacarpal metacarpals carpal palm prop weapon gun sword attach attachment socket",
    "slot skirt dress cloth cape coat hair ponytail tail breast boob bust pectoral ear eye eyes brow eyebrow jaw lip",
    "tongue teeth cheek nose face heel muscle corrective pad holster camera wing wings feather fin antenna ferse",
    "daumen zeige pulgar indice pouce 親指 人指 中指 薬指 小指 スカート 髪 胸 目",
)
# Words of bodies that are no human's, unless arms are there beside what they name.
_ANIMAL = _set(
    "wing wings hoof hooves paw paws claw claws pincer beak fin fins fetlock hock pastern cannon snout muzzle antenna",
    "tentacle feeler mandible cephalothorax carapace feather udder",
)
_LEFT = _set("left lft lf links linke linker linkes izq izquierda izquierdo gauche sinistra sinistro esquerda")
_RIGHT = _set(
    "right rgt rt rght rechts rechte rechter rechtes der derecha derecho droite droit destra destro direita direito"
)
_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+|[^\W\d_A-Za-z]+")


@dataclass(frozen=True)
class NamedJoint:
    """What one name says."""

    side: str
    """`"L"`, `"R"` or `""`."""
    speaks: Mapping[str, float]
    """For roles without their side (`"knee"`), how strongly the name speaks: 3 is sure."""
    beside: bool
    """Whether it names something beside the body's own joints: a twist, a finger, a skirt."""
    animal: bool
    """Whether it names a part that only animals have."""


def read_names(names: Sequence[str]) -> tuple[NamedJoint, ...]:
    """What each name of a rig says; words that all of its joints share, such as an actor's name, say nothing."""
    words = [_words(name) for name in names]
    counts = Counter(word for own in words for word in set(own))
    # The root may lack them; a word of the body counts unless it is in all names.
    shared = {word for word, count in counts.items() if count >= len(names) - (word not in _SPEAKS) and len(names) > 4}
    return tuple(_read([word for word in own if word not in shared]) for own in words)


def bare_names(names: Sequence[str]) -> tuple[str, ...]:
    """Names without the words that all of a rig's begin with: `actor1:Hips` and `Actor_2_Hips` are both `hips`."""
    words = [_words(name) for name in names]
    columns = enumerate(zip(*words, strict=False))
    alike = next((k for k, column in columns if len(set(column)) > 1), 0)
    return tuple("".join(own[alike:]) for own in words)


def split_side(name: str) -> tuple[str, str]:
    """A joint name as `(side, rest)`: `("L", "upleg")` for `mixamorig:LeftUpLeg`, `l_femur`, `UpLeg_L`, `lUpLeg`.

    The side is `"L"`, `"R"` or `""`; the rest is lower case, without namespace, separators or the side.
    """
    plain = re.sub(r"^(Bip\d*|mixamorig\d*|Character\d*)[ _]", "", re.split(r"[:|/]", name)[-1])
    side, rest = _side_of(_words(plain))
    return side, "".join(rest)


def _words(name: str) -> list[str]:
    """The words of a name, lower case, accents off: `LeftUpLeg_01` is left, up, leg, 01."""
    name = unicodedata.normalize("NFKC", re.split(r"[:|/]", name)[-1]).replace("ß", "ss")
    bare = "".join(c for c in unicodedata.normalize("NFD", name) if not "\u0300" <= c <= "\u036f")
    return [word.lower() for word in _TOKEN.findall(unicodedata.normalize("NFC", bare))]


def _side_of(words: Sequence[str]) -> tuple[str, list[str]]:
    """The side that some words name, and the words without it."""
    for at, word in enumerate(words):
        for side, whole, sign, letter in (("L", _LEFT, "左", "l"), ("R", _RIGHT, "右", "r")):
            others = [*words[:at], *words[at + 1 :]]
            if word in whole or word == sign:
                return side, others
            if word == letter and any(other[0].isalpha() for other in others):
                return side, others
            if rest := _without_side(word, side, sign, letter):
                return side, [*words[:at], rest, *words[at + 1 :]]
    return "", list(words)


def _without_side(word: str, side: str, sign: str, letter: str) -> str:
    """What is left of a word that begins or ends with a side, such as `leftupleg`, `hipright`, `lfemur`; or nothing."""
    if word[0] == sign:
        return word[1:]
    whole = "left" if side == "L" else "right"
    if word.startswith(whole):
        return word.removeprefix(whole)
    if word.endswith(whole):
        return word.removesuffix(whole)
    # Only where the rest is the name of a bone, so that "leg" and "ribs" stay whole.
    rest = word[1:]
    bone = len(rest) > 2 and (rest in _SPEAKS or rest in ("thumb", "finger", "fingers"))
    return rest if bone and word[0] == letter else ""


def _read(words: Sequence[str]) -> NamedJoint:
    side, rest = _side_of(words)
    rest = [word for word in rest if not word[0].isdigit()]
    # Two words together say more than one, in either order: "upper leg", "arm lower", "toe base".
    pairs = [a + b for one, other in pairwise(rest) for a, b in ((one, other), (other, one))]
    found = [_SPEAKS.get(word) or _SPEAKS.get(word.removesuffix("s"), {}) for word in ["".join(rest), *pairs, *rest]]
    speaks = max(found, key=lambda roles: max(roles.values(), default=0.0), default={})
    beside = any(word in _BESIDE or "捩" in word or "指" in word for word in rest) and "footindex" not in pairs
    return NamedJoint(side, {} if beside else speaks, beside, any(word in _ANIMAL for word in rest))
