"""holobench_eval: which phase-retrieval method gives the better picture on a real, imperfect display?"""

__version__ = "0.1.0"
