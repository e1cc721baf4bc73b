"""
Through a model of the display
==============================

Whoever has a profile of a display, its twin or another lab's, can optimise
holograms through it without a single photograph. How much that is worth hangs on
how right the profile is.
"""

import matplotlib.pyplot as plt
from skimage.data import chelsea

import holobench_eval as hb

# %%
# On ``leto-aged`` the light that the panel does not modulate lies in the picture.
# ``through`` descends on the simulated bench of a profile: of a display with other
# faults, and of the display itself, which makes it an oracle.

display = hb.open_display("leto-aged", panel=(128, 128))
target = display.target(chelsea())
phase = display.solve("wirtinger", target, iterations=60)
pictures = {"wirtinger": display.capture(phase, target)}
for profile in ("leto-mild", "leto-aged"):
    phase = display.solve("through", target, profile=profile, iterations=15)
    pictures[f"through {profile}"] = display.capture(phase, target)

figure, axes = plt.subplots(1, 3, figsize=(9, 3), layout="constrained")
for axis, (title, capture) in zip(axes, pictures.items(), strict=True):
    axis.imshow(hb.picture(capture, target))
    psnr = hb.score(capture, target)["psnr_linear"]
    axis.set_title(f"{title}: {psnr:.1f} dB", fontsize=9)
    axis.set_axis_off()

# %%
# ``holoeval twin`` makes such a profile of a display from about 60 photographs, and
# says how far it can be trusted.
