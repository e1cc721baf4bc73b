"""How fast the package is: beside others' code, and one commit against another."""
