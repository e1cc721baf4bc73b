"""Somebody with a bench of their own: shows the patterns of a session folder and saves photographs, knowing no more of
holoeval than order.csv and the phase convention in manifest.json."""

import csv
import json
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import torch

from holobench_eval.core.seeds import generator
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import Relay

ROOM = 0.6  # of full scale, for the brightest of the fiducial holograms


def another_pose(seed: int) -> Relay:
    """Where this camera stands: turned, off the axis and tilted, differently for every seed."""
    draw = np.random.default_rng(seed)
    return Relay(
        magnification=float(draw.uniform(1.3, 1.7)),
        rotation=float(draw.uniform(-6, 6)),
        shift=tuple(draw.uniform(-0.01, 0.01, 2)),
        perspective=tuple(draw.uniform(-0.06, 0.06, 2)),
    )


class Lab:
    """A simulated bench behind files. gain: counts per electron; sign: -1 for a panel with another than stated."""

    def __init__(self, profile: str, panel: tuple[int, int], seed: int, dark: int = 900, sign: int = 1) -> None:
        description = load_profile(profile).scaled(panel)
        self.bench = SimulatedBench(replace(description, relay=another_pose(seed)))
        self.seed, self.shown = seed, Counter()
        self.dark, self.gain, self.sign, self.gamma = dark, None, sign, 1.0

    def photograph_round(self, folder: Path, number: int) -> None:
        """Show and save what order.csv of a round says."""
        self._photograph(folder, f"round-{number}")

    def photograph_checks(self, folder: Path, gamma: float = 1.0) -> None:
        """The patterns that check the bench, with an exposure of their own; gamma: not 1 for a camera that encodes."""
        session, self.gain, self.gamma = self.gain, None, gamma
        self._photograph(folder, "checks")
        self.gain, self.gamma = session, 1.0

    def _photograph(self, folder: Path, name: str) -> None:
        convention = json.loads((folder / "manifest.json").read_text())["phase"]
        with (folder / "patterns" / name / "order.csv").open() as file:
            rows = list(csv.DictReader(file))
        wavelengths = sorted({float(row["wavelength_nm"]) for row in rows}, reverse=True)
        for row in rows:
            channel = wavelengths.index(float(row["wavelength_nm"]))
            levels = np.stack([cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED) for name in row["show"].split()])
            light = torch.zeros(self.bench.response.shape)
            if row["laser"] == "on":
                light = self._light(self._phase(levels, convention), channel) * float(row["relative_exposure"])
            if self.gain is None and row["laser"] == "on":
                self.gain = ROOM * 65535 / float(light.max()) / 2
            counts = (light * (self.gain or 0) / 65535) ** self.gamma * 65535 + self.dark
            pattern = levels.tobytes(), row["laser"], channel
            self.shown[pattern] += 1
            draw = generator("lab", self.seed, *pattern, self.shown[pattern])  # whatever the order of the photographs
            counts = counts + 20 * torch.randn(counts.shape, generator=draw)
            path = folder / row["save_photograph_as"]
            path.parent.mkdir(parents=True, exist_ok=True)
            stored = counts.round().clamp(0, 65535).numpy().astype(np.uint16)
            cv2.imwrite(str(path), stored, [cv2.IMWRITE_PNG_COMPRESSION, 0])  # noise, that only takes time to unpack

    def _phase(self, levels: np.ndarray, convention: dict) -> torch.Tensor:
        if convention["flip_horizontal"]:
            levels = levels[..., ::-1]
        if convention["flip_vertical"]:
            levels = levels[:, ::-1]
        turns = self.sign * convention["sign"] * levels.astype(np.float32) / convention["two_pi_level"]
        return torch.from_numpy((turns * math.tau + convention["origin"]).astype(np.float32))

    def _light(self, frames: torch.Tensor, channel: int) -> torch.Tensor:
        from holobench_eval.display.simulated.stages.relay import sample

        carrier = self.bench.ramp  # the patterns carry it already, this bench adds it itself
        light = torch.stack([self.bench.integrated(phase - carrier, channel) for phase in frames]).mean(0)
        return sample(light, self.bench.grid, self.bench.image_samples)
