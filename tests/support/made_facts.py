"""Facts of made-up studies, from a few words about their rows."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from holobench_eval.report.facts import CALIBRATED, GIVEN, ONLINE, OPEN_LOOP, ORACLE, Facts
from holobench_eval.study.definition import DisplayGrid, MethodEntry, Probe, Protocol, Reported, Study, Targets

KEYS = ("title", "measure", "headline", "baseline", "question", "would_change", "note", "seed")  # of the study


def facts(
    pairs: Iterable[tuple[str, str]] = (),
    targets: Iterable[str] = (),
    *,
    study: str = "",
    privileged: Iterable[str] = (),
    camera: Iterable[str] = (),
    trained: Iterable[str] = (),
    blind: Iterable[str] = (),
    identities: Iterable[str] = (),
    stacked: Iterable[str] = (),
    titles: Mapping[str, str] | None = None,
    tuned: Mapping[str, str] | None = None,
    params: Mapping[str, Mapping[str, Any]] | None = None,
    limits: Mapping[str, int] | None = None,
    reported: Mapping[str, Mapping[str, float]] | None = None,
    reported_source: str = "",
    planes: Mapping[str, tuple[str, float]] | None = None,
    clusters: Mapping[str, str] | None = None,
    panels: Mapping[str, tuple[int, int]] | None = None,
    shapes: Mapping[str, tuple[int, int, int]] | None = None,
    real: bool = False,
    values: str = "",
    metrics: tuple[str, ...] | None = None,
    holograms: str = "wirtinger",
    **more: Any,
) -> Facts:
    """Facts of methods by (label, condition) and of targets by name; ``more`` are of the study or of ``Facts``."""
    pairs, targets = tuple(pairs), tuple(targets)
    labels = list(dict.fromkeys(label for label, _ in pairs))
    given = {"title": "A study", "baseline": ""} | {key: more.pop(key) for key in KEYS if key in more}
    described = Study(
        display=DisplayGrid(bench="bench.yaml" if real else None),
        targets=Targets("made", {"values": values}, targets),
        methods=tuple(MethodEntry(label, label) for label in labels),
        holograms=Probe(holograms),
        protocol=Protocol(metrics=metrics),
        reported=Reported(reported_source, reported) if reported else None,
        file=Path(f"{study}.yaml") if study else Path(),
        **(given | {"baseline": given["baseline"] or ""}),
    )
    is_blind, groups = {*blind}, {ORACLE: {*privileged}, ONLINE: {*camera}, CALIBRATED: {*trained} - {*blind}}
    other = GIVEN if given.get("measure") == "files" else OPEN_LOOP
    rows = {
        label: {
            "method": label,
            "title": (titles or {}).get(label, ""),
            "params": (params or {}).get(label, {}),
            "category": next((name for name, members in groups.items() if label in members), other),
            "trained": label in {*trained},
            "blind": label in is_blind,
            "identity": label in {*identities},
            "stacked": label in {*stacked},
            "tuned": (tuned or {}).get(label),
            "limit": (limits or {}).get(label, math.nan),
        }
        for label in labels
    }
    shown = {
        name: {"panel": (panels or {}).get(name), "shape": (shapes or {}).get(name, ())}
        for name in {**(panels or {}), **(shapes or {})}
    }
    places = [((clusters or {}).get(name, name), *(planes or {}).get(name, ("", math.nan))) for name in targets]
    return Facts(
        described,
        pd.DataFrame.from_dict(rows, "index")
        if rows
        else pd.DataFrame(columns=["category", "trained", "blind", "identity", "stacked", "tuned"]),
        pd.DataFrame.from_dict(shown, "index"),
        pd.DataFrame(places, columns=["cluster", "scene", "place"], index=list(targets)),
        pairs,
        **more,
    )
