"""The three names of a number: its phase, its capture and its score.

- A **phase** is what a method found for a target. Its name holds the method's code and parameters, the digest of the
  target, the nominal optics, what the random numbers depend on, what the method learned and every external file that it
  reads. The display is in it only where the method sees the display: with a camera, or by privilege.
- A **capture** is a phase on a display, under a condition, in a repeat, at an exposure, through the bench, the
  registration and the camera of one version of this package (``HARNESS``).
- A **score** is what one metric of one version makes of a capture, by one version of the protocol.

Each name is the SHA-256 of a plain description. So a metric, which stands in no other name, costs a column and never a
capture, and one phase serves every display that a method cannot tell from another. What a machine happens to have, such
as weights of a metric, is in the name of nothing that does not use it.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from ..core.hashing import canonical, file_digest
from ..display import DisplaySpec
from ..metrics import catalogue, control
from ..metrics.lpips import find_weights
from ..metrics.protocol import VERSION as PROTOCOL
from ..metrics.speckle import VERSION as SPECKLE_VERSION
from .definition import Study
from .displays import Condition
from .stacks import INFOCUS
from .stacks import VERSION as INFOCUS_VERSION
from .versions import GIVEN, GIVEN_GRAY, HARNESS, PHOTOGRAPHS

Plain = dict[str, Any]
BASIS = ("given", "target", "optics", "draw")  # entries of a phase that are not of its method
# Nominal optics that came later: a display without them keeps its names.
LATER = {"levels": (), "frames": 1, "spectrum": (), "plane": "fresnel"}
SPECKLE = "speckle_contrast"
# What the protocol gives beside its metrics: the match of a capture with its target, and the move that refines both.
MATCH, REFINED = "match", "refine"
REPEATED = ("psnr", "ssim")  # the metrics for which a capture is refined


def phase(
    code: str,
    params: Mapping[str, Any],
    target: Mapping[str, Any],
    spec: DisplaySpec,
    draw: tuple[object, ...],
    **further: Any,
) -> Plain:
    """The description of a phase.

    Parameters
    ----------
    code
        The method's version, see ``versions.method_version``.
    params
        All of the method's parameters.
    target
        Its dataset, the parameters of that, and the digest of the source image.
    spec
        Nominal optics; their name does not count.
    draw
        What random numbers depend on: of a solution the study's seed, the target's name and the repeat.
    **further
        What only some methods depend on, such as what they learned; what is empty or None is left out.
    """
    return as_json({**basis(target, spec, draw), "code": code, "params": dict(params), **_filled(further)})


def basis(target: Mapping[str, Any], spec: DisplaySpec, draw: tuple[object, ...]) -> Plain:
    """The entries of a phase that are not of its method, see ``phase``."""
    told = asdict(spec)
    optics = {name: told[name] for name in told if name != "name" and (name not in LATER or told[name] != LATER[name])}
    given = GIVEN if len(spec.wavelengths) > 1 else GIVEN_GRAY
    return as_json({"given": given, "target": dict(target), "optics": optics, "draw": list(draw)})


def display(shown_on: Condition) -> Plain:
    """The description of a display: a profile or a bench file at a version, its panel, and what has changed on it."""
    plain = {"name": shown_on.name, "version": shown_on.version, "sha256": shown_on.digest}
    further = {
        "change": list(shown_on.change or ()),
        "learned": shown_on.learned.id if shown_on.learned else "",
        "session": shown_on.real.session if shown_on.real else "",
    }
    return {**plain, "panel": list(shown_on.spec.shape), **_filled(further)}


def seen(by: Condition) -> Plain:
    """The description of a display as a method sees it that captures on it: a simulated one is also its code."""
    return display(by) | ({} if by.real else {"harness": HARNESS})


def capture(of: Mapping[str, Any], shown_on: Condition | None, **further: Any) -> Plain:
    """The description of a capture.

    Parameters
    ----------
    of
        The description of its phase; of a floor image, what it is made of.
    shown_on
        The display, None for a floor image, which needs none.
    **further
        Exposure, measure and what else it depends on; what is empty or None is left out.
    """
    real = shown_on is not None and shown_on.real is not None
    plain = {"phase": dict(of), "harness": f"{HARNESS}; {PHOTOGRAPHS}" if real else HARNESS}
    return as_json(plain | _filled({"display": shown_on and display(shown_on), **further}))


def as_json(description: Plain) -> Plain:
    """The same as it is read from a file, with lists in the place of tuples."""
    read: Plain = json.loads(canonical(description))
    return read


def _filled(entries: Mapping[str, Any]) -> Plain:
    return {name: value for name, value in entries.items() if value not in (None, "", (), [], {})}


def scores_of(study: Study) -> dict[str, str]:
    """The version of every metric that a study scores by, by its name.

    A study that names none gets all that can be computed here, and the headline's: weights of LPIPS may come later.
    Control, which takes captures of its own, has to be named.
    """
    weights, wanted = study.protocol.lpips_weights, study.protocol.metrics
    path = None if weights is None else Path(weights)
    metrics = catalogue(path)
    if wanted is None:
        here = [metric.name for metric in metrics if metric.available() is None or study.headline in metric.columns]
        wanted = (*here, SPECKLE)
    names = [*wanted, MATCH, *([INFOCUS] if study.measure == "focus" else [])]
    names += [REFINED] * any(name in REPEATED for name in wanted)
    return versions_of(names, path)


def versions_of(names: Collection[str], weights: Path | None = None) -> dict[str, str]:
    """The versions of scores, with the digest of their weights where they take any from a file.

    weights: file or folder of the LPIPS trunk, by default torch's hub cache.
    """
    files = {f"lpips_{network}": find_weights(network, weights) for network in ("alex", "vgg")}
    digests = {name: f"; {file_digest(file)[:12]}" for name, file in files.items() if file}
    return {name: f"{version}{digests.get(name, '')}" for name, version in versions().items() if name in names}


@cache
def versions() -> dict[str, str]:
    """The version of every score: of the protocol, and of the metric."""
    known = {metric.name: metric.version for metric in catalogue()}
    known |= {SPECKLE: SPECKLE_VERSION, INFOCUS: INFOCUS_VERSION, control.NAME: control.VERSION}
    return {name: f"{PROTOCOL}, {version}" for name, version in known.items()} | {MATCH: PROTOCOL, REFINED: PROTOCOL}


def grouped(columns: Mapping[str, float], metrics: Mapping[str, str]) -> dict[str, Any]:
    """What ``metrics.score`` gives, by metric: its version, and its values by column.

    metrics: versions by name, of those that were computed; one without values found nothing in the capture to measure.
    """
    names = sorted(versions(), key=len, reverse=True)
    if "scale_1" not in columns:  # of gray pictures
        columns = {"match_factor" if name == "scale_0" else name: value for name, value in columns.items()}
    by_name: dict[str, Plain] = {name: {"version": version, "values": {}} for name, version in metrics.items()}
    for column, value in columns.items():
        of = (name for name in names if column == name or column.startswith(f"{name}_"))
        owner = INFOCUS if column.endswith(f"_{INFOCUS}") else next(of, MATCH)
        if owner in by_name:
            by_name[owner]["values"][column] = value
    return by_name


def lacking(scores: Mapping[str, Any], metrics: Mapping[str, str]) -> dict[str, str]:
    """Those of the metrics, with their versions, that the scores of a capture lack or have of another version."""
    return {name: version for name, version in metrics.items() if scores.get(name, {}).get("version") != version}


def flat(scores: Mapping[str, Any]) -> dict[str, float]:
    """The values of scores by column, without those of another version of a metric than today's."""
    current = (entry["values"] for name, entry in scores.items() if is_current(name, entry["version"]))
    return {column: value for values in current for column, value in values.items()}


def is_current(name: str, version: str) -> bool:
    """Whether a version of a metric is today's, with whatever weights."""
    return version.partition(";")[0] == versions().get(name)


def parted(version: str) -> tuple[str, str]:
    """The versions of the protocol and of the metric that are in that of a score; of the match the second is empty."""
    protocol, _, metric = version.partition(";")[0].partition(", ")
    return protocol, metric


def named(metrics: Collection[str]) -> list[str]:
    """The names that ``metrics.score`` has to be given for scores by these names."""
    own = [name for name in metrics if name not in (MATCH, REFINED, INFOCUS, control.NAME)]
    return own if REFINED not in metrics or set(own) & set(REPEATED) else [*own, REPEATED[0]]
