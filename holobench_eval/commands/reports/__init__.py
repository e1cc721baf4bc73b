"""Commands on finished reports, and what ``holoeval check`` needs besides its own file."""
