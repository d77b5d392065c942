"""Preview: forecasts and the multi-horizon stages made from them."""

from qpmpc.preview.forecast import Trace
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import StageBuilder, Stages

__all__ = ["HorizonSettings", "StageBuilder", "Stages", "Trace"]
