"""Aircraft of JSBSim, a flight dynamics model that others wrote and trust, as plants of ours."""
