"""The certificate of `mh-qp` where the settings ask for it."""

from collections.abc import Callable
from math import nan

from qpmpc.controllers.settings import MhQpSettings
from qpmpc.costate.of_qp import QpCertificate
from qpmpc.errors import InputError
from qpmpc.qp.stage_qp import StageQp


def certificate_of(qp: StageQp, of_qp: MhQpSettings, name: str) -> Callable[..., float]:
    """Return `QpCertificate.of`, or without `certificate` a function that returns nan.

    Raises
    ------
    InputError
        If another setting makes the QP one that the certificate does not know.
    """
    if not of_qp.certificate:
        return lambda *_: nan
    section = name.replace("-", "_")
    for other, is_set in (
        ("qp.soc_penalty_g", of_qp.qp.soc_penalty_g),
        ("learning", of_qp.learning),
    ):
        if is_set:
            raise InputError(
                f"{section}.certificate has no meaning with {section}.{other}: leave out one"
            )
    return QpCertificate(qp, of_qp.horizon).of
