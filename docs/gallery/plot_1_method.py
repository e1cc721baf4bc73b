"""
A method in ten lines
=====================

A method turns a target into a phase. Here is the simplest one, compared with
Wirtinger holography on a display whose zero order lies in the picture.
"""

from dataclasses import dataclass

import matplotlib.pyplot as plt
import torch

from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics import match, score
from holobench_eval.optics import srgb_encode
from holobench_eval.study.opening import open_bench

# %%
# The method
# ----------
#
# A method is a frozen dataclass of parameters with one function, ``solve``. The
# display gives it the nominal optics and nothing else: which panel, distance and
# wavelengths, but not the errors of the bench.


@dataclass(frozen=True)
class Backprojection:
    """Propagate the target's amplitude back to the panel and keep the phase."""

    def solve(self, target, bench):
        """Linear intensity (B, C, h, w) in [0, 1] to phase (B, C, H, W) [rad]."""
        spec = bench.spec
        field = spec.region.embed(target.sqrt(), spec.shape).to(torch.complex64)
        colours = range(field.shape[1])
        back = [spec.propagator(c).adjoint(field[:, c]) for c in colours]
        return torch.stack(back, dim=1).angle()


# %%
# The display
# -----------
#
# ``leto-aged`` on a small panel. Its camera is registered with holograms of
# circles before any method is shown.

bench = open_bench(load_profile("leto-aged"), panel=(192, 192))
target = Photographs().load("astronaut", bench.spec.region.shape)

# %%
# Capture and score
# -----------------
#
# ``photograph`` shows the phase, takes the noisy capture and brings it into the
# frame of the target. ``score`` matches its brightness by one factor per colour
# and compares it with the target in linear light.

pictures = {"target": target}
wirtinger = Wirtinger(iterations=100)
methods = {"backprojection": Backprojection(), "wirtinger": wirtinger}
for name, method in methods.items():
    handle = bench.for_method(method, name, target, item="astronaut", repeat=0)
    phase = method.solve(target[None], handle)[0]
    capture = bench.photograph(phase, target, item="astronaut", repeat=0).image
    psnr = score(capture, target, metrics=["psnr"])["psnr_linear"]
    pictures[f"{name}: {psnr:.1f} dB"] = match(capture, target)[0]
    print(f"{name}: {psnr:.2f} dB")

gray = torch.ones_like(target)
constant = score(gray, target, metrics=["psnr"], refine=False)["psnr_linear"]
print(f"a constant image: {constant:.2f} dB")

# %%
# Both are compared with a constant image, the floor of every report: on this
# display it is hard to beat.

figure, axes = plt.subplots(1, 3, figsize=(9, 3.3), layout="constrained")
for axis, (title, picture) in zip(axes, pictures.items(), strict=True):
    axis.imshow(srgb_encode(picture).permute(1, 2, 0).float())
    axis.set_title(title)
    axis.set_axis_off()

# %%
# Next
# ----
#
# Saved as ``backprojection.py``, the class is named in a config as
# ``backprojection.py:Backprojection``, beside the shipped methods, and a study
# scores it on many targets with intervals and tests. One target shows nothing.
# ``holoeval new method mine`` writes such a file, and a test of what every method
# promises; with ``--camera`` one that captures while it solves, with ``--trains``
# one that learns first, as the next two examples show.
