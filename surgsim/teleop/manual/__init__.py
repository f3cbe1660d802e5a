"""A person at the master: what is wanted, the hand that does it, and its record."""
