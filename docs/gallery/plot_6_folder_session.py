"""
A folder session
================

A bench that other software drives exchanges files with holoeval: patterns out,
photographs in. Here a simulated bench stands in for the lab. It knows no more than
a lab does: the pictures, and the table that says how to show them.
"""

import csv
import tempfile
from contextlib import chdir
from dataclasses import replace
from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import torch

from holobench_eval.commands import app
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import Relay
from holobench_eval.display.simulated.stages.relay import sample

# %%
# Export
# ------
#
# The study, and ``holoeval session export study.yaml session``. With a real
# bench, ``--bench my-bench.yaml`` gives its panel, wavelengths and phase
# convention.

folder = Path(tempfile.mkdtemp())
session = folder / "session"
(folder / "study.yaml").write_text("""\
title: Two methods on a bench behind files
display: {profiles: [leto-mild], panel: [144, 144]}
targets: {dataset: photographs, params: {count: 2}}
methods: [double_phase, {name: wirtinger, params: {iterations: 40}}]
protocol: {metrics: [psnr, ssim]}
""")
with chdir(folder):
    app(["session", "export", "study.yaml", "session"], standalone_mode=False)

# %%
# ``order.csv`` is made for scripts: what to show, how long to expose, where to
# save the photograph.


def rows_of(name):
    with (session / "patterns" / name / "order.csv").open() as file:
        return list(csv.DictReader(file))


order = rows_of("round-1")
columns = ["show", "role", "wavelength_nm", "relative_exposure", "laser"]
print(pd.DataFrame(order)[columns].iloc[::10].to_string(index=False))

# %%
# Photograph
# ----------
#
# In a lab, a script shows each picture on the panel, waits for it to settle and
# exposes the camera. This lab turns gray levels into a phase, lets the simulated
# bench form the image, and looks at it with a camera that is magnified, turned
# and noisy.

profile = load_profile("leto-mild").scaled((144, 144))
pose = Relay(magnification=1.5, rotation=4.0, perspective=(0.03, -0.02))
bench = SimulatedBench(replace(profile, relay=pose))
draw = torch.Generator().manual_seed(1)
wavelengths = {row["wavelength_nm"] for row in order}
colours = sorted(wavelengths, key=float, reverse=True)
FULL, DARK, NOISE = 65535, 900, 20  # counts
counts_per_light = None


def levels(row):
    """The picture for the panel."""
    return cv2.imread(str(session / row["show"]), cv2.IMREAD_UNCHANGED)


def light(row):
    """What falls on the sensor."""
    if row["laser"] == "blocked":
        return torch.zeros(bench.response.shape)
    phase = torch.from_numpy(levels(row).astype(np.float32)) * (2 * torch.pi / 256)
    image = bench.integrated(phase, colours.index(row["wavelength_nm"]))
    seen = sample(image, bench.grid, bench.image_samples)
    return seen * float(row["relative_exposure"])


def photograph(row):
    """Counts of the camera; the first lit pattern fills half of its range."""
    global counts_per_light
    arrived = light(row)
    if counts_per_light is None and row["laser"] == "on":
        counts_per_light = 0.5 * FULL / float(arrived.max())
    noise = NOISE * torch.randn(arrived.shape, generator=draw)
    counts = arrived * (counts_per_light or 0) + DARK + noise
    return counts.round().clamp(0, FULL).numpy().astype(np.uint16)


def photograph_all(rows):
    global counts_per_light
    counts_per_light = None
    for row in rows:
        path = session / row["save_photograph_as"]
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), photograph(row))


# %%
# First the patterns that check the bench: a letter at five exposures, and with the
# other sign of the phase. Then the study.

photograph_all(rows_of("checks"))
photograph_all(order)

# %%
# A hologram of circles, which registers the camera, and one of a method:

figure, axes = plt.subplots(2, 2, figsize=(8, 7.6), layout="constrained")
for pair, role in zip(axes, ("fiducial", "hologram"), strict=True):
    row = next(row for row in order if row["role"] == role)
    saved = cv2.imread(
        str(session / row["save_photograph_as"]), cv2.IMREAD_UNCHANGED
    )
    titles = f"{role}: pattern", f"photograph at {row['wavelength_nm']} nm"
    for axis, picture, title in zip(
        pair, (levels(row), saved), titles, strict=True
    ):
        axis.imshow(picture, cmap="gray")
        axis.set_title(title)
        axis.set_axis_off()

# %%
# Import
# ------
#
# ``holoeval session import session`` checks all photographs before it scores any:
# sizes, saturation, dark frames, frames that the camera gave twice, pictures that
# do not match their pattern, methods' photographs that changed places. It says
# whether camera and sign of the phase are right, and finds the pose of the camera
# from the fiducial holograms.

with chdir(folder):
    app(["session", "import", "session"], standalone_mode=False)

# %%
# The circles of the fiducial hologram as they were found:

figure, axis = plt.subplots(figsize=(9, 4), layout="constrained")
axis.imshow(plt.imread(session / "report" / "figures" / "registration.png"))
axis.set_axis_off()

# %%
# And the scores, from the same protocol as any other study:

table = pd.read_csv(session / "report" / "table.csv").query("category != 'floor'")
columns = ["label", "condition", "n", "psnr_linear_db", "ssim_linear"]
print(table[columns].to_string(index=False))
