"""What ``qpmpc`` says without a command: what to do next."""

FIRST_RUN = """\
qpmpc drives hybrid cars on cycles, by multi-horizon MPC, by rules and by the optimum.

  qpmpc simulate nycc
      Drive New York's city cycle with the controller mh-qp: fuel and limits, in seconds.
  qpmpc compare nycc --controllers rule-based,mh-qp --out results
      See what it saves against rules; pictures and a report go into the folder results.
  qpmpc simulate my_trip.csv --vehicle prius-liion
      Your own road, columns time_s,speed_mps, with another car (qpmpc vehicles lists them).
  qpmpc doctor
      What is installed here, what is missing, and what that disables.

qpmpc --help lists all commands, qpmpc COMMAND --help shows examples of one;
qpmpc --install-completion lets the shell complete commands and names.
"""
