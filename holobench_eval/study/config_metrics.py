"""Whether a study's metrics are known and its headline is of one of them, asked before anything is computed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.errors import suggest
from .focal_stacks import SCORES

if TYPE_CHECKING:
    from ..core.yaml_source import Document
    from ..metrics.base import Metric
    from .config import Study


def check_metrics(study: Study, document: Document) -> None:
    """Refuse unknown metrics, a headline that is of none of them, and one that needs a larger window.

    Weights that are missing here are no fault of the study: see ``study.available``.
    """
    from ..metrics.catalogue import catalogue

    wanted, known = study.protocol.metrics, {metric.name: metric for metric in catalogue()}
    for index, name in enumerate(wanted or ()):
        if name not in (*known, "speckle_contrast"):
            message = f"unknown metric '{name}'; {suggest(name, [*known, 'speckle_contrast'])}"
            raise document.error(("protocol", "metrics", index), message)
    if study.measure == "focus" and study.headline in SCORES:
        return
    columns = {column: metric for metric in known.values() for column in metric.columns}
    if study.headline not in columns:
        choice = [*columns, *(SCORES if study.measure == "focus" else ())]
        raise document.error(("headline",), f"unknown metric '{study.headline}'; {suggest(study.headline, choice)}")
    metric = columns[study.headline]
    if wanted is not None and metric.name not in wanted:
        message = f"the headline is '{study.headline}'; add {metric.name} to the metrics, or set another 'headline'"
        raise document.error(("protocol", "metrics"), message)
    _check_window(metric, study, document)


def _check_window(metric: Metric, study: Study, document: Document) -> None:
    from ..imaging.grid import SMALLEST_REGION
    from .plan import displays

    for place in displays(study).values() if metric.smallest > SMALLEST_REGION else ():
        height, width = place.spec.region.shape
        if min(height, width) < metric.smallest:
            message = f"'{place.name}' scores {height} x {width} pixels; {metric.name} needs {metric.smallest} a side"
            raise document.error(("headline",), message)
