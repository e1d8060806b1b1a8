"""Siblings of real machines, simulated with something hidden in them; shares no code with the diagnosis."""
