"""What can follow at a point, decided without the product: exact power series of the motion of every mode."""
