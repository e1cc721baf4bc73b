"""
A method that learns
====================

Errors of a display that stay the same can be learned from captures of other images,
once for all targets. A method that does so declares ``trains = True``.
"""

import tempfile
from contextlib import chdir
from pathlib import Path

import pandas as pd

from holobench_eval.commands import app

folder = Path(tempfile.mkdtemp())

# %%
# The method
# ----------
#
# ``holoeval new method flatter --trains`` writes one that works, to be changed, and
# its test:

with chdir(folder):
    app(["new", "method", "flatter", "--trains"], standalone_mode=False)
print((folder / "flatter.py").read_text())

# %%
# ``prepare`` gets the images of the study's ``training:``, those that are held out
# to watch it, and a camera that is counted; no scored target is among them. What it
# returns is kept in ``artifacts/``, and ``solve`` finds it in ``bench.learned``.
# What ``bench.kept`` has made is not made again where a training was stopped.

# %%
# A study
# -------
#
# Seven training images, of which the last is held out.

(folder / "study.yaml").write_text("""\
title: With and without a shading that was learned
display: {profiles: [leto-2020], panel: [144, 144]}
targets: {dataset: photographs, params: {names: [coffee, astronaut]}}
training: {dataset: dead_leaves, params: {count: 7}, held_out: 1}
methods:
  - {name: wirtinger, params: {iterations: 50}}
  - {name: "flatter.py:Flatter"}
protocol: {metrics: [psnr]}
""")
with chdir(folder):
    app(["run", "study.yaml", "--executor", "serial"], standalone_mode=False)

# %%
# The log of the training has the error of the prediction for the held-out image,
# before and after the shading was learned:

report = folder / "holoeval-results" / "study"
log = pd.read_csv(next(report.glob("training/*.csv")))
print(log[["error_before", "error_after", "captures"]].to_string(index=False))

# %%
# It foresees the captures much better, and gains a little by it: what a map of the
# brightness cannot undo is the larger part of this display's error.

table = pd.read_csv(report / "table.csv").query("category != 'floor'")
columns = ["label", "category", "psnr_linear_db", "training_captures"]
print(table[columns].to_string(index=False))
