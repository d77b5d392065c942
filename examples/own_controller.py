"""Own controller: a class with one method, compared with ours. The safety layer is included."""

import qpmpc


class Eager(qpmpc.Controller):
    name = "eager"

    def step(self, seen):
        on = seen.demand_w > 8e3 or seen.soc < 0.59 or seen.t_cl_degc < 42.0
        return qpmpc.Command(on, max(seen.demand_w, 9e3))


print(qpmpc.compare("nycc", [Eager, "rule-based", "mh-qp"]))
