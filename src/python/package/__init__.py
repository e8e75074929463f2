"""Colour volumes from black-and-white photographs: runs, bakes and the steps that make them."""

from ._cnerf import *  # noqa: F401,F403
from ._cnerf import __version__  # noqa: F401
