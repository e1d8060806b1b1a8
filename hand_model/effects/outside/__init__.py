"""What no row of the table of effects holds and would yet be taken for one: it competes like any effect, and where it
wins the mismatch is told as unexplained, with what it varies with. One file each, found by `effects.outsiders()`."""
