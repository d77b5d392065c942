"""Preview: forecasts and the multi-horizon stages made from them."""

from qpmpc.preview.checked import CheckedPreview, NoPreviewError
from qpmpc.preview.forecast import Trace
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import Preview, StageBuilder, Stages

__all__ = [
    "CheckedPreview",
    "HorizonSettings",
    "NoPreviewError",
    "Preview",
    "StageBuilder",
    "Stages",
    "Trace",
]
