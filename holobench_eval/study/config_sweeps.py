"""The sweeps of a config: changes of its displays at test time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..core.errors import suggest
from ..core.schema import placed
from ..core.yaml_source import Document, Keys

if TYPE_CHECKING:
    from .config import Study, Sweep


def sweep_of(study: Study, document: Document, index: int) -> Sweep:
    """A sweep of a config, its values and displays checked. UserError with the place of what is wrong."""
    from ..display.simulated.changes import KINDS, altered, checked
    from ..display.simulated.profile import load_profile

    sweep, where = study.sweeps[index], ("sweeps", index)
    if study.display.learned or study.display.real or study.measure != "picture":
        raise document.error(where, "a sweep changes simulated displays, and scores pictures (measure: picture)")
    if sweep.condition not in KINDS:
        near = suggest(sweep.condition, KINDS)
        raise document.error((*where, "condition"), f"unknown condition '{sweep.condition}'; {near}")
    if sweep.condition == "laser_power" and study.display.exposure == "matched":
        raise document.error(where, "exposure: matched undoes laser_power; leave one of the two out")
    countable = KINDS[sweep.condition].counted
    if bool(sweep.values) == (sweep.count is not None) or (sweep.count is not None and not countable):
        raise document.error(where, "a sweep has values; one of siblings or draws may have a count in their place")
    given = sweep.values or tuple(str(number) for number in range(1, (sweep.count or 0) + 1))
    profiles = subset(study, document, sweep.profiles, (*where, "profiles"))
    same = [other for other in study.sweeps[:index] if other.condition == sweep.condition]
    values = [value for other in same if set(other.profiles) & set(profiles) for value in other.values]
    known = len(values)
    loaded = [load_profile(profile, folder=study.folder) for profile in profiles]
    for number, value in enumerate(given):
        place: Keys = (*where, "values", number) if sweep.values else (*where, "count")
        with placed(document, place, place):
            values.append(checked(sweep.condition, value))
            for profile in loaded:
                altered(profile, sweep.condition, values[-1])
        if values[-1] in values[:-1]:
            raise document.error(place, f"{sweep.condition} {value} is listed twice")
    return replace(sweep, values=tuple(values[known:]), count=None, profiles=profiles)


def subset(study: Study, document: Document, named: tuple[str, ...], where: Keys) -> tuple[str, ...]:
    """The named displays of the study, in its order; all for none."""
    for number, profile in enumerate(named):
        if profile not in study.display.sources:
            message = f"'{profile}' is not in display.profiles; {suggest(profile, study.display.sources)}"
            raise document.error((*where, number), message)
    return tuple(p for p in study.display.sources if p in named or not named)
