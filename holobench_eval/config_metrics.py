"""Whether a study's metrics and its headline can be computed, asked before anything else is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .errors import suggest
from .study.stacks import SCORES

if TYPE_CHECKING:
    from .config import Study
    from .metrics.base import Metric
    from .yaml_source import Document


def check_metrics(study: Study, document: Document) -> None:
    """Refuse unknown metrics, those whose weights are missing, and a headline that is of none of them."""
    from .metrics.catalogue import catalogue

    weights, wanted = study.protocol.lpips_weights, study.protocol.metrics
    known = {metric.name: metric for metric in catalogue(None if weights is None else Path(weights))}
    for index, name in enumerate(wanted or ()):
        if name not in (*known, "speckle_contrast"):
            message = f"unknown metric '{name}'; {suggest(name, [*known, 'speckle_contrast'])}"
            raise document.error(("protocol", "metrics", index), message)
        if name in known and (reason := known[name].available()):
            raise document.error(("protocol", "metrics", index), reason)
    if study.measure == "focus" and study.headline in SCORES:
        return
    columns = {f"{metric.name}_{domain}": metric for metric in known.values() for domain in metric.domains}
    if study.headline not in columns:
        choice = [*columns, *(SCORES if study.measure == "focus" else ())]
        raise document.error(("headline",), f"unknown metric '{study.headline}'; {suggest(study.headline, choice)}")
    metric = columns[study.headline]
    if wanted is not None and metric.name not in wanted:
        message = f"the headline is '{study.headline}'; add {metric.name} to the metrics, or set another 'headline'"
        raise document.error(("protocol", "metrics"), message)
    _check_computable(metric, study, document)


def _check_computable(metric: Metric, study: Study, document: Document) -> None:
    from .capture.grid import SMALLEST_REGION
    from .study.plan import displays

    if reason := metric.available():
        raise document.error(("headline",), f"the headline cannot be computed: {reason}")
    for place in displays(study).values() if metric.smallest > SMALLEST_REGION else ():
        height, width = place.spec.region.shape
        if min(height, width) < metric.smallest:
            message = f"'{place.name}' scores {height} x {width} pixels; {metric.name} needs {metric.smallest} a side"
            raise document.error(("headline",), message)
