"""A trained method as a display that anyone can run: a profile with a network file (``display.simulated.network``)."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from ..core import plugins
from ..core.device import moved
from ..core.errors import UserError, reason
from ..core.io import file_name
from ..display import Profile
from ..display.learned import LearnedBench
from ..display.simulated.network import LARGEST
from ..methods.twin.to_profile import write_learned
from .artifacts import packed, read_tensors
from .versions import method_version

SHIPPED = "expected a method of this package that trains and predicts captures"


def network_bench(profile: Profile, seed: int, device: torch.device) -> LearnedBench:
    """The display of a loaded profile, on its own panel.

    UserError: its file is not as it says, or of other code of the method, or the method is not of this package.
    """
    given, path = profile.network, Path(profile.network.file or "")
    method = predictor(given.method or "", given.params)
    if (version := method_version(type(method))) != given.version:
        told = f"was learned with the code '{given.version}' of {given.method}, and here is '{version}'"
        raise UserError(f"'{profile.name}' {told}; learn it again with holoeval twin")
    state = read_tensors(path, io.BytesIO(given.content(path))).get("state")
    if not isinstance(state, dict):
        raise UserError(f"{path}: holds nothing that a method has learned")
    spec, colours = profile.spec(), len(profile.panel.wavelengths)
    try:
        bench = LearnedBench(spec, method, moved(state, device), seed, device)
        dark = bench.photograph(torch.zeros(colours, *spec.shape), torch.ones(colours, *spec.region.shape), "trial", 0)
        fault = "" if dark.image.isfinite().all() else "it predicts numbers that are not finite"
    except Exception as error:  # a file that is not of the method raises whatever it happens to lack
        fault = reason(error)
    if fault:
        raise UserError(f"{path}: not what {given.method} has learned of this panel: {fault}")
    return bench


def write_network(
    state: Mapping[str, Any], method: str, params: Mapping[str, Any], base: Profile, folder: Path
) -> Path:
    """Write a profile of what a method has learned; the file's path.

    base: its name, version, nominal panel, and what is known of it. UserError: a method that is not of this
    package, or a file of more than 100 MB.
    """
    version, content = method_version(type(predictor(method, params))), packed({"state": dict(state)})
    if len(content) > LARGEST:
        raise UserError(f"{method} has learned {len(content) / 1e6:.0f} MB; a display has at most {LARGEST / 1e6:g} MB")
    facts = {"method": method, "version": version, "params": dict(params)}
    return write_learned(base, {}, "network", facts, f"{file_name(base.name)}.pt", content, folder)


def predictor(name: str, params: Mapping[str, Any]) -> Any:
    """The method that a display is predicted by.

    UserError: it is a file of code, which a display must not bring with it, or one that predicts nothing.
    """
    if not plugins.is_shipped("methods", name):
        raise UserError(f"'{name}' cannot be a display; {SHIPPED}")
    method = plugins.build("methods", name, dict(params), None)
    if not hasattr(method, "predict") or not getattr(method, "trains", False):
        raise UserError(f"'{name}' cannot be a display; {SHIPPED}")
    return method
