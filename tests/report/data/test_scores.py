from holobench_eval.report.data.scores import order_scores, parse
from holobench_eval.report.data.statistics import Estimate


def test_a_key_is_read_as_metric_domain_and_variant():
    score = parse("ms_ssim_amplitude")
    assert (score.metric, score.domain, score.variant) == ("ms_ssim", "amplitude", "")
    assert parse("psnr_linear_refined").variant == "refined"
    assert parse("speckle_contrast").domain == ""
    widths = {"psnr_linear_blur0.5": 0.5, "ssim_linear_blur1": 1.0, "psnr_linear": None}
    assert {key: parse(key).blur for key in widths} == widths


def test_distances_are_better_when_lower_and_similarities_when_higher():
    for key in ("mofd_srgb", "gmsd_srgb", "lpips_alex_srgb", "flip_srgb", "speckle_contrast"):
        assert parse(key).better(0.1, 0.2), key
    assert parse("psnr_linear").better(20.0, 17.0)
    assert parse("ssim_linear_blur1").better(0.6, 0.5)


def test_values_carry_unit_and_digits_of_their_metric():
    assert parse("psnr_linear").with_unit(17.618) == "17.62 dB"
    assert parse("psnr_linear").with_unit(1.2, signed=True) == "+1.20 dB"
    assert parse("ssim_linear").estimate(Estimate(0.4751, 0.41, 0.52, 8, 8)) == "0.475 [0.410, 0.520]"
    assert parse("ssim_linear").estimate(Estimate(0.4751, float("nan"), float("nan"), 2, 2)) == "0.475"
    assert parse("psnr_linear").number(float("nan")) == "–"
    assert parse("psnr_linear").number(-0.0001, signed=True) == "+0.00"


def test_plain_metrics_come_before_variants_and_descriptions():
    keys = ["efficiency", "psnr_linear_blur1", "ssim_linear", "psnr_srgb", "psnr_linear", "mofd_srgb"]
    ordered = order_scores(keys)
    assert ordered == ["psnr_linear", "psnr_srgb", "ssim_linear", "mofd_srgb", "psnr_linear_blur1", "efficiency"]
    assert order_scores(reversed(keys)) == ordered
