"""Settings for every test: one thread, the same examples on every run, no deadlines on a shared machine."""

import torch
from hypothesis import settings

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")
torch.set_num_threads(1)
