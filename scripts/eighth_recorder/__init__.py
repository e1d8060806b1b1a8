"""A recorder of simulated prosthetic hands with something hidden in each session."""
