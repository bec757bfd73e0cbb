"""What is to be tracked: the leaders' profiles."""
