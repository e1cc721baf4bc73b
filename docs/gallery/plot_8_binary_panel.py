"""
Two levels
==========

A ferroelectric panel switches fast and shows two phases. Rounding a phase to them
costs most of the picture; a descent that knows the levels, and frames that share an
exposure, bring it back.
"""

from dataclasses import replace

import matplotlib.pyplot as plt

from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.methods.coarse.gumbel import Gumbel
from holobench_eval.methods.coarse.nearest_level import NearestLevel
from holobench_eval.metrics import match, score
from holobench_eval.optics import srgb_encode
from holobench_eval.study.opening import open_bench

# %%
# The display is ideal but for its levels, 0 and half a turn, and shows up to four
# frames in an exposure.

ideal = load_profile("ideal")
profile = replace(ideal, panel=replace(ideal.panel, bits=1, frames=4))
display = open_bench(profile, panel=(128, 128))
target = Photographs().load("camera", display.bench.spec.region.shape)

# %%
# ``NearestLevel`` rounds a phase of Wirtinger holography; ``Gumbel`` descends on
# the probabilities of levels (Choi et al. 2022).

methods = {
    "rounded": NearestLevel(),
    "annealed": Gumbel(iterations=150),
    "annealed, 4 frames": Gumbel(iterations=150, frames=4),
}
pictures = {"target": target}
for name, method in methods.items():
    handle = display.for_method(method, name, target, item="camera", repeat=0)
    phase = method.solve(target[None], handle)[0]
    capture = display.photograph(phase, target, item="camera", repeat=0).image
    psnr = score(capture, target, metrics=["psnr"])["psnr_linear"]
    pictures[f"{name}: {psnr:.1f} dB"] = match(capture, target)[0]

figure, axes = plt.subplots(1, 4, figsize=(10, 2.9), layout="constrained")
for axis, (title, picture) in zip(axes, pictures.items(), strict=True):
    axis.imshow(srgb_encode(picture).permute(1, 2, 0).float())
    axis.set_title(title, fontsize=9)
    axis.set_axis_off()
