"""Open data: real people's responses, analysed as they were published, or as another program does it.

The ratings are of the Netflix public data set, 26 viewers of 79 videos on a scale of 1 to 5, as the repository
Netflix/sureal has them (Copyright 2016-2018 Netflix, Inc., Apache License 2.0); its tests print the numbers (Li and
Bampis 2017, Recover subjective quality scores from noisy measurements, Data Compression Conference). The judgements of
time order are of Linares and Lopez-Moliner 2006 (Perceptual asynchrony between color and motion with a single direction
change, Journal of Vision 6, 974-981), as the R package quickpsy has them (Copyright 2014-2015 Daniel Linares, MIT).
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from study.analysis.psychometric.analyse import analyse_psychometric
from study.analysis.psychometric.likelihood import LikelihoodFit, fit_likelihood
from study.analysis.psychometric.model import make_model
from study.analysis.ratings.table import rating_table

# One word a video, one digit a viewer.
RATINGS = """
54555535555555555555555555 45555555454555555555555555 55555545344555555445554555 45555554454555455555555454
55555555555555555445554555 45555535555555555555555555 35454454454555355435554555 55555545553555555455445455
55455455355555555445554555 11121111131221112112111112 21233122232342122122311232 22232222243335222422222133
33444333353443223333323243 43544444454454334334334245 53555555555554454553544555 54555545555555454554445344
54355545555555455555544355 55455555555555555555545455 55555355554555555545555455 21332223133235112222121132
11332122132242312213221122 22431323342343312223332234 22433233353342323323232242 33444443353444434334334343
44554544455445555344554454 55555555455555545555555554 45555555455545555555455555 11111111111111111111111111
22222123131312222222122132 23353313143434333212233233 33434334344443333223434243 33554535454444454324443453
55554355454545454443444454 55445445454444555455545454 11111131122211111111111111 11223111123332211111211112
33454434244343233233232243 23444434344443433333433344 44555444455543554343434354 44545554455455555454544555
55555545454555455544554455 11312111142111111111111121 12324232253443233232322123 21235423443443243222422234
33525114443443324422433244 43425434453442345243543254 52335445554455544334434254 44455524555554545544434455
55545545554543555554554455 55445545554555555544555555 12321232142231232221221122 32524332444453342333323333
43443434443343333333332343 44444444454453454443443445 55554555555554554435544554 55555535555554555555555555
11112111121111111111111121 12322142131221212112212232 32343233143322322221322232 33234454352343222233333243
54534455354553554434444454 45355555454554354444544553 55445545554554555455555555 11111111121111111111111111
22413223122343222111222122 22324134243433332223223133 33343534353334334224332234 44335333354453533334434354
44444235453444434324434354 45453545553544545344353445 35345544454555555345554455 55555135354454545435444555
55555544454543455445554555 21221113131121112222121131 12223253343343322223222223 32443324344444322424323353
33533434143453343333233443 35535555255453445435434455 55435545455453545555545454
"""
PHASES = (-250.0, -200.0, -150.0, -100.0, -50.0, 0.0, 50.0, 100.0)
JUDGED = {
    ("1", "1"): (2, 0, 1, 13, 32, 37, 36, 37),
    ("1", "2"): (1, 2, 10, 30, 37, 39, 40, 39),
    ("2", "1"): (0, 1, 2, 10, 18, 18, 20, 19),
    ("2", "2"): (0, 2, 8, 14, 20, 20, 20, 19),
    ("3", "1"): (0, 1, 3, 6, 16, 18, 20, 19),
    ("3", "2"): (1, 5, 8, 8, 18, 19, 20, 20),
}
"""Judgements at each phase by participant and condition; the first participant was asked 40 times, the others 20."""


def test_mean_opinion_scores_of_videos() -> None:
    words = RATINGS.split()
    rows = [
        (f"v{viewer}", f"{video:02}", int(point))
        for video, word in enumerate(words)
        for viewer, point in enumerate(word)
    ]
    answers = pd.DataFrame(rows, columns=["participant", "method_a", "answer"])
    found = rating_table(answers)
    assert (len(found), {row.participants for row in found}) == (79, {26})
    means, errors = np.array([row.mean for row in found]), np.array([row.standard_error for row in found])
    assert (means[0], means[10]) == (pytest.approx(4.884615384615385), pytest.approx(2.0769230769230771))
    assert means.mean() == pytest.approx(3.544790652385589, abs=1e-9)
    assert errors[0] == pytest.approx(0.08461538461538462, abs=1e-9)
    assert errors.mean() == pytest.approx(0.12986637295658307, abs=1e-9)


def test_thresholds_of_asynchrony_are_those_of_a_probit_regression() -> None:
    """The package fits a cumulative normal without guesses and lapses, which is a probit regression."""
    import statsmodels.api as sm

    for (who, condition), seen in JUDGED.items():
        shown = 40 if who == "1" else 20
        yes, asked = np.array(seen, dtype=float), np.full(8, float(shown))
        design = sm.add_constant(np.array(PHASES))
        family = sm.families.Binomial(link=sm.families.links.Probit())
        slope = sm.GLM(np.column_stack([yes, asked - yes]), design, family=family).fit().params
        model = make_model("yes-no", guess=0.0, lapse=0.0)
        found = fit_likelihood(PHASES, yes, asked, model)
        assert isinstance(found, LikelihoodFit)
        assert found.threshold == pytest.approx(-slope[0] / slope[1], abs=0.05), (who, condition)
        # From 5 to 95% of a normal distribution are 3.29 of its standard deviations.
        assert found.width == pytest.approx(2 * 1.6448536 / slope[1], rel=2e-3), (who, condition)
        trials = pd.DataFrame({"participant": who, "level": PHASES, "yes": yes, "shown": asked})
        believed = analyse_psychometric(trials, model).believed
        assert believed.low < found.threshold < believed.high
