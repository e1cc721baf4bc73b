"""Times cases on request, so that two processes with two versions of the package can take turns.

``worker.py --from FOLDER SEED``, the package being taken from there, reads lines from standard input: a case's name and
how often to call it. Answers each with a line of JSON: seconds, or why there is none; the seed decides where arrays lie
in each, see ``layout``. ``worker.py --names`` lists all;
``worker.py --memory NAME`` prints the most memory that a case holds while it is called, in bytes, beyond what its
process had before it was prepared.
"""

import json
import sys
import time
from contextlib import suppress
from importlib.machinery import PathFinder

import torch
from layout import Layout

PACKAGE = "holobench_eval"
THREADS = 2
SETTLED = 0.03
"""Seconds until the idle threads of another process, which took the turn before, have stopped watching for work: they
keep a core busy for up to 20 ms."""


class OnlyFrom:
    """Finds the package in one folder or not at all: an installed one would lend an older version what that lacks."""

    def __init__(self, folder):
        self.folder = folder

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] != PACKAGE:
            return None
        found = PathFinder.find_spec(name, [self.folder] if path is None else path)
        if found is None:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return found


def main():
    option, *rest = sys.argv[1:]
    if option == "--from":
        folder, seed = rest
        sys.meta_path.insert(0, OnlyFrom(folder))
        serve(Layout(seed))
    elif option == "--memory":
        print(json.dumps(memory(known()[rest[0]])))
    elif option == "--names":
        print(json.dumps(list(known())))


def known():
    """All cases by name. Nothing of the package is imported before it is known where it comes from."""
    from cases import CASES

    torch.set_num_threads(THREADS)
    with suppress(ModuleNotFoundError):  # of a version that is older than this
        from holobench_eval.core.allocator import keep_freed_memory

        keep_freed_memory()  # as a study does
    return {case.name: case for case in CASES}


def serve(layout):
    ready = {}
    for line in sys.stdin:
        name, _, calls = line.rstrip("\n").rpartition("\t")
        try:
            if name not in ready:
                ready = {name: known()[name].work().call}
                ready[name]()
            layout.redraw()
            time.sleep(SETTLED)
            if int(calls) > 1:  # a single call is a long one, beside which the pages of new places are nothing
                ready[name]()
            started = time.perf_counter()
            for _ in range(int(calls)):
                ready[name]()
            answer = {"seconds": (time.perf_counter() - started) / int(calls)}
        except Exception as error:  # of the other version of the package, which may lack what is timed
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


def memory(case):
    """Bytes; None where the system does not tell."""
    from holobench_eval.study import cost

    case.shrunk().work().call()  # libraries load more of themselves when they are first used
    before = cost.start().before
    work = case.work()
    work.call()
    watch = cost.start()  # what only the preparation needed is given back
    work.call()
    most = watch.stop().memory_mib
    return None if before is None or most is None else 1024 * (watch.before - before) + 2**20 * most


if __name__ == "__main__":
    main()
