"""A small made-up study: photographs degraded like captures, with scores, as record dicts and thumbnails."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from skimage import data, io, transform
from skimage.metrics import structural_similarity

from holobench_eval.core.hashing import digest
from holobench_eval.report import Facts, Results, records_frame
from holobench_eval.study.plan import FLOORS, REFERENCE, is_reference, reference_of
from holobench_eval.study.store import Store
from tests.support import made_facts

Image = NDArray[np.float64]
Record = dict[str, Any]

DISTORTION = {  # speckle contrast, blur [px], undiffracted light
    "Double phase": (0.15, 1.6, 0.30),
    "GS": (0.80, 0.6, 0.05),
    "Wirtinger": (0.45, 0.7, 0.06),
    "SGD": (0.40, 0.6, 0.05),
    "HIL": (0.25, 0.5, 0.02),
    "Oracle": (0.12, 0.3, 0.01),
}
SECONDS = {"Double phase": 0.02, "GS": 1.5, "Wirtinger": 9.0, "SGD": 8.0, "HIL": 11.0, "Oracle": 30.0}
NAMES = dict(zip(DISTORTION, ("double_phase", "gerchberg_saxton", "wirtinger", "sgd", "hil", "oracle"), strict=True))
SEVERITY = {"leto-aged": 1.0, "ideal": 0.5}
EIGHT = tuple(f"t{index}" for index in range(8))
NOISE = np.array([0.0, 0.3, -0.2, 0.1, 0.4, -0.1, 0.2, -0.3])
TARGETS = ("astronaut", "chelsea", "coffee", "rocket", "retina", "camera")


def facts(**changes: Any) -> Facts:
    given = {
        "title": "Made-up captures",
        "pairs": tuple((label, condition) for label in DISTORTION for condition in SEVERITY),
        "targets": TARGETS,
        "seed": 2020,
        "baseline": "Wirtinger",
        "privileged": frozenset({"Oracle"}),
        "reported": {"Wirtinger": {"psnr": 17.6, "ssim": 0.475}, "HIL": {"psnr": 20.5, "ssim": 0.625}},
        "reported_source": "Chakravarthula et al. 2020, Table 3",
    }
    return made_facts.facts(**(given | changes))


@cache
def photographs(size: int) -> dict[str, Image]:
    """Linear-light (size, size, 3) targets."""
    pictures = {}
    for name in TARGETS:
        picture = np.asarray(getattr(data, name)(), dtype=np.float64) / 255
        if picture.ndim == 2:
            picture = np.repeat(picture[..., None], 3, axis=2)
        side = min(picture.shape[:2])
        top, left = (picture.shape[0] - side) // 2, (picture.shape[1] - side) // 2
        square = picture[top : top + side, left : left + side, :3]
        pictures[name] = transform.resize(square, (size, size), anti_aliasing=True) ** 2.2
    return pictures


def capture(target: Image, method: str, severity: float, rng: np.random.Generator) -> Image:
    contrast, blur, leak = (severity * value for value in DISTORTION[method])
    grain = gaussian_filter(rng.normal(size=target.shape), (0.6, 0.6, 0))
    speckled = gaussian_filter(target, (blur, blur, 0)) * np.abs(1 + contrast * grain / grain.std()) + leak * 0.3
    return matched(speckled, target)


def matched(image: Image, target: Image) -> Image:
    scale = (image * target).sum((0, 1)) / np.maximum((image**2).sum((0, 1)), 1e-12)
    return np.clip(image * scale, 0, 1)


def floor(name: str, target: Image, wrong: Image, rng: np.random.Generator) -> Image:
    images = {
        "floor_constant": np.ones_like(target),
        "floor_black": np.zeros_like(target),
        "floor_speckle": rng.exponential(size=target.shape),
        "floor_wrong_target": wrong,
        "floor_mirrored": target[:, ::-1],
        "floor_shift_1px": np.roll(target, 1, axis=1),
    }
    return matched(images[name], target)


def psnr(image: Image, target: Image) -> float:
    return float(-10 * np.log10(np.mean((image - target) ** 2)))


def ssim(image: Image, target: Image) -> float:
    options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1}
    return float(structural_similarity(image, target, channel_axis=2, **options))


def scores(image: Image, target: Image) -> dict[str, float]:
    values = {}
    for domain, power in (("linear", 1.0), ("amplitude", 0.5), ("srgb", 1 / 2.2)):
        a, b = image**power, target**power
        values[f"psnr_{domain}"] = psnr(a, b)
    values["ssim_linear"] = ssim(image, target)
    for width in (0.5, 1):
        blurred = [gaussian_filter(side, (width, width, 0)) for side in (image, target)]
        values[f"psnr_linear_blur{width:g}"] = psnr(*blurred)
    values["psnr_linear_refined"] = values["psnr_linear"] + 0.02
    values["mofd_srgb"] = float(np.abs(image ** (1 / 2.2) - target ** (1 / 2.2)).mean())
    moved = {"refine_dx_px": 0.03, "refine_dy_px": -0.04, "refine_theta_deg": 0.0}
    return values | moved | {"efficiency": 0.4, "brightness_ratio": 0.9, "scale_0": 1.1}


def cell(method: str, target: str, condition: str, **changes: Any) -> dict[str, Any]:
    given = {
        "method": method,
        "params": {"iterations": 200} if method == "wirtinger" else {},
        "dataset": "photographs",
        "dataset_params": {"count": len(TARGETS)},
        "target": target,
        "target_sha256": "0" * 64,
        "profile": condition if condition != REFERENCE else "leto-aged",
        "profile_version": 1,
        "profile_sha256": "1" * 64,
        "panel": [256, 256],
        "condition": condition,
        "repeat": 0,
        "seed": 2020,
        "protocol": "v1",
        "exposure": "equal",
    }
    return given | changes


def record(label: str, described: dict[str, Any], values: dict[str, float], **changes: Any) -> Record:
    given = {
        "id": digest(described),
        "cell": described,
        "state": "done",
        "reason": "",
        "label": label,
        "scores": values,
        "captures": 50 if label == "HIL" else 0,
        "seconds": SECONDS.get(label),
        "registration_residual_px": None if described["condition"] == REFERENCE else 0.07,
        "saturated": None if described["condition"] == REFERENCE else 0.0002,
    }
    return given | changes


def results(records: list[Record], **changes: Any) -> Results:
    """The numbers of some records, whose facts are theirs but for the changes."""
    cells = [(found["label"], found["cell"]) for found in records]
    pairs = dict.fromkeys((label, cell["condition"]) for label, cell in cells if not is_reference(cell["condition"]))
    targets = dict.fromkeys(cell["target"] for _, cell in cells)
    given = {"pairs": tuple(pairs), "targets": tuple(targets), "privileged": frozenset(), "reported": {}}
    made = facts(**(given | changes))
    return Results(records_frame(records, made), made)


def results_of(
    means: dict[str, float],
    names: dict[str, str] | None = None,
    captures: dict[str, int] | None = None,
    noise: Callable[[str], np.ndarray] = lambda label: NOISE,
    **changes: Any,
) -> Results:
    """A study of one display, or of the display after ``@`` in a label; names: registered; captures: per target."""
    records, pairs = [], []
    for key, mean in means.items():
        label, _, display = key.partition("@")
        condition = display or "bench"
        if label.startswith("floor_"):
            condition = reference_of(display) if display else REFERENCE
        if not is_reference(condition):
            pairs.append((label, condition))
        for target, value in zip(EIGHT, mean + noise(label), strict=True):
            described = cell((names or {}).get(label, label), target, condition, params={"label": label})
            taken = (captures or {}).get(label, 0)
            records.append(record(label, described, {"psnr_linear": float(value)}, captures=taken))
    given = {"pairs": tuple(pairs), "targets": EIGHT, "baseline": "old", "privileged": frozenset({"oracle"})}
    return results(records, **(given | changes))


def save_picture(path: Path, linear: Image) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    encoded = np.round(np.clip(linear, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
    io.imsave(path, encoded, check_contrast=False)


def study(output: Path, size: int = 48, targets: tuple[str, ...] = TARGETS) -> list[Record]:
    """Records of the whole grid, with one failed cell (GS, coffee, leto-aged); thumbnails under ``output``."""
    store, pictures, rng = Store(output), photographs(size), np.random.default_rng(0)
    records = []
    for index, name in enumerate(targets):
        target, wrong = pictures[name], pictures[targets[(index + 1) % len(targets)]]
        save_picture(store.target_thumbnail(name), target)
        for reference in FLOORS:
            image = floor(reference, target, wrong, rng)
            records.append(record(reference, cell(reference, name, REFERENCE), scores(image, target)))
        for label in DISTORTION:
            for condition, severity in SEVERITY.items():
                described = cell(NAMES[label], name, condition)
                if (label, name, condition) == ("GS", "coffee", "leto-aged"):
                    reason = "registration residual 1.32 px is above the bound of 0.30 px"
                    records.append(record(label, described, {}, state="failed", reason=reason))
                    continue
                image = capture(target, label, severity, rng)
                save_picture(store.thumbnail(digest(described)), image)
                records.append(record(label, described, scores(image, target)))
    return records
