"""How long a comparison of a 24-joint hand takes, and what a pose costs in a loop over the engines (the baseline).

python scripts/benchmark_conform.py [--poses 10000]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from conform_hand import make_hand, write_mjcf, write_urdf

from hand_model.conform import conform


def baseline(urdf: Path, mjcf: Path, poses: int) -> float:
    """Seconds for the comparison as one writes it first: both engines, pose by pose, link by link, raw difference
    only."""
    import mujoco
    import numpy as np
    import pinocchio as pin

    from hand_model.conform.check import read
    from hand_model.conform.evaluate import skeleton

    model = pin.buildModelFromUrdf(str(urdf))
    data = model.createData()
    twin = mujoco.MjModel.from_xml_string(skeleton(read(mjcf)))
    state = mujoco.MjData(twin)
    names = list(model.names)[1:]
    rng = np.random.default_rng(0)
    start = time.perf_counter()
    worst = 0.0
    for _ in range(poses):
        q = rng.uniform(-0.1, 1.0, model.nq)
        pin.forwardKinematics(model, data, q)
        for name in names:
            state.joint(name).qpos[0] = q[model.idx_qs[model.getJointId(name)]]
        mujoco.mj_kinematics(twin, state)
        origin = state.body("palm_base")
        for name in names:
            here = origin.xmat.reshape(3, 3).T @ (state.body(f"{name}_link").xpos - origin.xpos)
            worst = max(worst, float(np.abs(here - data.oMi[model.getJointId(name)].translation).max()))
    return time.perf_counter() - start


def main() -> None:
    """Print the timings."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--poses", type=int, default=10000)
    poses = parser.parse_args().poses
    links = make_hand(0)
    with tempfile.TemporaryDirectory() as folder:
        urdf, mjcf = write_urdf(links, Path(folder) / "a.urdf"), write_mjcf(links, Path(folder) / "b.xml")
        conform(urdf, mjcf, poses=10, engines=("mujoco", "pinocchio"))  # imports
        alone = conform(urdf, mjcf, poses=poses)
        both = conform(urdf, mjcf, poses=poses, engines=("mujoco", "pinocchio"))
        loop = baseline(urdf, mjcf, max(poses // 10, 1)) * poses / max(poses // 10, 1)
    print(f"24 joints, {poses} poses")
    print(f"  own kinematics only          {alone.seconds:6.2f} s   agree: {alone.ok}")
    print(f"  with both engines' own time  {both.seconds:6.2f} s   {both.evaluated_by}")
    print(f"  baseline, loop over engines  {loop:6.2f} s   (raw differences only, extrapolated from a tenth)")


if __name__ == "__main__":
    main()
