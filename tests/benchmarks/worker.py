"""Times cases on request, so that processes with versions of a case, or of the package, can take turns.

``worker.py --from FOLDER SEED`` takes the package from the folder; ``worker.py --steady SEED`` and
``worker.py --fresh`` as it is installed. Each reads lines from standard input, a case's name and a request, and answers
with a line of JSON:

- to a number, how often to call it: the seconds and page faults of a call. The seed decides where arrays lie in each,
  see ``layout``; in a fresh process they lie where they come to lie. What is new is prepared and called once before;
- to ``memory``: the most bytes that it holds while it is called, beyond what its process had before anything was
  prepared, where each version has a process of its own;
- to ``facts``: what is to be known of it beside its time;
- to ``reference``: nothing, but errors of its scene are known at once from then on.

What cannot be done is answered by its error; ``missing`` names a module that is not installed. ``worker.py --names``
lists all cases: group, version, and whether each version has a process of its own.
"""

import gc
import json
import resource
import sys
import time
from importlib.machinery import PathFinder

import heap
import torch
from layout import Layout

PACKAGE = "holobench_eval"
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
        serve(Server(Layout(seed), heap.as_a_study))
    elif option == "--steady":
        serve(Server(Layout(*rest)))
    elif option == "--fresh":
        serve(Server(None))
    elif option == "--names":
        print(json.dumps([[case.group, case.version, case.apart] for case in known().values()]))


def known():
    """All cases by name. Nothing of the package is imported before it is known where it comes from."""
    from cases import CASES

    return {case.name: case for case in CASES}


def serve(server):
    for line in sys.stdin:
        name, _, request = line.rstrip("\n").rpartition("\t")
        try:
            answer = server.answer(name, request)
        except Exception as error:  # of the other version of the package, which may lack what is timed
            answer = {"error": f"{type(error).__name__}: {error}"}
            if isinstance(error, ModuleNotFoundError):
                answer["missing"] = error.name
        print(json.dumps(answer), flush=True)


class Server:
    """The cases of one group at a time, each prepared when it is first asked for.

    layout: of what lies beside the arrays; settle: what the process does before anything is prepared.
    """

    def __init__(self, layout, settle=lambda: None):
        self.layout, self.settle = layout, settle
        self.cases, self.ready, self.before, self.held = None, {}, None, None

    def answer(self, name, request):
        if request == "reference":
            known()[name].scene.reference()
            return {}
        work = self.work(name)
        if request == "facts":
            return {"facts": work.facts()}
        if request == "memory":
            return {"bytes": self.held}
        return self.timed(work.call, int(request))

    def work(self, name):
        if self.cases is None:
            self.cases = known()
            self.settle()
        case = self.cases[name]
        if name not in self.ready:
            if any(self.cases[other].group != case.group for other in self.ready):
                self.forget()
            self.ready[name] = self.alone(case) if case.apart else case.work()
            self.ready[name].call()
        torch.set_num_threads(case.threads)
        return self.ready[name]

    def forget(self):
        self.ready.clear()
        if self.layout is not None:
            self.layout.held.clear()
        gc.collect()
        heap.give_back()

    def alone(self, case):
        """Prepare the only case of this process, and see how much memory it takes."""
        torch.set_num_threads(1)  # many processes do so at the same time; threads would wait for each other's cores
        if self.before is None:
            case.shrunk().work().call()  # libraries load more of themselves when they are first used
            heap.give_back()
            self.before = heap.resident()
        work = case.work()
        work.call()
        heap.give_back()  # what only the preparation needed
        most = heap.peak(lambda: [work.call() for _ in range(2)])
        self.held = None if most is None or self.before is None else most - self.before
        return work

    def timed(self, call, calls):
        if self.layout is not None:
            self.layout.redraw()
        time.sleep(SETTLED)
        if calls > 1:  # a single call is a long one, beside which the caches' state is nothing
            call()
        faults, started = resource.getrusage(resource.RUSAGE_SELF).ru_minflt, time.perf_counter()
        for _ in range(calls):
            call()
        seconds = (time.perf_counter() - started) / calls
        return {"seconds": seconds, "faults": (resource.getrusage(resource.RUSAGE_SELF).ru_minflt - faults) / calls}


if __name__ == "__main__":
    main()
