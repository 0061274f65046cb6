"""How many metres, how often, how honestly: seeded runs with their controls."""
