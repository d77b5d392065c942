"""Report: two cycles, three controllers, one HTML page that needs no other file."""

import qpmpc

runs = qpmpc.compare(
    ["nycc", "nedc-truncated"],
    ["rule-based", "mh-qp-paper", "mh-qp"],
    settings={"trip.t_cl_init_degc": 60},
)
print(runs)
print(runs.to_html("report.html"), "written")
