"""A made-up study of capture budgets: twelve methods of every track on two displays, as records without pictures."""

from typing import Any

import numpy as np

from holobench_eval.report import Facts, Results, records_frame
from tests.support import made_facts
from tests.support import synthetic_study as synthetic

ROWS: dict[str, tuple[str, float, int, int, float]] = {
    # label: registered name, gain over Wirtinger [dB], captures of the training, captures per target, seconds
    "double_phase": ("double_phase", -7.0, 0, 0, 0.02),
    "gerchberg_saxton": ("gerchberg_saxton", -0.8, 0, 0, 0.9),
    "wirtinger": ("wirtinger", 0.0, 0, 0, 4.0),
    "sgd": ("sgd", 0.1, 0, 0, 3.5),
    "hil": ("hil", 2.1, 132, 0, 9.0),
    "parametric_model (16 captures)": ("parametric_model", 6.0, 16, 0, 6.0),
    "parametric_model (64 captures)": ("parametric_model", 9.3, 64, 0, 6.1),
    "learned_kernel": ("learned_kernel", 3.0, 64, 0, 4.5),
    "online_camera (25 captures)": ("online_camera", 1.4, 0, 25, 1.5),
    "online_camera (100 captures)": ("online_camera", 2.7, 0, 100, 6.0),
    "online_camera_network": ("online_camera_network", 3.4, 64, 50, 12.0),
    "oracle": ("oracle", 10.8, 0, 0, 31.0),
}
TARGETS = synthetic.TARGETS
SEVERITY = {"leto-aged": 1.0, "ideal": 0.25}


def facts(**changes: Any) -> Facts:
    """The facts of the study."""
    given = {
        "title": "Made-up budgets",
        "pairs": tuple((label, condition) for label in ROWS for condition in SEVERITY),
        "targets": TARGETS,
        "baseline": "wirtinger",
        "privileged": frozenset({"oracle"}),
        "camera": frozenset(label for label in ROWS if label.startswith("online")),
        "trained": frozenset(label for label, row in ROWS.items() if row[2]),
    }
    return made_facts.facts(**(given | changes))


def record(label: str, target: str, condition: str, quality: float, **changes: Any) -> synthetic.Record:
    """A done record of a row."""
    name, _, training, captures, seconds = ROWS[label]
    learned = {"sha256": f"{label:.4}", "captures": training, "seconds": 60.0 * training} if training else None
    given = {"captures": captures, "seconds": seconds, "learned": learned, "memory_mib": 10.0 + captures}
    described = synthetic.cell(name, target, condition, params={"row": label})
    return synthetic.record(label, described, {"psnr_linear": quality}, **(given | changes))


def study() -> list[synthetic.Record]:
    """A record for every row and target: targets differ by several dB, methods by the gains above."""
    rng, records = np.random.default_rng(5), []
    level = dict(zip(TARGETS, rng.normal(18, 3, len(TARGETS)), strict=True))
    for label, (_, gain, *_) in ROWS.items():
        for condition, severity in SEVERITY.items():
            for target in TARGETS:
                noise = rng.normal(0, 0.5 * abs(gain) ** 0.5)
                records.append(record(label, target, condition, level[target] + severity * (gain + noise)))
    return records


def results(**changes: Any) -> Results:
    """The numbers of the study; changes: of its facts."""
    return Results(records_frame(study(), facts(**changes)), facts(**changes))
