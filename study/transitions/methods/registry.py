"""Every member of the three parts by name, and the methods of the papers, which are built in.

A new part is one module and one line here; a new method is one more triple. Everything else asks this registry: points,
stimuli, protocol, reports, simulated observers and the command line.
"""

from __future__ import annotations

from collections.abc import Mapping

from study.transitions.methods.lengths.none import NoLength
from study.transitions.methods.lengths.wang2004 import Fixed, Geodesic, Timewarp, Velocity
from study.transitions.methods.makes.blends import Cut, Registered, Slerp, Warped
from study.transitions.methods.makes.dead_blend import DeadBlend
from study.transitions.methods.makes.given import Given
from study.transitions.methods.makes.inertialize import Inertialize, InertializeQuintic
from study.transitions.methods.makes.one_hop import OneHop
from study.transitions.methods.method import Length, Make, Method, Points
from study.transitions.methods.points.least_cost import LeastCost
from study.transitions.methods.points.shared import Shared

POINTS: Mapping[str, type[Points]] = {part.name: part for part in (Shared, LeastCost)}
LENGTHS: Mapping[str, type[Length]] = {part.name: part for part in (Fixed, Geodesic, Velocity, Timewarp, NoLength)}
MAKES: Mapping[str, type[Make]] = {
    part.name: part
    for part in (Slerp, Registered, Warped, Cut, Inertialize, InertializeQuintic, DeadBlend, OneHop, Given)
}

DIRECT: Mapping[str, type[Make]] = {
    name: make for name, make in MAKES.items() if make.windows == 1 and make is not OneHop
}
"""Makes that join two motions over one length and need no third."""

# Utilities by 2004 Table 2; of cuts at two optima, the distance that gives 2003's F of 6.39 in ratings. Of methods of
# games no comparison is known: they are taken for as natural as a blend of fixed length.
METHODS: Mapping[str, Method] = {
    method.name: method
    for method in (
        Method("fixed", Shared(), Fixed(), Slerp(), 0.0),
        Method("velocity", Shared(), Velocity(), Slerp(), 0.65),
        Method("geodesic", Shared(), Geodesic(), Slerp(), 3.29),
        Method("timewarp", Shared(), Timewarp(), Warped(), 3.06),
        Method("registration-curve", Shared(), Geodesic(), Registered(), 3.29),
        Method("cut", Shared(), NoLength(), Cut(), -2.0),
        Method("cut-lee2002", LeastCost("lee2002"), NoLength(), Cut(), -2.6),
        Method("cut-wang2003", LeastCost("wang2003"), NoLength(), Cut(), -0.2),
        Method("cut-pointcloud", LeastCost("pointcloud"), NoLength(), Cut(), -1.4),
        Method("inertialize", Shared(), Geodesic(), Inertialize(), 0.0),
        Method("inertialize-quintic", Shared(), Geodesic(), InertializeQuintic(), 0.0),
        Method("dead-blend", Shared(), Geodesic(), DeadBlend(), 0.0),
        Method("one-hop", Shared(), Fixed(), OneHop(), 1.5),
    )
}
