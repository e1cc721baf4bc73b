"""
An eye that moves
=================

A scene with depth looks different from each place of the eyebox. One hologram with
a smooth phase sends its light through the middle of the iris; frames of random
phase that know the views show each place its own.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import torch

from holobench_eval.datasets.light_fields import LightFields
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes import altered
from holobench_eval.methods.frames.light_field import LightField
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics import match, score
from holobench_eval.optics import srgb_encode
from holobench_eval.study.opening import open_bench

# %%
# The light field
# ---------------
#
# Three views of a ray-traced scene, 20 mm deep on the full panel, for a pupil at
# -0.5, 0 and 0.5 radii of the iris.

panel = (128, 128)
ideal = load_profile("ideal")
profile = replace(ideal, panel=replace(ideal.panel, frames=4))
scene = LightFields(scenes=("shapes-2",), places=(-0.5, 0.0, 0.5))
places = [scene.place(item) for item in scene.items()]
display = open_bench(profile, panel=panel)
shape = display.bench.spec.region.shape
views = [scene.load(item, shape) for item in scene.items()]

# %%
# Two holograms
# -------------
#
# Wirtinger holography is given the view from the middle, ``LightField`` all three.

smooth, field = Wirtinger(iterations=60), LightField(frames=4, iterations=60)
handle = display.for_method(field, "", views[1], item="views", repeat=0)
holograms = {
    "one smooth frame": smooth.solve(views[1][None], handle)[0],
    "four frames, all views": field.solve_views(torch.stack(views), places, handle),
}

# %%
# What the eye sees
# -----------------
#
# The condition ``eye_pupil`` puts a pupil, half as wide as the iris, at a place.
# The camera keeps the registration that it has without one.

figure, axes = plt.subplots(3, 3, figsize=(8, 8.4), layout="constrained")
for column, (place, view) in enumerate(zip(places, views, strict=True)):
    altered_profile = altered(profile, "eye_pupil", f"{place:g}")
    eye = open_bench(altered_profile, panel, registered_as=display)
    pictures = {f"target, pupil at {place:g}": view}
    for name, phase in holograms.items():
        seen = eye.photograph(phase, view, item="views", repeat=0).image
        psnr = score(seen, view, metrics=["psnr"])["psnr_linear"]
        pictures[f"{name}: {psnr:.1f} dB"] = match(seen, view)[0]
    tiles = zip(axes[:, column], pictures.items(), strict=True)
    for axis, (title, picture) in tiles:
        axis.imshow(srgb_encode(picture).permute(1, 2, 0).float())
        axis.set_title(title, fontsize=8)
        axis.set_axis_off()

# %%
# These are places that the frames know. Between them they are some 5 dB worse: the
# study ``depth/light-field`` gives methods nine views and scores others.
