"""A recorder of robot hand sessions rebuilt by measuring six sessions of a foreign recorder."""
