"""Engines that load a description: each module has the same calls.

`load(file) -> model`, `positions(model, joint_angles) -> {marker, tip or site: (n, 3) [m]}` and
`poses(model, joint_angles) -> {link: (n, 4, 4)}`, both in the palm frame, or `kinematics(model, joint_angles)`, both at
once (the root's, where no link is called `palm`).
joint_angles: joint -> (n,) [rad]; joints that are not given stay at zero, and couplings are not applied: the caller
passes every angle, so that all engines are asked the same thing.
"""
