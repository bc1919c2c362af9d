"""Writes grid.vol with Mitsuba 3, and expected_vol.txt: points in the unit cube and the values of `gridvolume`
there."""

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

random = np.random.default_rng(1)
# z, y, x
samples = random.random((3, 5, 10), dtype=np.float32)
mi.VolumeGrid(samples).write("grid.vol")
volume = mi.load_dict({"type": "gridvolume", "filename": "grid.vol", "raw": True})
with open("expected_vol.txt", "w") as file:
    for point in random.random((60, 3), dtype=np.float32):
        interaction = mi.Interaction3f()
        interaction.p = mi.Point3f(*[float(x) for x in point])
        value = volume.eval_1(interaction)
        file.write(" ".join(f"{x:.9g}" for x in [*point, value]) + "\n")
