"""How fast the package is: timed by pytest-benchmark beside others, and one commit against another."""
