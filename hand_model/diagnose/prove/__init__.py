"""Prove: what was named, written into the compiled files and replayed on recordings that took no part; recordings put
right."""
