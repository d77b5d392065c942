"""Every cycle on FASTSim's Prius: the table of docs/fastsim.md."""
