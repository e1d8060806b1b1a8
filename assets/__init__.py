"""Files that ship with the package: recorded sessions of the twin and built hands. Installed as `hand_model.assets`."""
