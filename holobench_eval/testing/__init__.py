"""Checks of what others bring, and photographs whose truth is known. For tests and ``holoeval conformance``."""
