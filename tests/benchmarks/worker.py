"""Times cases on request, so that two processes with two versions of the package can take turns.

Reads lines from standard input: a case's name and how often to call it. Answers each with a line of JSON: seconds, or
why there is none. ``worker.py --names`` lists them all; ``worker.py --memory NAME`` prints the most memory that a case
holds while it is called, in bytes, beyond what its process had before it was prepared.
"""

import json
import sys
import time

import torch
from cases import CASES, Case

from holobench_eval.allocator import keep_freed_memory
from holobench_eval.study import effort

THREADS = 2


def main():
    torch.set_num_threads(THREADS)
    keep_freed_memory()  # as a study does
    known = {case.name: case for case in CASES}
    if sys.argv[1:2] == ["--memory"]:
        print(json.dumps(memory(known[sys.argv[2]])))
        return
    if sys.argv[1:2] == ["--names"]:
        print(json.dumps(list(known)))
        return
    ready = {}
    for line in sys.stdin:
        name, _, calls = line.rstrip("\n").rpartition("\t")
        try:
            if name not in ready:
                ready = {name: known[name].work().call}
                ready[name]()
            started = time.perf_counter()
            for _ in range(int(calls)):
                ready[name]()
            answer = {"seconds": (time.perf_counter() - started) / int(calls)}
        except Exception as error:  # of the other version of the package, which may lack what is timed
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


def memory(case: Case) -> float | None:
    """Bytes; None where the system does not tell."""
    case.shrunk().work().call()  # libraries load more of themselves when they are first used
    before = effort.start().before
    work = case.work()
    work.call()
    watch = effort.start()  # what only the preparation needed is given back
    work.call()
    most = watch.stop().memory_mib
    return None if before is None or most is None else 1024 * (watch.before - before) + 2**20 * most


if __name__ == "__main__":
    main()
