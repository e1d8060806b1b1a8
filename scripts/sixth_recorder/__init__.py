"""A recorder of blind sessions of a two-finger hand, independent of the tool that diagnoses them (see `compose`)."""
