"""S-functions of controller and plant, compiled once and kept between runs."""

import ctypes
from functools import cache

import pytest
from s_functions import Block, MxArray, library_of, number

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.parts.part import Part, controller_part, plant_part
from qpmpc.trip import Trip


@pytest.fixture(scope="session")
def trip() -> Trip:
    return Trip("nycc")


class Blocks:
    """Makes blocks: `qp` (mh-qp, f64), `costate` (mh-costate, f32), `plant`."""

    def __init__(self, trip: Trip) -> None:
        self.trip = trip
        self.part = cache(self._part)
        self.library = cache(self._library)

    def _part(self, name: str) -> Part:
        if name == "plant":
            return plant_part(self.trip.vehicle, self.trip)
        if name == "qp":
            return controller_part(self.trip, "mh-qp")
        return controller_part(self.trip, "mh-costate", precision="f32")

    def _library(self, name: str) -> ctypes.CDLL:
        return library_of(self.part(name), f"my_{name}")

    def make(self, name: str, *parameters: MxArray) -> Block:
        return Block(self.library(name), self.part(name), *parameters)

    def plant(self, soc: float = 0.6, t_cl_degc: float = 50.0) -> Block:
        return self.make("plant", number(soc), number(t_cl_degc))


@pytest.fixture(scope="session")
def blocks(trip: Trip) -> Blocks:
    if compiler() is None:
        pytest.skip("no C compiler on this machine")
    return Blocks(trip)
