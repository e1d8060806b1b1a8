"""A recorder of simulated hand sessions with something hidden in them, independent of the tool that diagnoses them."""
