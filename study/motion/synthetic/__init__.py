"""The synthetic library: motions made up from published kinematics of human movement; any length, frame rate, seed.

Segue's embedded default, so that a study can be tried without motion capture. `docs/synthetic.md` gives the
sources, the parameters and the limits.
"""

from __future__ import annotations

from study.motion.synthetic.catalogue import NAMES, Description, describe, synthesize

__all__ = ["NAMES", "Description", "describe", "synthesize"]
