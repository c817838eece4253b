"""Readers of models published as files of other programs. Nothing in a file is executed."""
