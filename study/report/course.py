"""Response times over the course of a session: answers in, a figure out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from study.report.drawing import BLUE, FAINT, RULE, Picture, new_figure, picture_of, quiet_grid

if TYPE_CHECKING:
    import pandas as pd


def response_figure(answers: pd.DataFrame, name: str, mark: str) -> Picture | None:
    """Response times: how they are distributed, and how they change over the session; None without times."""
    timed = answers[answers["response_s"].notna()] if "response_s" in answers else answers.iloc[:0]
    if timed.empty:
        return None
    times = timed["response_s"].to_numpy(dtype=np.float64)
    with new_figure(7.2, 2.5, 1, 2, width_ratios=(1, 1.25)) as (figure, (left, right)):
        left.hist(times, bins=np.linspace(0, max(float(times.max()), 1.0), 31).tolist(), color=FAINT, edgecolor="white")
        middle = float(np.median(times))
        left.axvline(middle, color=BLUE, linewidth=1.6)
        left.annotate(f"median {middle:.2f} s", (middle, 0.98), xycoords=("data", "axes fraction"), xytext=(5, 0),
                      textcoords="offset points", color=BLUE, fontsize=8.5, va="top")  # fmt: skip
        left.set_xlabel("response time, s")
        left.set_title("answers")
        quiet_grid(left)
        if "trial" in timed:
            medians = timed.groupby("trial")["response_s"].quantile(np.array([0.25, 0.5, 0.75])).unstack()
            trials = medians.index.to_numpy(dtype=np.float64)
            right.fill_between(trials, medians[0.25], medians[0.75], color=RULE, linewidth=0)
            right.plot(trials, medians[0.5], color=BLUE, linewidth=1.4)
            right.set_xlabel("trial in the session")
            right.set_title("response time, s: median and middle half")
            right.set_ylim(bottom=0)
            quiet_grid(right)
        else:
            right.set_axis_off()
        spoken = f"median {middle:.2f} s, from {times.min():.2f} to {times.max():.2f} s"
        return picture_of(figure, name, "Response times", spoken, mark)
