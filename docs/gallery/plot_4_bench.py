"""
A bench of one's own
====================

A simulated display is a file. It says what differs from a shipped one: here a panel
whose crosstalk and zero order have grown.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

from holobench_eval.core.errors import UserError
from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics import match, score
from holobench_eval.optics import srgb_encode
from holobench_eval.report.charts.sheet import draw_sheet
from holobench_eval.study.opening import open_bench

# %%
# The profile
# -----------
#
# ``like`` names the profile whose values hold where the file gives none. The seed
# draws dust, fringes and all other random patterns: another seed is another panel
# of the same kind.

folder = Path(tempfile.mkdtemp())
profile = folder / "my-bench.yaml"
profile.write_text("""\
like: leto-mild
name: my-bench
seed: 7
description: The panel of leto-mild after some years.
crosstalk: {width: 0.4}                     # px; assumed
zero_order: {fraction: 0.12, phase: 0.7}    # of the power; assumed
""")

# %%
# A wrong key or value is one line, with its place in the file.

try:
    wrong = folder / "wrong.yaml"
    wrong.write_text("like: leto-mild\nname: wrong\ncrosstalk: {width: 40}\n")
    load_profile(str(wrong))
except UserError as error:
    print(str(error).removeprefix(f"{folder}/"))

# %%
# Its stages
# ----------
#
# The same picture comes from ``holoeval show my-bench.yaml --panel 144 144``:
# what every stage of the display does, from the look-up table to a capture of a
# test chart.

sheet = draw_sheet(str(profile), panel=(144, 144), output=folder / "stages.png")
figure, axis = plt.subplots(figsize=(17, 13), layout="constrained")
axis.imshow(plt.imread(sheet))
axis.set_axis_off()

# %%
# What it costs
# -------------
#
# One hologram on both displays. It was solved for the nominal optics, which are
# the same.

region = open_bench(load_profile("leto-mild"), panel=(144, 144)).spec.region.shape
target = Photographs().load("coffee", region)
method = Wirtinger(iterations=100)
figure, axes = plt.subplots(1, 3, figsize=(9, 3.3), layout="constrained")
axes[0].set_title("target")
axes[0].imshow(srgb_encode(target).permute(1, 2, 0))
for axis, source in zip(axes[1:], ("leto-mild", str(profile)), strict=True):
    bench = open_bench(load_profile(source), panel=(144, 144))
    handle = bench.for_method(method, "wirtinger", target, "coffee", 0)
    phase = method.solve(target[None], handle)[0]
    capture = bench.photograph(phase, target, "coffee", 0).image
    psnr = score(capture, target, metrics=["psnr"])["psnr_linear"]
    axis.set_title(f"{bench.spec.name}: {psnr:.1f} dB")
    axis.imshow(srgb_encode(match(capture, target)[0]).permute(1, 2, 0).float())
for axis in axes:
    axis.set_axis_off()

# %%
# In a study, the display is named by its file: ``display: {profiles: [leto-mild,
# my-bench.yaml]}``.
