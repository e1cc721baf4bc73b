"""Two reports side by side: what changed from one to the other, from their records alone."""
