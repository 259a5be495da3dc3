"""The one-hop search as Koyama & Goto 2019 say it in Eqs. 1 to 4: it tries everything, and judges the fast one."""

from __future__ import annotations

from itertools import product

from study.transitions.one_hop.problem import IntArray, Problem, Switch

Entry = tuple[int, int, int, int, int]


def exhaustive_search(
    problem: Problem, switch: Switch, trigger: int, first_legs: dict[int, IntArray], second_legs: dict[int, IntArray]
) -> Entry | None:
    """The best transition for one triggered frame.

    Parameters
    ----------
    problem, switch, trigger
        What is asked.
    first_legs, second_legs
        By hop clip, the counts of blends from each source frame (rows) to each frame of the hop (columns), and from
        each destination frame (rows) to each frame of the hop (columns): all windows of both clips.

    Returns
    -------
    `(cost, hop, offset of the hop, stay in the source, stay in the hop)`, or None where none fits; of equal costs
    the one with the least stay in the source, then the first hop, then its first frame, then the least stay in it.
    """
    settings, blend = problem.settings, problem.settings.blend_frames
    to_destination = switch.alignment.offset_at(trigger)
    end = problem.clips[switch.destination].frames
    best: tuple[int, int, int, int, int] | None = None
    for stay_source, hop in product(range(settings.longest_stay_source + 1), problem.hop_numbers):
        start = trigger + stay_source
        if start >= len(first_legs[hop]):
            continue
        for frame in range(first_legs[hop].shape[1]):
            offset = start - frame
            allowed = problem.offsets.get((switch.source, hop))
            if allowed is not None and offset not in allowed:
                continue
            near = problem.nearest_to_direct
            if near is not None and (hop != switch.destination or abs(offset - to_destination) > near):
                continue
            for stay_hop in range(min(settings.longest_stay_hop, settings.stay_both - stay_source) + 1):
                second_start = start + blend + stay_hop
                there, here = second_start - to_destination, second_start - offset
                itself = hop == switch.destination and offset == to_destination and stay_hop == 0 and 0 <= there <= end
                if itself:  # the hop is the direct transition's destination: a blend of it with itself is nothing
                    second = 0
                elif 0 <= there < second_legs[hop].shape[0] and 0 <= here < second_legs[hop].shape[1]:
                    second = int(second_legs[hop][there, here])
                else:
                    continue
                cost = int(first_legs[hop][start, frame]) + second + problem.hop_costs.get(hop, 0)
                found = (cost + problem.weight * (stay_source + stay_hop), stay_source, hop, frame, stay_hop)
                best = found if best is None or found < best else best
    if best is None:
        return None
    cost, stay_source, hop, frame, stay_hop = best
    return cost, hop, trigger + stay_source - frame, stay_source, stay_hop
