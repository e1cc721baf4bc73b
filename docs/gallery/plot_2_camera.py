"""
A method that captures
======================

A camera sees what no model knows. A method that uses it declares ``camera = True``,
and the display counts and limits its captures.
"""

import tempfile
from contextlib import chdir
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from holobench_eval.commands import app

folder = Path(tempfile.mkdtemp())

# %%
# The method
# ----------
#
# ``holoeval new method closer --camera`` writes one that works, to be changed, and
# its test:

with chdir(folder):
    app(["new", "method", "closer", "--camera"], standalone_mode=False)
print((folder / "closer.py").read_text())

# %%
# ``bench.capture`` gives the frame as the camera gives it, ``bench.rectify`` brings
# it into the frame of the target. ``bench.keep`` hands in the best hologram so far:
# where the display's budget ends, the next capture raises a ``BudgetError``, the
# method ends with it, and what it kept is scored.

# %%
# A study
# -------
#
# ``captures: 12`` is the display's limit, which the method finds in
# ``bench.budget``. The second row has the method's own default of 20.

(folder / "study.yaml").write_text("""\
title: With and without a camera
display: {profiles: [leto-aged], panel: [144, 144]}
targets: {dataset: photographs, params: {names: [coffee, astronaut]}}
methods:
  - {name: wirtinger, params: {iterations: 50}}
  - {name: "closer.py:Closer"}
  - {name: "closer.py:Closer", label: "Closer, budget 12", captures: 12}
protocol: {metrics: [psnr]}
""")
with chdir(folder):
    app(["run", "study.yaml", "--executor", "serial"], standalone_mode=False)

# %%
# What a method takes is reported beside what it reaches: one that captures is
# ranked among those that do.

report = folder / "holoeval-results" / "study"
table = pd.read_csv(report / "table.csv").query("category != 'floor'")
columns = ["label", "category", "psnr_linear_db", "captures"]
print(table[columns].to_string(index=False))
figure, axis = plt.subplots(figsize=(10, 6), layout="constrained")
axis.imshow(plt.imread(report / "figures/answer-pictures.jpg"))
axis.set_axis_off()
