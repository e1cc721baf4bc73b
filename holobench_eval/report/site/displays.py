"""The displays of the site: which of two folders that use one name mean the same, and what is known of each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

from ...core.hashing import digest as digest_of
from ...display.simulated.profile import STAGES, Profile, load_profile, names
from ..data.text import FILES
from .intake import Source

DIGITS = 8  # of a digest, in a name
PLACE = {"real": "photographed", "learned": "learned"}  # what stands in the place of a profile, in a name
# What a profile says of where a value comes from.
ASSUMED, DRAWN, FITTED, STATED, UNSAID = "assumed", "drawn", "fitted", "stated", "not said"

_COUNTS = {"one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "six": 6}
_NEXT = re.compile(rf"as the next(?: ({'|'.join(_COUNTS)}))?")
_LINE = re.compile(r"^(?P<indent> *)(?P<key>\w+):(?P<value>[^#]*)(?:# *(?P<comment>.*))?$")


@dataclass(frozen=True)
class Display:
    """A display of the site.

    title: its name, with what tells it from another of the same name; name: in its reports; digest: of its profile or
    bench file, of photographs that of whose they are and how they came about (empty: none); kind: ``simulated``,
    ``real``, ``learned`` (a trained network in its place) or ``files``; profile: that of the package, where it is one;
    is_other: whether it has the name of a profile of the package, and another digest.
    """

    title: str
    name: str
    digest: str
    kind: str
    profile: Profile | None = None
    is_other: bool = False

    @property
    def marked(self) -> str:
        """The title with what must be known of it."""
        return {
            "simulated": self.title,
            "real": f"{self.title}, real",
            "learned": f"{self.title}, a trained network",
            FILES: self.title,
        }[self.kind]


def display_of(source: Source, name: str, others: Mapping[str, set[str]]) -> Display:
    """The display that a source calls by a name. others: every digest that a name has, over all sources."""
    if source.measure == FILES:
        digest = digest_of({"by": source.by, "known": source.known})
        return Display(f"{name} ({source.name} {digest[:DIGITS]})", name, digest, FILES)
    digest = str(dict(source.known.get("profiles", {})).get(name, {}).get("sha256", ""))
    kind = dict(source.known.get("displays", {})).get(name) or _kind(name, digest)
    shipped = _shipped().get(name)
    if shipped is not None and kind != "simulated":  # a study may name a profile for the optics of a real panel
        return Display(f"{name} {PLACE[kind]} ({digest[:DIGITS]})", name, digest, kind)
    if shipped is not None and shipped.digest == digest:
        return Display(name, name, digest, kind, shipped)
    if shipped is not None:
        return Display(f"{name} (other {digest[:DIGITS]})", name, digest, kind, is_other=True)
    alone = len(others.get(name, ())) < 2
    return Display(name if alone else f"{name} ({digest[:DIGITS]})", name, digest, kind)


def digests(sources: Sequence[Source]) -> dict[str, set[str]]:
    """Every digest that a name of a display has."""
    found: dict[str, set[str]] = {}
    for source in sources:
        for name, profile in dict(source.known.get("profiles") or {}).items():
            found.setdefault(name, set()).add(profile["sha256"])
    return found


def _kind(name: str, digest: str) -> str:
    """The kind of a display of a report that does not say it: a network has the digest of what it was trained on."""
    if name not in _shipped() and any(profile.digest == digest for profile in _shipped().values()):
        return "learned"
    return "simulated"


@lru_cache(maxsize=1)
def _shipped() -> dict[str, Profile]:
    return {name: load_profile(name) for name in names()}


@dataclass(frozen=True)
class Parameter:
    """A line of a profile: stage (empty: none), key, value, what the file says of it, and the basis that this names."""

    stage: str
    key: str
    value: str
    source: str
    basis: str


def stage_title(key: str) -> str:
    """What a stage is called, by its key in a profile."""
    return STAGES[key].title if key in STAGES else key.replace("_", " ")


def parameters(name: str) -> list[Parameter]:
    """Every parameter of a profile of the package, with the comment beside it, in the order of the file."""
    text = (files("holobench_eval.display.simulated") / "profiles" / f"{name}.yaml").read_text(encoding="utf-8")
    return list(_parameters(text))


def _parameters(text: str) -> Iterator[Parameter]:
    stage, above, left, block = "", "", 0, ""
    for line in text.splitlines():
        match = _LINE.match(line)
        if match is None:
            above = line.strip().removeprefix("#").strip() if line.startswith(" ") else ""
            continue
        key, value, comment = match["key"], match["value"].strip(), match["comment"] or above
        if not match["indent"]:
            stage = key if key in STAGES or key == "panel" else ""
            block = "" if value else comment
        comment = comment or (block if "assumed" in block else "")
        assumed = "assumed" in comment or "assumed" in block or left > 0
        following = _NEXT.search(comment)
        left = _COUNTS[following[1] or "one"] if following else max(left - 1, 0)
        above = ""
        if value and key not in ("name", "description", "version", "seed", "like"):
            stated = STATED if comment else UNSAID
            marked = FITTED if "CALIBRATED" in comment else DRAWN if "DRAWN" in comment else None
            basis = marked or (ASSUMED if assumed else stated)
            yield Parameter(stage, key, value, comment, basis)


def counted(found: Sequence[Parameter]) -> dict[str, int]:
    """How many parameters are of each basis, by the words of the file."""
    return {basis: sum(each.basis == basis for each in found) for basis in (FITTED, DRAWN, ASSUMED, STATED, UNSAID)}


def ancestors(profile: Profile) -> list[str]:
    """Names of the profiles whose values hold where this one gives none, nearest first."""
    found: list[str] = []
    like = profile.like
    while like and like in _shipped():
        found.append(like)
        like = _shipped()[like].like
    return found
