"""Name: whether a balance lacks anything, which effects those are, how sure that is and what cannot be told apart."""
