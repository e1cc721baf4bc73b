"""Methods and images that are made with a number in a file beside them."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import torch

DATA = Path(__file__).with_name("data.txt")


def amount(file=DATA):
    return float(Path(file).read_text())


@dataclass(frozen=True)
class Mine:
    def solve(self, target, bench):
        return self.amount(bench) * torch.rand((1, 3, *bench.spec.shape), generator=torch.Generator().manual_seed(0))

    def amount(self, bench):
        return amount()


class Learning(Mine):
    trains: ClassVar[bool] = True

    def prepare(self, bench):
        return {"amount": torch.tensor(amount())}

    def amount(self, bench):
        return float(bench.learned["amount"])


@dataclass(frozen=True)
class Named(Mine):
    file: str = "data.txt"

    def amount(self, bench):
        return amount(self.file)


@dataclass(frozen=True)
class Images:
    def items(self):
        return ["a", "b"]

    def digest(self, item):
        return 64 * item

    def load(self, item, shape, channels=3):
        return torch.rand((channels, *shape), generator=torch.Generator().manual_seed(ord(item))) * amount()
