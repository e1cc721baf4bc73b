"""The displays that the paper's could have been: draws from assumed ranges, and those whose captures have its figures.

    python reports/family/draws.py 2000 --workers 2    # an hour on two cores; a stopped one goes on with the same words

The folder ``draws`` beside this file gets a row of every draw (``draws.csv``), ``report.md`` with its picture, and the
profiles that are kept (``displays``), which ship with the package once they are copied to its profiles. It is
approximate Bayesian computation by rejection (Pritchard et al. 1999, Mol. Biol. Evol. 16, 1791).
"""

from __future__ import annotations

import hashlib
import json
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from functools import cache, partial, reduce
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import torch
import typer
import yaml
from matplotlib.figure import Figure

from holobench_eval.core import plugins
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.core.seeds import generator, seed
from holobench_eval.display import Profile, load_profile
from holobench_eval.display.simulated.origins import RANGES, load_family, parameters, value_of
from holobench_eval.metrics import score
from holobench_eval.report.markdown import Markdown, blocks, bullets, code, heading, table_of
from holobench_eval.study.opening import open_bench
from holobench_eval.study.versions import HARNESS, dataset_version, method_version

NAME = "leto-2020"
FOLDER = Path(__file__).parent / "draws"
METRICS, SCORED = ("psnr", "ssim"), ("psnr_linear", "psnr_srgb", "ssim_linear", "ssim_srgb")
QUANTILES = (0.05, 0.5, 0.95)
DARK, PALE = "#1F4E8C", "#BBBBBB"
DIGITS, DRAWN = 4, 6  # of a drawn value; parameters of the picture
NARROW, WIDE = 0.7, 0.9  # of a parameter's range: determined, and not
CUT = 0.1  # of its range: a quantile so near to an end is that of the range, and not of the figures
READINGS: dict[str, dict[str, Any]] = {
    "in linear light, PSNR and SSIM": {},
    "tolerances half as wide": {"factor": 0.5},
    "tolerances twice as wide": {"factor": 2.0},
    "PSNR alone": {"metrics": ("psnr",)},
    "of sRGB values, PSNR and SSIM": {"domain": "srgb"},
    "of sRGB values, PSNR alone": {"domain": "srgb", "metrics": ("psnr",)},
}
"""Ways to read the published figures. The first decides. The paper compares gamma-corrected targets with a linear
sensor, and says not in which of the two its figures were computed."""
Family = Mapping[str, Any]


def drawn(family: Family, index: int) -> dict[str, Any]:
    """The row of a draw by its number, without scores: the same for the same family."""
    random = generator("family", family["base"], family["seed"], index)

    def share() -> float:
        return float(torch.rand((), generator=random, dtype=torch.float64))

    geometry, outside = int(share() * len(family["geometries"])), int(share() < family["outside"]["share"])
    row: dict[str, Any] = {"draw": index, "geometry": geometry, "outside": outside}
    for given in family["parameters"] + family["outside"]["parameters"] * outside:
        row[given["name"]] = float(f"{given['low'] + (given['high'] - given['low']) * share():.{DIGITS}g}")
    return row


def text_of(family: Family, row: Mapping[str, Any], name: str) -> str:
    """The profile of a draw under a name; its patterns are its own."""
    words = ", with effects that no method's model has" if row["outside"] else ""
    document = {"like": family["base"], "name": name, "version": 1}
    document["seed"] = seed("patterns of a draw", family["seed"], int(row["draw"])) % 10**6
    document["description"] = f"A display that the paper's could have been{words}."
    own = {each["name"]: row[each["name"]] for each in parameters(family) if not pd.isna(row.get(each["name"]))}
    for key, value in {**family["geometries"][int(row["geometry"])], **own}.items():
        *holders, last = key.split(".")
        old = value_of(load_profile(family["base"]), key)
        if isinstance(old, tuple) and not isinstance(value, list):  # a number stands for all colours
            value = [value] * len(old)
        holder = reduce(lambda holder, part: holder.setdefault(part, {}), holders, document)
        holder[last] = round(value) if isinstance(old, int) else value
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)


def profile_of(text: str) -> Profile:
    """The profile in a text."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "profile.yaml")
        path.write_text(text, encoding="utf-8")
        return load_profile(str(path))


@cache
def holograms(name: str, geometry: int) -> list[tuple[str, torch.Tensor, dict[str, torch.Tensor]]]:
    """Every image and its holograms by method, which depend on nothing that is drawn but the geometry."""
    family = load_family(name)
    text = text_of(family, {"draw": 0, "outside": 0, "geometry": geometry}, family["base"])
    bench = open_bench(profile_of(text), tuple(family["panel"]), family["seed"])
    dataset, rows = plugins.build("datasets", family["targets"]["dataset"], family["targets"]["params"]), []
    for item in dataset.items():
        target, phases = dataset.load(item, bench.spec.region.shape), {}
        for label in family["figures"]:
            method = plugins.build("methods", label, {})
            phases[label] = method.solve(target[None], bench.for_method(method, label, target, item, 0))[0]
        rows.append((item, target, phases))
    return rows


def scores(name: str, profile: Profile, geometry: int) -> dict[str, float]:
    """Means over the images of what is scored of captures, by ``method.score``. CellError: no registration."""
    family, means = load_family(name), dict[str, float]()
    bench = open_bench(profile, tuple(family["panel"]), family["seed"])
    for label in family["figures"]:
        shots = [
            (bench.photograph(own[label], target, item, 0), target) for item, target, own in holograms(name, geometry)
        ]
        own = pd.DataFrame([score(shot.image, target, metrics=METRICS) for shot, target in shots]).mean()
        means |= {f"{label}.{key}": float(own[key]) for key in SCORED}
    return means


def evaluated(name: str, index: int) -> dict[str, Any]:
    """The row of a draw; one whose camera cannot be registered has no scores, and misses every figure."""
    torch.set_num_threads(1)
    row = drawn(load_family(name), index)
    with suppress(CellError):
        own = scores(name, profile_of(text_of(load_family(name), row, f"{name} draw {index}")), row["geometry"])
        row |= {key: float(f"{value:.5g}") for key, value in own.items()}
    return row


def computed(name: str, folder: Path, draws: int, workers: int) -> pd.DataFrame:
    """All rows of a family's first draws; those that the folder has are kept. UserError: they are of another family."""
    family, path, known = load_family(name), folder / "draws.csv", folder / "family.json"
    dataset = family["targets"]["dataset"]
    own = {
        "family": hashlib.sha256((RANGES / f"{name}.yaml").read_bytes()).hexdigest(),
        "base": load_profile(family["base"]).digest,
        "code": HARNESS,
        dataset: dataset_version(dataset, plugins.find("datasets", dataset)),
        **{label: method_version(plugins.find("methods", label)) for label in family["figures"]},
    }
    if path.exists() and (not known.exists() or json.loads(known.read_text(encoding="utf-8")) != own):
        raise UserError(f"{folder}: has draws of another family, or by other code; choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    known.write_text(json.dumps(own, indent=1), encoding="utf-8")
    columns = ["draw", "geometry", "outside", *(each["name"] for each in parameters(family))]
    columns += [f"{label}.{key}" for label in family["figures"] for key in SCORED]
    content = path.read_text(encoding="utf-8") if path.exists() else ",".join(columns) + "\n"
    path.write_text(content[: content.rfind("\n") + 1], encoding="utf-8")  # without a line that was cut short
    left = sorted({*range(draws)} - {*pd.read_csv(path)["draw"]})
    with ProcessPoolExecutor(workers) as pool:
        for number, row in enumerate(pool.map(partial(evaluated, name), left), 1):
            pd.DataFrame([row]).reindex(columns=columns).to_csv(path, mode="a", header=False, index=False)
            print(f"{number} of {len(left)} draws")
    return pd.read_csv(path).query("draw < @draws").sort_values("draw", ignore_index=True)


def fits(
    family: Family, rows: pd.DataFrame, domain: str = "linear", metrics: Sequence[str] = METRICS, factor: float = 1
) -> pd.DataFrame:
    """The rows that miss no figure by more than the tolerances, as a factor of them."""
    misses = [
        (rows[f"{label}.{metric}_{domain}"] - figures[metric]).abs() / family["tolerance"][metric]
        for label, figures in family["figures"].items()
        for metric in metrics
    ]
    return rows[pd.concat(misses, axis=1).max(axis=1, skipna=False) <= factor]


def members(name: str, rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Displays in a seeded order of the draws that fit, of which as large a share has outside effects as of all draws.

    Each is captured again under its own name, and is kept if it still fits. UserError: too few draws fit.
    """
    family, kept = load_family(name), list[dict[str, Any]]()
    fit, outside = fits(family, rows), round(family["members"] * family["outside"]["share"])
    places = {0: family["members"] - outside, 1: outside}
    for place in torch.randperm(len(fit), generator=generator("members", family["base"], family["seed"])).tolist():
        row = fit.iloc[place].to_dict()
        if places[row["outside"]]:
            row["display"] = f"{name}-{len(kept) + 1:02d}"
            row["text"] = text_of(family, row, row["display"])
            with suppress(CellError):  # not registered with these patterns
                row |= scores(name, profile_of(row["text"]), int(row["geometry"]))
                kept += [row] * len(fits(family, pd.DataFrame([row])))
                places[row["outside"]] -= row in kept
    if any(places.values()):
        raise UserError(f"{len(fit)} of {len(rows)} draws fit, too few to keep {family['members']}; give more draws")
    return kept


def marginals(family: Family, fit: pd.DataFrame) -> list[dict[str, Any]]:
    """Every parameter with the quantiles of its values, and the width of the middle half of them relative to that of
    its range: the one that the figures determine best first."""
    rows = []
    for given in parameters(family):
        values = fit[given["name"]].dropna()
        if len(values) > 1:
            at = values.quantile(QUANTILES).tolist()
            width = (values.quantile(0.75) - values.quantile(0.25)) / (0.5 * (given["high"] - given["low"]))
            rows.append({**given, "at": at, "span": f"{at[0]:.3g} to {at[-1]:.3g}", "width": width})
    return sorted(rows, key=lambda row: row["width"])


def determined(row: Mapping[str, Any]) -> str:
    """A parameter that the figures determine, in words."""
    ends = [(row["low"], row["at"][0]), (row["high"], row["at"][-1])]
    near = [f"{end:g}" for end, at in ends if abs(end - at) < CUT * (row["high"] - row["low"])]
    cut = f" (cut where its range ends, at {' and '.join(near)})" if near else ""
    return f"{row['words']}: {row['span']} {row['unit']}".rstrip() + cut


def answer(family: Family, rows: pd.DataFrame) -> Iterator[str]:
    """What the figures say of the displays."""
    fit, tolerance = fits(family, rows), family["tolerance"]
    order = marginals(family, fit)
    figures = ", ".join(f"{key} {own['psnr']:g} dB and SSIM {own['ssim']:g}" for key, own in family["figures"].items())
    yield (
        f"Captures of {len(fit)} of {len(rows)} draws ({len(fit) / len(rows):.0%}) come within "
        f"{tolerance['psnr']:g} dB and {tolerance['ssim']:g} of the published figures: {figures}."
    )
    yield f"{rows.iloc[:, -1].isna().sum()} draws could not be registered."
    known = "; ".join(determined(row) for row in order if row["width"] < NARROW)
    yield f"The figures determine {known or 'no parameter'}."
    unknown = ", ".join(row["words"] for row in order if row["width"] > WIDE)
    yield f"They say next to nothing of: {unknown or 'no parameter'}."


def report(family: Family, rows: pd.DataFrame, kept: Sequence[Mapping[str, Any]]) -> str:
    """The text of ``report.md``."""
    fit, inside = fits(family, rows), [row for row in kept if not row["outside"]]
    order, ranges = marginals(family, fit), {each["name"]: each["high"] - each["low"] for each in family["parameters"]}
    nearest = min(inside, key=lambda row: sum(((row[key] - fit[key].median()) / ranges[key]) ** 2 for key in ranges))
    determined_by, geometries, readings, displays = [], [], [], []
    for row in order:
        line = {"parameter": row["words"], "key": code(row["name"]), "unit": row["unit"]}
        line |= {"drawn from": f"{row['low']:g} to {row['high']:g}"}
        line |= {name: f"{at:.3g}" for name, at in zip(("5 %", "median", "95 %"), row["at"], strict=True)}
        determined_by.append(line | {"width of the middle half": f"{row['width']:.2f}", "source": row["source"]})
    for number, given in enumerate(family["geometries"]):
        line = {"geometry": number + 1, "what methods are told": ", ".join(f"{k} {v}" for k, v in given.items())}
        counts = ((some["geometry"] == number).sum() for some in (rows, fit))
        geometries.append(line | dict(zip(("draws", "draws that fit"), counts, strict=True)))
    for words, given in READINGS.items():
        own = fits(family, rows, **given)
        spans = {row["name"]: row["span"] for row in marginals(family, own)}
        line = {"figures held against captures": words, "draws that fit": len(own)}
        best = {f"{row['words']}, 5 to 95 % [{row['unit']}]": spans.get(row["name"], "–") for row in order[:2]}
        readings.append(line | best)
    for row in kept:
        line = {"display": row["display"], "draw": int(row["draw"]), "geometry": int(row["geometry"]) + 1}
        line |= {"outside effects": "yes" if row["outside"] else ""}
        for label in family["figures"]:
            line[f"{label} PSNR [dB]"] = f"{row[f'{label}.psnr_linear']:.2f}"
            line[f"{label} SSIM"] = f"{row[f'{label}.ssim_linear']:.3g}"
        displays.append(line)
    text = [
        heading(f"Displays with the figures of {family['base']}", 1),
        bullets(answer(family, rows)),
        Markdown("![Pairs of parameters](corner.png)"),
        f"All {len(rows)} draws pale, those that fit dark; dotted: an even spread. The {DRAWN} parameters that the "
        "figures determine best.",
        heading("What the figures determine"),
        table_of(determined_by),
        "The width is relative to that of the range: at 1 the figures say nothing.",
        table_of(geometries),
        heading("Other ways to read the figures"),
        table_of(readings),
        heading("The displays that are kept"),
        "Drawn in a seeded order from those that fit, and captured again under their own names. "
        f"{nearest['display']} is the nearest to the middle of those that fit.",
        table_of(displays),
    ]
    return f"{blocks(text)}\n"


def draw_corner(path: Path, family: Family, rows: pd.DataFrame) -> None:
    """Draw each pair of some parameters, all draws pale, those that fit dark; on the diagonal how the latter lie."""
    fit, always = fits(family, rows), family["parameters"]
    best = [row for row in marginals(family, fit) if any(row["name"] == each["name"] for each in always)][:DRAWN]
    figure = Figure((11, 11), layout="constrained")
    for (down, across), panel in np.ndenumerate(figure.subplots(len(best), len(best), squeeze=False)):
        vertical, horizontal = best[down], best[across]
        panel.set_xlim(horizontal["low"], horizontal["high"])
        panel.set_xlabel(f"{textwrap.fill(horizontal['words'], 20)}\n{horizontal['unit']}", fontsize=8)
        if across > down:
            panel.set_axis_off()
        elif across == down:
            counts, *_ = panel.hist(fit[horizontal["name"]], bins=12, range=panel.get_xlim(), color=DARK)
            panel.axhline(counts.mean(), color="black", linewidth=0.8, linestyle=":")
        else:
            panel.set_ylim(vertical["low"], vertical["high"])
            panel.set_ylabel(f"{textwrap.fill(vertical['words'], 20)}\n{vertical['unit']}", fontsize=8)
            for some, colour, area in ((rows, PALE, 2), (fit, DARK, 6)):
                panel.scatter(some[horizontal["name"]], some[vertical["name"]], s=area, color=colour, linewidths=0)
        panel.label_outer()
    figure.savefig(path, dpi=90)


def main(draws: int, folder: Path = FOLDER, workers: int = 1, name: str = NAME) -> None:
    """Draw displays, going on with what the folder has; write the report and the profiles that are kept."""
    family, rows = load_family(name), computed(name, folder, draws, workers)
    kept = members(name, rows)
    (folder / "displays").mkdir(exist_ok=True)
    for row in kept:
        own = {label: (row[f"{label}.psnr_linear"], row[f"{label}.ssim_linear"]) for label in family["figures"]}
        reached = ", ".join(f"{label} {psnr:.2f} dB and SSIM {ssim:.3f}" for label, (psnr, ssim) in own.items())
        head = f"# Draw {int(row['draw'])} of {draws} by reports/family/draws.py, see docs/bench.md.\n"
        text = f"{head}# Captures of its images have {reached}.\n{row['text']}"
        (folder / "displays" / f"{row['display']}.yaml").write_text(text, encoding="utf-8")
    draw_corner(folder / "corner.png", family, rows)
    (folder / "report.md").write_text(report(family, rows, kept), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
