"""Random piecewise-smooth systems, and what every solution of them fulfils; `make fuzz`."""
