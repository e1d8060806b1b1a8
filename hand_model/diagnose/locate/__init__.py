"""Locate: what the three stations show. Markers against rigid segments, counts against segment angles, current against
motion."""
