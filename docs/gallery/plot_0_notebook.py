"""
A picture on a display
======================

Open a display, compute a hologram, photograph it and score the photograph, in a
notebook: NumPy in, NumPy out.
"""

import matplotlib.pyplot as plt
from skimage.data import astronaut

import holobench_eval as hb

# %%
# A display is opened and registered with holograms of circles. ``leto-2020`` is
# simulated; ``hb.open_bench("bench.yaml")`` opens one that exists.

display = hb.open_display("leto-2020", panel=(192, 192))
target = display.target(astronaut())
print(repr(target))

# %%
# Methods go by their names, or are functions of yours. What a method finds is a
# phase in radians.

captures = {}
for name in ("gerchberg_saxton", "wirtinger"):
    phase = display.solve(name, target, iterations=50)
    captures[name] = display.capture(phase, target)
    psnr = hb.score(captures[name], target)["psnr_linear"]
    print(f"{name}: PSNR {psnr:.2f} dB")

# %%
# ``hb.picture`` is the photograph as it is scored: in the frame of the target,
# its brightness matched. ``display.ideal`` is what a display without faults would
# show of the last phase.

pictures = {**captures, "wirtinger, ideal display": display.ideal(phase)}
figure, axes = plt.subplots(1, 3, figsize=(9, 3.3), layout="constrained")
for axis, (title, capture) in zip(axes, pictures.items(), strict=True):
    axis.imshow(hb.picture(capture, target))
    axis.set_title(title)
    axis.set_axis_off()
