"""FASTSim's 2016 Prius as the plant: a judge that nobody here wrote. See docs/fastsim.md."""
