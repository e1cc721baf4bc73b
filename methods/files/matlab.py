"""Write one array of a .mat file (before version 7.3) to standard output: a script for a process of its own.

SciPy's reader can crash on a damaged file, and takes the process with it. Run as ``python matlab.py FILE NAME BYTES``,
NAME empty where there is only one array. Standard output is a line of JSON, the shape and the bytes of a value of every
array by its name, then the array as .npy, unless there is no such array or it is larger than BYTES.
"""

from __future__ import annotations

import json
import sys
from math import prod

import numpy as np
from scipy.io import loadmat, whosmat

MOST = 16  # bytes of a value: a complex number of double precision
NUMBERS = {"double", "single"} | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}


def main(file: str, name: str, largest: str) -> None:
    """Read and write; what the reader raises goes to standard error as one line."""
    try:
        stored = whosmat(file)
        sizes = {found: (*shape, MOST) for found, shape, _ in stored}
        classes = {found: kind for found, _, kind in stored}
        print(json.dumps(sizes), flush=True)
        name = name or (next(iter(sizes)) if len(sizes) == 1 else "")
        if name in sizes and classes[name] not in NUMBERS:
            sys.exit(f"'{name}' is of class {classes[name]}; expected a full array of numbers")
        if name in sizes and prod(sizes[name]) <= int(largest):
            np.save(sys.stdout.buffer, loadmat(file, variable_names=[name])[name], allow_pickle=False)
    except NotImplementedError:  # what SciPy says to HDF5
        sys.exit("a .mat file of version 7.3; in MATLAB: save(..., '-v7')")
    except MemoryError:
        sys.exit("there is not enough memory to read it")
    except Exception as error:  # whatever a reader trips over in a damaged file
        sys.exit(f"damaged, or no .mat file: {next(iter(str(error).splitlines()), type(error).__name__)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
