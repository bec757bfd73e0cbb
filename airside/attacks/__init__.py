"""UAVs that lie to their neighbours: what they tell instead of the truth, in compiled code without allocation."""
