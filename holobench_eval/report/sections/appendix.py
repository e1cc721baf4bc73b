"""The end of the details: the config and what it was run with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..markdown import Markdown, code, code_block, heading, properties
from ..section import Blocks, Figures, Report, Section


def _environment(report: Report, _: Figures) -> Blocks:
    description = report.description
    yield heading("Config and environment")
    if description.config_text:
        yield Markdown("The config, {}:").format(code(description.config_file))
        yield code_block(description.config_text)
    rows = environment(report.provenance)
    yield properties(rows) if rows else "The environment was not recorded."


def environment(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the run used, as far as it is the same for two equal runs: no times, no paths, no revisions."""
    single = {"package": "holobench_eval", "python": "Python", "platform": "platform", "cpu": "processor", "gpu": "GPU"}
    numbers = {"threads": "threads per worker", "workers": "workers", "config_sha256": "sha256 of the config"}
    named = [(title, str(provenance[key])) for key, title in (single | numbers).items() if key in provenance]
    return [*named, *((name, str(value)) for name, value in provenance.get("packages", {}).items())]


SECTIONS = (Section("environment", 220, _environment, details=True),)
