"""The paper's figures and tables, regenerated beside its own numbers."""

from qpmpc.verification.reproduction.study import Study, job_count, run_study
from qpmpc.verification.reproduction.variants import Extent

__all__ = ["Extent", "Study", "job_count", "run_study"]
