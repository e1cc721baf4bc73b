"""
An error budget
===============

What is wrong with a display's captures, and who could remove it? A small budget of
``leto-2020``: three targets on a panel of 128 x 128 pixels, two models that learn
from captures of three images. The full study has 40 targets, 32 training images, a
network between the two models and many more steps; the shares of this one
are rough.
"""

import tempfile
import textwrap
from contextlib import chdir
from pathlib import Path

import matplotlib.pyplot as plt

from holobench_eval.commands import app

# %%
# The study
# ---------
#
# The order of the methods is that of the budget: each contains the one before.
# Image-domain terms are shading, blur, haze and tone; a field model has light
# that interferes. The config is ``configs/error-budget.yaml`` with smaller
# numbers.

folder = Path(tempfile.mkdtemp())
(folder / "small-budget.yaml").write_text("""\
title: A small error budget
question: What of the captures' error can be explained from the ideal image?
seed: 2020
measure: error_budget
holograms: {name: wirtinger, params: {iterations: 30}}
display: {profiles: [leto-2020], panel: [128, 128]}
targets: {dataset: photographs, params: {names: [astronaut, coffee, chelsea]}}
training:
  dataset: dead_leaves
  params: {count: 4, colours: natural}
  held_out: 1
methods:
  - name: image_terms
    label: image-domain terms
    params: {start: {iterations: 30}, training: {steps: 120}}
  - name: field_network
    label: a field model
    params: {start: {iterations: 30}, training: {steps: 50}}
protocol: {metrics: [psnr]}
""")

# %%
# The command is ``holoeval run small-budget.yaml``. It trains both models,
# captures the hologram of every target twice, and writes the report.

with chdir(folder):
    app(["run", "small-budget.yaml", "--executor", "serial"], standalone_mode=False)

# %%
# The budget
# ----------
#
# The bar splits the squared error of the captures. The marks are the decibels
# that could be gained at most, if everything explained up to there were removed
# from the captures.

report = folder / "holoeval-results" / "small-budget"
figure, axis = plt.subplots(figsize=(10, 4), layout="constrained")
axis.imshow(plt.imread(report / "figures" / "error-budget.png"))
axis.set_axis_off()

# %%
# The answer as the report words it. The intervals are wide, as three targets
# allow; the full study agrees in what is largest, the veil of stray light among
# the image-domain terms.

text = (report / "report.md").read_text()
answer = text.split("## Answer")[1].split("The names that occur here")[0]
print(textwrap.fill(answer.strip(), 80))
