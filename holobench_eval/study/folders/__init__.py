"""Photographs that somebody took, in folders: read, aligned and scored."""
