"""Convex piecewise-affine models with proven error bounds."""

from qpmpc.pwa.fit import PwaFit, fit_convex
from qpmpc.pwa.model import PwaModel, PwaTolerances

__all__ = ["PwaFit", "PwaModel", "PwaTolerances", "fit_convex"]
