"""QUEST+ against published sequences, against the definition by brute force, and against what is known to be true."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import chi2

from study.models.quest_plus import QuestPlus, likelihood_interval, median

DECIBELS = np.arange(-40.0, 1.0)
# Watson 2017: the answers (1 right, 0 wrong) and the contrasts of two of his examples, and the posterior's modes.
THRESHOLD = (
    "1111001111 1111011011 0111111111 11",
    "-18 -22 -25 -28 -30 -22 -13 -15 -16 -18 -19 -20 -21 -22 -23 -19 -20 -20 -18 -18 -19 -17 -17 -18 -18 -18 -19 -19 "
    "-19 -19 -19 -19",
    (3.5,),
    (-20.0,),
)
THRESHOLD_AND_SLOPE = (
    "1011111111 1110110111 0111101111 1111111011 0011110101 1101111111 1111",
    "-18 -22 -12 -13 -15 -16 -17 -18 -19 -21 -24 -25 -26 -27 -21 -22 -23 -20 -20 -20 -21 -19 -19 -20 -20 -20 -19 -19 "
    "-19 -19 -19 -20 -20 -20 -20 -20 -21 -21 -20 -20 -20 -19 -18 -18 -19 -19 -19 -18 -18 -17 -18 -18 -18 -17 -17 -17 "
    "-17 -17 -17 -17 -18 -18 -18 -18",
    (2.0, 3.0, 4.0, 5.0),
    (-20.0, 3.0),
)


def contrast(slopes: tuple[float, ...]) -> QuestPlus:
    """Watson's Weibull function of contrast in decibels: one in two right by guessing, 2% lapses, flat priors."""
    threshold, slope = (part.ravel() for part in np.meshgrid(DECIBELS, slopes, indexing="ij"))
    chances = 0.98 - 0.48 * np.exp(-(10 ** (slope * (DECIBELS[:, None] - threshold) / 20)))
    return QuestPlus((DECIBELS, np.array(slopes)), chances, np.full(len(threshold), 1 / len(threshold)))


@pytest.mark.parametrize("example", [THRESHOLD, THRESHOLD_AND_SLOPE], ids=["threshold", "threshold and slope"])
def test_published_sequences_replay_trial_by_trial(
    example: tuple[str, str, tuple[float, ...], tuple[float, ...]],
) -> None:
    answers, contrasts, slopes, modes = example
    quest = contrast(slopes)
    yes, no = np.zeros(41, dtype=np.int64), np.zeros(41, dtype=np.int64)
    for right, shown in zip(answers.replace(" ", ""), contrasts.split(), strict=True):
        level = quest.next_level(quest.posterior(yes, no))
        assert DECIBELS[level] == float(shown)
        (yes if right == "1" else no)[level] += 1
    mass = quest.posterior(yes, no)
    points = np.array(list(itertools.product(*quest.axes)))
    assert tuple(points[mass.argmax()])[: len(modes)] == modes


def test_the_level_has_the_least_expected_entropy() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        chances = rng.uniform(0.02, 0.98, (7, 12))
        quest = QuestPlus((np.arange(3.0), np.arange(4.0)), chances, rng.dirichlet(np.ones(12)))
        yes, no = rng.integers(0, 3, (2, 7))
        # By definition: the posterior after each answer that may come, from Bayes' rule one answer at a time.
        mass = quest.prior
        for level, count in itertools.chain(enumerate(yes), ((~level, count) for level, count in enumerate(no))):
            for _ in range(count):
                mass = mass * (chances[level] if level >= 0 else 1 - chances[~level])
                mass = mass / mass.sum()
        np.testing.assert_allclose(quest.posterior(yes, no), mass, atol=1e-12)
        expected = []
        for level in range(7):
            entropy = 0.0
            for chance in (chances[level], 1 - chances[level]):
                share, after = (mass * chance).sum(), mass * chance / (mass * chance).sum()
                entropy -= share * (after * np.log(after)).sum()
            expected.append(entropy)
        assert quest.next_level(mass) == int(np.argmin(expected))
        before = -(mass * np.log(mass)).sum()
        np.testing.assert_allclose(quest.information(mass), before - np.array(expected), atol=1e-12)


def test_levels_that_tell_the_same_are_taken_in_their_order() -> None:
    chances = np.repeat(np.linspace(0.1, 0.9, 9)[None], 5, axis=0)
    quest = QuestPlus((np.arange(9.0),), chances * (1 + 1e-15 * np.arange(5)[:, None]), np.full(9, 1 / 9))
    assert quest.next_level(quest.prior) == 0


def test_the_median_is_that_of_the_marginal() -> None:
    assert median(np.arange(101.0), np.full(101, 1 / 101)) == pytest.approx(50)
    assert median(np.array([1.0, 2.0, 4.0]), np.array([0.2, 0.2, 0.6])) == pytest.approx(2 + 2 * 0.2 / 0.4)


def test_the_likelihood_interval_is_that_of_a_share_in_closed_form() -> None:
    """Of 13 in 20, where the ends solve 2 (l(0.65) - l(p)) = 3.8415; and with a second parameter that is free."""
    shares = np.linspace(0.0005, 0.9995, 1000)

    def log(share: float) -> float:
        return 13 * np.log(share) + 7 * np.log1p(-share)

    def off(share: float) -> float:
        return 2 * (log(0.65) - log(share)) - chi2.ppf(0.95, 1)

    known = brentq(off, 0.1, 0.65), brentq(off, 0.65, 0.99)
    likelihood = np.array([[log(share) - nuisance**2 for nuisance in (-1.0, 0.0, 2.0)] for share in shares])
    quest = QuestPlus((shares, np.arange(3.0)), np.full((1, 3000), 0.5), np.full(3000, 1 / 3000))
    np.testing.assert_allclose(likelihood_interval(shares, quest.profile(likelihood.ravel(), 0)), known, atol=1e-3)
    assert likelihood_interval(shares, np.zeros(1000)) == (shares[0], shares[-1])
