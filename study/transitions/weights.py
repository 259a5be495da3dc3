"""Joint weights by role, for any rig: from a name or a mapping to one number a joint.

In: a skeleton, and `"wang2003"` (Wang & Bodenheimer 2003, Table 1), `"lee2002"` (the original weights, 2003
section 3) or a mapping from role to weight. Out: `(joints,)` weights. The costs of 2004 sum over the non-global
joints (Eq. 2), so the root, which carries the facing, weighs nothing unless it is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from study.arrays import FloatArray
from study.errors import MotionError, TransitionError
from study.motion.joint_names import ROLES
from study.motion.skeleton import Skeleton

# Wang & Bodenheimer 2004, section 3.1.2: the major joints, in the order of its Table 1.
MAJOR_ROLES = tuple(f"{part}.{side}" for side in "RL" for part in ("hip", "knee", "shoulder", "elbow"))


def _both_sides(**weights: float) -> dict[str, float]:
    return {f"{part}.{side}": weight for part, weight in weights.items() for side in "LR"}


# Wang & Bodenheimer 2003, Table 1; the optimisation gave all other joints zero.
WANG2003: Mapping[str, float] = MappingProxyType(_both_sides(hip=1.0000, knee=0.0901, shoulder=0.7884, elbow=0.0247))
# Lee et al. 2002, as quoted in 2003 section 3: one for these, zero for the others.
LEE2002: Mapping[str, float] = MappingProxyType(
    {**_both_sides(shoulder=1.0, elbow=1.0, hip=1.0, knee=1.0), "pelvis": 1.0, "spine": 1.0}
)
NAMED: Mapping[str, Mapping[str, float]] = MappingProxyType({"wang2003": WANG2003, "lee2002": LEE2002})


def joint_weights(
    skeleton: Skeleton, weights: str | Mapping[str, float] = "wang2003", *, with_root: bool = False
) -> FloatArray:
    """One weight a joint.

    Parameters
    ----------
    skeleton
        The rig; joints are found by role, whatever their names.
    weights
        `"wang2003"`, `"lee2002"`, or a mapping from role to a weight of zero or more.
    with_root
        Whether the root joint may carry weight. On most rigs the root plays the pelvis; its rotation holds the
        facing of the whole figure, a global degree of freedom, which 2004 Eq. 2 omits. With it, a cost is
        the same under turns on the floor only if the caller takes the facing away first.

    Returns
    -------
    (joints,) weights; zero for every joint that is not named.

    Raises
    ------
    TransitionError
        For an unknown name of weights or an unknown role, and for weights that are negative, not finite or all zero.
    MotionError
        Where the rig has no joint for a role that weighs something.
    """
    by_role = _weights_by_role(weights)
    missing = [role for role, weight in by_role.items() if weight > 0 and role not in skeleton.roles]
    if missing:
        raise MotionError(
            f"Expected joints for the roles {', '.join(missing)} that the weights need, found "
            f"{', '.join(skeleton.roles) or 'no roles at all'}: {skeleton.body.missing[missing[0]]}. "
            "Map the roles to joints, or give weights by roles that the rig has."
        )
    result = np.zeros(skeleton.joints)
    for role, weight in by_role.items():
        if weight > 0 and (with_root or skeleton.roles[role] != 0):
            result[skeleton.roles[role]] = weight
    if not result.any():
        raise TransitionError("Expected a weight above zero for a joint other than the root, found none.")
    return result


def _weights_by_role(weights: str | Mapping[str, float]) -> Mapping[str, float]:
    if isinstance(weights, str):
        if weights not in NAMED:
            raise TransitionError(
                f"Expected joint weights {' or '.join(map(repr, NAMED))}, or a mapping from role to weight, "
                f"got {weights!r}."
            )
        return NAMED[weights]
    for role, weight in weights.items():
        if role not in ROLES:
            raise TransitionError(f"Expected joint weights by role, got {role!r}; the roles are {', '.join(ROLES)}.")
        if not (np.isfinite(weight) and weight >= 0):
            raise TransitionError(f"Expected a weight of zero or more for the role {role!r}, got {weight}.")
    return weights
