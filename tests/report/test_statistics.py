import itertools
import time

import numpy as np
import pytest
from scipy import stats

from holobench_eval.datasets.base import clusters_of
from holobench_eval.datasets.crops import Crops
from holobench_eval.report import statistics
from holobench_eval.report.statistics import _signs, family_p, mean_interval, ratio_interval, two_way
from tests.support.coverage import (
    DESIGNS,
    SHAPES,
    VARIANCES,
    coverage,
    false_positives,
    ratio_coverage,
    samples,
    two_way_coverage,
)

IN_USE, IN_PAIRS = DESIGNS["40 alone"], DESIGNS["28 in 15 clusters"]
PAIRS = list("aabbccddee")


def test_the_simulated_design_is_that_of_the_targets_in_use():
    clusters = list(clusters_of(Crops()).values())
    assert sorted(map(clusters.count, set(clusters))) == sorted(IN_USE)


@pytest.mark.parametrize(
    ("shape", "design"),
    [*itertools.product(SHAPES, ("40 alone", "28 in 15 clusters")), ("normal", "8 alone"), ("normal", "4 alone")],
)
def test_intervals_hold_the_true_mean_as_often_as_they_say(shape, design):
    assert 0.93 <= coverage(shape, DESIGNS[design], 4000) <= 0.97


def test_targets_that_are_taken_for_independent_have_intervals_that_are_too_narrow():
    assert coverage("normal", IN_PAIRS, 2000, by_cluster=False) < 0.91


@pytest.mark.parametrize("shape", SHAPES)
def test_intervals_of_ratios_hold_the_true_ratio_as_often_as_they_say(shape):
    assert 0.93 <= ratio_coverage(shape, IN_USE, 3000) <= 0.97


def test_an_interval_of_targets_that_are_alone_is_that_of_students_t():
    values = np.random.default_rng(2).normal(size=9)
    low, high = stats.t.interval(0.95, 8, values.mean(), stats.sem(values))
    found = mean_interval(values)
    assert (found.low, found.high, found.n, found.clusters) == pytest.approx((low, high, 9, 9))


def test_an_interval_of_equal_clusters_is_that_of_their_means():
    values = np.random.default_rng(3).normal(size=10)
    means = mean_interval(values.reshape(5, 2).mean(1))
    found = mean_interval(values, PAIRS)
    assert (found.low, found.mean, found.high) == pytest.approx((means.low, means.mean, means.high))
    assert (found.n, found.clusters) == (10, 5)


def test_below_three_targets_clusters_or_displays_there_is_no_interval_and_no_test():
    for few in ([], [1.0], [1.0, 2.0]):
        estimate = mean_interval(few)
        assert estimate.n == len(few)
        assert np.isnan([estimate.low, estimate.high]).all()
        assert not estimate.is_clear
    values = np.array([1.0, 2.0, 3.0, 2.0, 1.0, 2.0])
    assert np.isnan(mean_interval(values, list("aaabbb")).low)
    assert np.isnan(ratio_interval(values, values + 1, list("aaabbb")).low)
    assert np.isnan(family_p(values[None], list("aaabbb"))).all()
    assert np.isnan([two_way(np.eye(2, 5))[1:], two_way(np.eye(5, 2))[1:]]).all()


def test_equal_values_have_an_interval_without_width_and_no_difference_has_p_one():
    estimate = mean_interval([0.5] * 6)
    assert (estimate.low, estimate.mean, estimate.high) == two_way(np.full((4, 5), 0.5)) == (0.5, 0.5, 0.5)
    assert family_p(np.zeros((1, 5))) == [1.0]


def test_a_ratio_is_exact_at_its_ends_and_to_what_may_be_zero_has_no_interval():
    gap = np.random.default_rng(6).normal(4, 1, size=10)
    for share in (0.0, 0.5, 1.0):
        found = ratio_interval(share * gap, gap, PAIRS)
        assert (found.low, found.mean, found.high) == pytest.approx((share, share, share))

    values = np.array([1.0, -2.0, 3.0, -1.0, 0.5])
    assert np.isnan(ratio_interval(values, values[::-1]).low)


def counted(differences, clusters):
    """Step-down min-p over every sign of every cluster; of equal p the larger t is taken for the smaller."""
    names = sorted(set(clusters))
    index = np.array([names.index(cluster) for cluster in clusters])
    found = []
    for signs in itertools.product((1, -1), repeat=len(names)):
        turned = np.asarray(signs)[index] * differences
        sums = np.stack([turned[:, index == number].sum(1) for number in range(len(names))], axis=1)
        found.append(np.abs(sums.mean(1) / np.maximum(sums.std(1, ddof=1), 1e-15)).round(9))
    own = [[(np.mean(column >= t), -t) for t in column] for column in np.array(found).T]
    adjusted, least = {}, 0.0
    for number in sorted(range(len(differences)), key=lambda number: own[number][0]):
        weaker = [other for other in range(len(differences)) if other not in adjusted]
        smallest = [min(own[other][flip] for other in weaker) for flip in range(len(found))]
        adjusted[number] = least = max(least, np.mean([p <= own[number][0] for p in smallest]))
    return [adjusted[number] for number in range(len(differences))]


def test_p_values_equal_a_count_over_all_signs():
    differences = np.random.default_rng(7).normal([[0.0], [0.6], [2.0]], 1, size=(3, 10))
    assert family_p(differences, PAIRS) == pytest.approx(counted(differences, PAIRS))


def test_signs_that_are_drawn_give_nearly_the_p_values_of_all_signs(monkeypatch):
    differences = np.random.default_rng(8).normal([[0.0], [0.4], [0.7], [1.0]], 1, size=(4, 12))
    exact = family_p(differences)
    monkeypatch.setattr(statistics, "MOST_ENUMERATED", 5)
    _signs.cache_clear()
    drawn = family_p(differences)
    _signs.cache_clear()
    assert np.abs(drawn - exact).max() < 0.01
    assert (drawn > 0).all()


@pytest.mark.parametrize(
    ("shape", "most", "clusters", "comparisons"),
    list(zip(SHAPES, (0.07, 0.1, 0.2), (15, 40, 15), (5, 2, 5), strict=False)),
)
def test_a_false_difference_is_seldom_shown(shape, most, clusters, comparisons):
    """Comparisons are independent, which is the worst; ``docs/statistics.md`` has the shares of 2000 families."""
    assert false_positives(shape, clusters, comparisons, 300) <= most


def test_a_difference_over_displays_that_is_none_is_seldom_shown():
    assert false_positives("skewed (gamma, skewness 1)", 20, 1, 1000) <= 0.06


@pytest.mark.parametrize("variances", VARIANCES)
@pytest.mark.parametrize("shape", list(SHAPES)[:2])
def test_intervals_over_displays_and_clusters_hold_the_true_mean(shape, variances):
    most = 0.97 if any(variances[:2]) else 0.99
    assert 0.93 <= two_way_coverage(shape, 20, 15, variances, 4000) <= most


def test_an_interval_over_displays_alone_is_that_of_their_means():
    means = np.random.default_rng(16).normal(size=7)
    found = mean_interval(means)
    assert two_way(np.tile(means[:, None], 5)) == pytest.approx((found.mean, found.low, found.high))


@pytest.mark.parametrize("clusters", [6, 15, 40])
def test_a_difference_as_large_as_could_be_shown_is_shown_in_four_of_five_studies(clusters):
    found = mean_interval(np.random.default_rng(17).normal(size=clusters))
    quantile = stats.t.ppf(0.975, clusters - 1)
    error = (found.high - found.low) / 2 / quantile
    assert stats.nct.sf(quantile, clusters - 1, found.detectable / error) == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_family_without_a_difference_shows_one_in_at_most_one_of_twenty_studies(shape):
    """Five comparisons with one baseline, so that they are correlated; 97 % of 1000 studies would show too few."""
    drawn, clusters = samples(shape, DESIGNS["8 alone"], 1000, columns=6)
    shown = [(family_p(study[1:] - study[0], clusters) < 0.05).any() for study in drawn]
    assert np.mean(shown) <= 0.065


def test_a_family_costs_little_where_its_comparisons_are_alike():
    differences = np.random.default_rng(9).normal(0.6, 1, size=12)
    alone, alike = family_p(differences[None])[0], family_p(np.stack([differences] * 20))[0]
    assert alike == pytest.approx(alone)


def test_a_difference_with_an_outlier_is_not_hidden_by_others():
    """All 15 clusters agree, so that its own p is the smallest that there is; one is large, so that its t is not."""
    differences = np.random.default_rng(12).normal(size=(21, 15))
    differences[0] = [10.0] + [1.0] * 14
    t = np.abs(_signs(15) @ (differences / np.linalg.norm(differences, axis=1, keepdims=True)).T)
    assert (t.max(1) >= t[0, 0]).mean() > 0.2  # by the largest t of each flip
    assert family_p(differences[:1])[0] == 2.0**-14
    assert family_p(differences)[0] < 0.005


def test_with_few_clusters_equal_p_are_told_apart_by_t():
    """Each of nine comparisons has the smallest p, 1 / 128, at a flip of its own: together too many."""
    differences = np.random.default_rng(13).normal(size=(10, 8))
    differences[0] = np.linspace(1.0, 1.5, 8)
    assert family_p(differences)[0] < 0.02


def test_a_large_family_is_tested_within_two_seconds():
    differences = np.random.default_rng(15).normal(0.3, 1, size=(40, 60))
    started = time.process_time()
    family_p(differences)
    assert time.process_time() - started < 2


def test_a_hole_is_left_out_of_its_own_comparison_alone():
    differences = np.random.default_rng(10).normal(1, 1, size=(2, 8))
    holed = differences.copy()
    holed[1, 3:] = np.nan
    assert family_p(holed)[0] == family_p(differences[:1])[0]  # few clusters of another cost it nothing
    assert family_p(holed[1:]) == pytest.approx(family_p(differences[1:, :3]))


def test_more_clusters_than_signs_can_be_counted_give_the_same_p_every_time():
    differences = np.random.default_rng(11).normal(0.3, 1, size=(2, 24))
    first = family_p(differences)
    _signs.cache_clear()  # as in another process
    assert family_p(differences) == pytest.approx(first, abs=0)
