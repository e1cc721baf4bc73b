import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from holobench_eval.report.data.statistics import _resamples, bootstrap_mean, holm, paired_test, wilcoxon


def test_intervals_cover_the_true_mean_about_as_often_as_they_say():
    rng = np.random.default_rng(1)
    samples = rng.normal(17, 3, size=(400, 8))
    estimates = [bootstrap_mean(sample) for sample in samples]
    coverage = np.mean([estimate.low <= 17 <= estimate.high for estimate in estimates])
    assert 0.91 <= coverage <= 0.985


def test_an_interval_is_the_same_every_time():
    values = np.random.default_rng(2).normal(size=9)
    estimate = bootstrap_mean(values)
    _resamples.cache_clear()  # as in another process
    assert bootstrap_mean(values) == estimate


def test_an_interval_of_equal_values_has_no_width():
    estimate = bootstrap_mean([0.5] * 6)
    assert (estimate.low, estimate.mean, estimate.high) == (0.5, 0.5, 0.5)


@pytest.mark.parametrize("values", [[], [17.0], [17.0, 19.0]])
def test_below_three_targets_there_is_no_interval(values):
    estimate = bootstrap_mean(values)
    assert estimate.n == len(values)
    assert np.isnan(estimate.low)
    assert np.isnan(estimate.high)


@given(st.lists(st.integers(-1000, 1000).filter(bool), min_size=3, max_size=12, unique_by=abs))
def test_wilcoxon_without_ties_equals_the_exact_test_of_scipy(values):
    assert wilcoxon(values) == pytest.approx(stats.wilcoxon(values, method="exact").pvalue)


@pytest.mark.parametrize("values", [[1, 1, -1, 2, 2, 3], [0, 0, 1, 2, 2, -2], [0.5, 0.5, 0.5, 0.5], [3, -3, 1, -1]])
def test_wilcoxon_with_ties_and_zeros_equals_a_count_over_all_signs(values):
    known = np.array([value for value in values if value])
    ranks = stats.rankdata(np.abs(known))
    sums = np.array([ranks @ np.array(signs) for signs in itertools.product((0, 1), repeat=known.size)])
    observed = ranks[known > 0].sum()
    expected = min(1.0, 2 * min(np.mean(sums <= observed), np.mean(sums >= observed)))
    assert wilcoxon(values) == pytest.approx(expected)


def test_wilcoxon_of_no_difference_is_one():
    assert wilcoxon([0.0, 0.0, 0.0]) == 1.0


def test_differences_that_binary_subtraction_makes_unequal_stay_tied():
    assert wilcoxon([0.3 - 0.2, 0.2 - 0.1, 0.1 - 0.2, 5.0]) == wilcoxon([0.1, 0.1, -0.1, 5.0])


def test_holm_equals_a_computation_by_hand():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_holm_does_not_count_tests_that_were_not_made():
    corrected = holm([0.01, float("nan"), 0.02])
    assert corrected[0] == pytest.approx(0.02)
    assert np.isnan(corrected[1])
    assert corrected[2] == pytest.approx(0.02)


def test_holm_never_exceeds_one():
    assert holm([0.9, 0.8]) == [1.0, 1.0]


def test_pairs_with_a_hole_are_left_out_and_counted():
    first, second = np.array([1.0, 2.0, 3.0, np.nan, 5.0]), np.array([2.0, 3.0, 4.0, 9.0, np.nan])
    test = paired_test("bench", "a", "b", (first, second))
    assert (test.complete, test.targets) == (3, 5)
    assert test.difference.mean == 1.0
    assert test.p == pytest.approx(0.25)


def test_two_pairs_give_a_difference_and_no_test():
    test = paired_test("bench", "a", "b", (np.array([1.0, 2.0]), np.array([2.0, 4.0])))
    assert test.difference.mean == 1.5
    assert np.isnan(test.p)
