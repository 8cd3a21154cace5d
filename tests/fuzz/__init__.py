"""Random piecewise-smooth systems, what every solution fulfils, and its derivatives; `make fuzz`."""
