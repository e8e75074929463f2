#!/usr/bin/env python3
"""Plots a level slice through the field of a run:  example_slice.py RUN PICTURE.png [HEIGHT, 0 to 1 of the box]"""

import sys

import cnerf
import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot

folder, picture, height = (sys.argv[1:] + ["0.5"])[:3]
scene = cnerf.open_run(folder).scene()
low, high = scene.box
x, y = (np.linspace(low[axis], high[axis], 400) for axis in (0, 1))
points = np.stack(np.broadcast_arrays(x, y[:, None], low[2] + float(height) * (high[2] - low[2])), axis=-1)

density = scene.density(points)  # 1/world unit
color = np.clip(scene.color(points, (0, 0, -1)), 0, 1) ** (1 / 2.2)  # as seen from above
opacity = 1 - np.exp(-density * (high[0] - low[0]) / 100)  # of a hundredth of the box
left, right = pyplot.subplots(1, 2, figsize=(12, 6))[1]
left.imshow(np.log1p(density), origin="lower", extent=[low[0], high[0], low[1], high[1]])
left.set_title("ln(1 + density)")
right.imshow(color * opacity[..., None], origin="lower", extent=[low[0], high[0], low[1], high[1]])
right.set_title("colour, over black")
pyplot.savefig(picture)
